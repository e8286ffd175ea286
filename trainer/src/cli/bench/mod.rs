//! `clothcombo bench`: measurements that a user can repeat.

pub mod backends;
pub mod stability;
pub mod step;

use clap::Subcommand;
use miette::Report;

/// Measures what the documentation claims
#[derive(Subcommand)]
pub enum Bench {
    /// Whether all compute devices of this build agree on loss and gradients, and how fast they are
    Backends(backends::Arguments),
    /// Every energy on every degenerate case: finite, bounded, a true gradient, the same in both precisions
    Stability(stability::Arguments),
    /// Where the time of a training step goes: parts, single networks, losses, memory
    Step(Box<step::Arguments>),
}

/// Runs the bench.
///
/// # Errors
/// When an input cannot be read or a guarantee does not hold.
pub fn run(bench: &Bench) -> Result<(), Report> {
    match bench {
        Bench::Backends(arguments) => backends::run(arguments),
        Bench::Stability(arguments) => stability::run(arguments),
        Bench::Step(arguments) => step::run(arguments),
    }
}
