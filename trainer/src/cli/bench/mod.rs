//! `clothcombo bench`: measurements that a user can repeat.

pub mod generator;

use clap::Subcommand;
use miette::Report;

/// Measures what the documentation claims
#[derive(Subcommand)]
pub enum Bench {
    /// The generator's promises over many garments, with the failure rate and the time
    Generator(generator::Arguments),
}

/// Runs the bench.
///
/// # Errors
/// When an input cannot be read or a promise does not hold.
pub fn run(bench: &Bench) -> Result<(), Report> {
    match bench {
        Bench::Generator(arguments) => generator::run(arguments),
    }
}
