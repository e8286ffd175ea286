//! `clothcombo-train`.

use crate::config::{Config, load};
use crate::device::Backend;
use crate::event::Observer;
use crate::observer::{CurvesObserver, MetricsObserver, ProgressObserver};
use crate::run_dir::RunDir;
use crate::scene::Library;
use crate::session::Session;
use crate::stop::StopFlag;
use crate::train_loop::train;
use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Trains ClothCombo's four networks from a configuration file.
#[derive(Parser)]
#[command(
    version,
    after_help = "Examples:\n  clothcombo-train --config configs/smoke.toml\n  \
        clothcombo-train --config configs/open.toml --run-dir runs/wide --set model.width=128\n  \
        clothcombo-train --run-dir runs/wide --resume\n\n\
        Ctrl-C or SIGTERM saves a checkpoint and exits 0; a second one ends at once."
)]
pub struct Arguments {
    /// Configuration file (TOML); optional with --resume --run-dir, which use the run's own
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Overrides one value, for example losses.strain.weight=2.0 or stages.0.steps=500; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Continues the run from its newest checkpoint
    #[arg(long)]
    resume: bool,
    /// Folder of the run; default: runs/NAME-OF-CONFIG, numbered when taken
    #[arg(long, value_name = "DIR")]
    run_dir: Option<PathBuf>,
    /// Compute device
    #[arg(long, value_enum, default_value_t = Backend::preferred())]
    device: Backend,
    /// No progress, only errors
    #[arg(long, short)]
    quiet: bool,
    /// More log lines; twice for debugging
    #[arg(long, short, action = clap::ArgAction::Count)]
    verbose: u8,
}

impl Arguments {
    /// Default log filter for this verbosity.
    pub fn log_level(&self) -> &'static str {
        match (self.quiet, self.verbose) {
            (true, _) => "error",
            (false, 0) => "warn",
            (false, 1) => "info,clothcombo_trainer=debug",
            (false, _) => "debug",
        }
    }

    fn config_file(&self) -> Result<PathBuf, Report> {
        match (&self.config, &self.run_dir, self.resume) {
            (Some(file), _, _) => Ok(file.clone()),
            (None, Some(run), true) => Ok(run.join("config.toml")),
            _ => Err(miette!(help = "for example --config configs/smoke.toml", "no configuration was given")),
        }
    }
}

/// Runs the program.
///
/// # Errors
/// One report that names the file, key or garment at fault and how to mend it.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let stop = StopFlag::on_signals().into_diagnostic().wrap_err("cannot listen for Ctrl-C")?;
    let file = arguments.config_file()?;
    let config = load(&file, &arguments.overrides)?;
    let root = match &arguments.run_dir {
        Some(dir) => dir.clone(),
        None => default_run_dir(&file, arguments.resume),
    };
    // What is wrong with the folder is said before minutes are spent on data; wrong data leaves no folder behind.
    let existing = match arguments.resume {
        true => Some(RunDir::resume(&root, &config)?),
        false => RunDir::refuse_occupied(&root).map(|()| None)?,
    };
    let library = Arc::new(load_library(&config, arguments.quiet)?);
    let run = match existing {
        Some(run) => run,
        None => RunDir::create(&root, &config)?,
    };
    run.write_split(&library.split_names())?;
    if !arguments.quiet {
        eprintln!("run folder {}", run.root().display());
    }
    let device = arguments.device.device();
    let mut session = match arguments.resume {
        true => Session::resume(run.clone(), config.clone(), library, &device)?,
        false => Session::new(run.clone(), config.clone(), library, &device)?,
    };
    let step = session.step();
    let mut observers: Vec<Box<dyn Observer>> = vec![
        Box::new(MetricsObserver::new(&run, step, config.output.metrics_every)?),
        Box::new(CurvesObserver::new(&run, &config)?),
    ];
    if !arguments.quiet {
        observers.push(Box::new(ProgressObserver::default()));
    }
    train(&mut session, &mut observers, &stop)
}

/// Loads the data of `config` under a bar.
pub(crate) fn load_under_bar(config: &Config, quiet: bool) -> Result<Library, Report> {
    let bar = garment_progress(quiet);
    let library = Library::load(config, &|done, total, name| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
        bar.set_message(name.to_owned());
    })?;
    bar.finish_and_clear();
    Ok(library)
}

/// The bar shown while garments are prepared.
pub(crate) fn garment_progress(quiet: bool) -> ProgressBar {
    let style = ProgressStyle::with_template("preparing garments {bar:30} {pos}/{len} {msg}")
        .expect("the template is valid");
    if quiet { ProgressBar::hidden() } else { ProgressBar::new(0).with_style(style) }
}

fn load_library(config: &Config, quiet: bool) -> Result<Library, Report> {
    let library = load_under_bar(config, quiet)?;
    if !quiet {
        eprintln!(
            "body: {} · {} garments ({} not trained on) · {} joints · {} shape components{}",
            library.body.name,
            library.wardrobe.len(),
            library.wardrobe.len() - library.split.training.len(),
            library.joints().len(),
            library.shape_count,
            match library.poses.frame_counts() {
                Some([train, held_out, unseen]) => {
                    format!(" · {train} motion frames ({held_out} more held out, {unseen} of unseen clips)")
                }
                None => " · sampled poses".into(),
            }
        );
    }
    Ok(library)
}

/// `runs/NAME`, or the first free `runs/NAME-2`, `-3`, …; when resuming, the last existing one.
fn default_run_dir(config: &Path, resume: bool) -> PathBuf {
    let name = config.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let candidate =
        |i: usize| Path::new("runs").join(if i == 1 { name.clone() } else { format!("{name}-{i}") });
    let free = (1..).find(|&i| !candidate(i).join("config.toml").exists()).unwrap_or(1);
    candidate(if resume { free.max(2) - 1 } else { free })
}
