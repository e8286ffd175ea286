//! `clothcombo bench`: measurements that a user can repeat.

pub mod generator;
pub mod poses;

use clap::Subcommand;
use miette::Report;

/// Measures what the documentation claims
#[derive(Subcommand)]
pub enum Bench {
    /// The generator's promises over many garments, with the failure rate and the time
    Generator(generator::Arguments),
    /// Self-intersections of posed bodies, their share and the cost of finding them
    Poses(poses::Arguments),
}

/// Runs the bench.
///
/// # Errors
/// When an input cannot be read or a promise does not hold.
pub fn run(bench: &Bench) -> Result<(), Report> {
    match bench {
        Bench::Generator(arguments) => generator::run(arguments),
        Bench::Poses(arguments) => poses::run(arguments),
    }
}
