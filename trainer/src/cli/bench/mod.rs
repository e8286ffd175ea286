//! `clothcombo bench`: measurements that a paper's tables come from.

pub mod distance;

use clap::Subcommand;
use miette::Report;

/// Measures how far results can be trusted
#[derive(Subcommand)]
pub enum Bench {
    /// How often the sign of the distance to the body is wrong, by nearest vertex and by closest surface point
    Distance(distance::Arguments),
}

/// Runs the verb.
///
/// # Errors
/// As the bench.
pub fn run(bench: &Bench) -> Result<(), Report> {
    match bench {
        Bench::Distance(arguments) => distance::run(arguments),
    }
}
