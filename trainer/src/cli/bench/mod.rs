//! `clothcombo bench`: measurements.

pub mod error;

use clap::Subcommand;
use miette::Report;

/// Measures error, speed and stability
#[derive(Subcommand)]
pub enum Bench {
    /// Energy above the equilibrium and distance to it, for skinning and a trained network, on random scenes
    Error(error::Arguments),
}

/// Runs the verb.
///
/// # Errors
/// As the measurement that was asked for.
pub fn run(bench: &Bench) -> Result<(), Report> {
    match bench {
        Bench::Error(arguments) => error::run(arguments),
    }
}
