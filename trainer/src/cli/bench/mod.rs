//! `clothcombo bench`: measurements that a user can repeat.

pub mod distance;
pub mod stability;

use clap::Subcommand;
use miette::Report;

/// Measures what the documentation claims
#[derive(Subcommand)]
pub enum Bench {
    /// How often the sign of the distance to the body is wrong, by nearest vertex and by closest surface point
    Distance(distance::Arguments),
    /// Every energy on every hard case: finite, bounded, a true gradient, the same in both precisions
    Stability(stability::Arguments),
}

/// Runs the bench.
///
/// # Errors
/// When an input cannot be read or a promise does not hold.
pub fn run(bench: &Bench) -> Result<(), Report> {
    match bench {
        Bench::Distance(arguments) => distance::run(arguments),
        Bench::Stability(arguments) => stability::run(arguments),
    }
}
