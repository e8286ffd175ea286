//! `clothcombo prepare`: fills the cache of a configuration before training.

use crate::cli::data_check::check_data;
use crate::cli::loading::{make_pose_bank, under_preparation_bar};
use crate::cli::verbosity::print_status;
use crate::config::load;
use crate::dataset::{GarmentStore, PoseLibrary, load_body};
use clap::Parser;
use miette::Report;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

/// Computes operators and bindings of all garments of a configuration, and its bank of poses, into its cache (data.cache.folder)
#[derive(Parser)]
#[command(after_help = "Examples:\n  clothcombo prepare --config configs/open.toml --set \
        data.cache.folder=\"datasets/cache/prepared\"\n  clothcombo prepare --config big.toml --shard 0/4    # one of four \
        machines over one folder\n\n\
        Safe to stop, to repeat and to run on many machines at once: records appear whole, those there are left alone.")]
pub struct Arguments {
    /// Configuration file (TOML)
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Overrides one value; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Part i of n (from 0): every n-th garment
    #[arg(long, value_name = "i/n", default_value = "0/1")]
    shard: Shard,
}

/// Part `0` of `1` parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Shard([usize; 2]);

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((part, of)) if part < of => Ok(Self([part, of])),
            _ => Err("not a part i/n with i from 0 to n − 1, for example 0/4".into()),
        }
    }
}

/// Runs the verb.
///
/// # Errors
/// When the configuration or a garment is wrong, or the cache cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let config = load(&arguments.config, &arguments.overrides)?;
    check_data(&config)?;
    let body = Arc::new(load_body(&config.data.body, config.data.shape_components)?);
    let (garments, bytes) = under_preparation_bar(|progress| {
        GarmentStore::prepare(&config, body.clone(), arguments.shard.0, progress)
    })?;
    let mut poses = String::new();
    if let (Some(bank), 0) = (&config.data.poses.bank, arguments.shard.0[0]) {
        make_pose_bank(&PoseLibrary::new(&config.data.poses, &body)?.with_bank(&config));
        poses = format!(" · {} training poses", bank.size);
    }
    let mib = bytes as f64 / f64::from(1 << 20);
    print_status(&format!("{garments} garments prepared{poses} · {mib:.1} MiB in the cache"));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_read_and_nonsense_is_refused() {
        assert_eq!("1/4".parse(), Ok(Shard([1, 4])));
        for bad in ["4/4", "1", "a/b", "-1/2", "0/0"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
