//! `clothcombo bench generator`: the promises of the garment generator over many seeds.

use crate::cli::values::{at_least_one, share};
use crate::cli::verbosity::progress_bar;
use crate::dataset::load_body;
use clap::Parser;
use clothcombo_data::generate::{GarmentGenerator, GarmentSettings, Survey};
use miette::{IntoDiagnostic, Report, miette};

/// Makes garments and measures each against the generator's promises
#[derive(Parser)]
#[command(
    after_help = "Example:\n  clothcombo bench generator --count 1000 --body datasets/open/body.npz\n\n\
                  Per category: garments asked for, kept at the first design, designs rejected, garments failed; then over all garments: \
                  vertices, smallest angle [degrees], edge lengths relative to the median, least distance to the body [mm], exact \
                  triangle pairs with the body and with itself, garments that are no one-piece manifold, mean time [ms]."
)]
pub struct Arguments {
    /// Number of garments; categories are taken in turn
    #[arg(long, default_value_t = 1000, value_parser = at_least_one)]
    count: usize,
    /// First seed; garment i uses seed + i
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Body the garments fit: "mannequin" or a body npz
    #[arg(long, default_value = "mannequin")]
    body: String,
    /// Vertices per garment, about: 200 to 50000
    #[arg(long, default_value_t = 1500)]
    vertices: usize,
    /// Largest share of garments for which no design may pass
    #[arg(long, default_value_t = 0.001, value_parser = share)]
    most_failures: f64,
}

/// Runs the bench; the table goes to stdout.
///
/// # Errors
/// When the body cannot be used, a garment breaks a promise, or too many garments fail.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let body = load_body(&arguments.body, 0)?;
    let generator = GarmentGenerator::new(&body).into_diagnostic()?;
    let settings = GarmentSettings { target_vertices: arguments.vertices, ..GarmentSettings::default() };
    let bar = progress_bar(arguments.count, "garments {bar:40} {pos}/{len} · {eta} left");
    let survey = Survey::new(&generator, arguments.count, arguments.seed, &settings, &|| bar.inc(1))
        .into_diagnostic()?;
    bar.finish_and_clear();
    println!("{survey}");
    if !survey.keeps_promises() {
        return Err(miette!("a generated garment breaks a promise; see the table"));
    }
    if survey.failure_rate() > arguments.most_failures {
        return Err(miette!(
            "{:.2} % of the garments failed, more than {:.2} %",
            100.0 * survey.failure_rate(),
            100.0 * arguments.most_failures
        ));
    }
    Ok(())
}
