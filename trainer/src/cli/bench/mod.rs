//! `clothcombo bench`: measurements that a user can repeat.

pub mod backends;
pub mod certificate;
pub mod distance;
pub mod error;
pub mod growth;
pub mod operators;
pub mod poses;
pub mod stability;
pub mod step;
pub mod tradeoff;

use clap::Subcommand;
use miette::Report;

/// Measures what the documentation claims
#[derive(Subcommand)]
pub enum Bench {
    /// Whether all compute devices of this build agree on loss and gradients, and how fast they are
    Backends(backends::Arguments),
    /// Random outfits taken out of body and each other: what is left, by exact count, what it changed, how long it took
    Certificate(certificate::Arguments),
    /// How often the sign of the distance to the body is wrong, by nearest vertex and by closest surface point
    Distance(distance::Arguments),
    /// Energy above the equilibrium and distance to it, for skinning and a trained network, on random scenes
    Error(error::Arguments),
    /// Every energy on every hard case: finite, bounded, a true gradient, the same in both precisions
    Stability(stability::Arguments),
    /// Where the time of a training step goes: parts, single networks, losses, memory
    Step(step::Arguments),
    /// Speed against error: eigenpairs, half-precision weights, other networks; precision and distance of the losses
    Tradeoff(tradeoff::Arguments),
    /// How time and memory of a training step grow with vertices, layers, width and eigenpairs
    Growth(growth::Arguments),
    /// What preparing a garment for DiffusionNet costs, and how exact its eigenpairs are
    Operators(operators::Arguments),
    /// Self-intersections of posed bodies, their share and the cost of finding them
    Poses(poses::Arguments),
}

/// Runs the bench.
///
/// # Errors
/// When an input cannot be read or a promise does not hold.
pub fn run(bench: &Bench) -> Result<(), Report> {
    match bench {
        Bench::Backends(arguments) => backends::run(arguments),
        Bench::Certificate(arguments) => certificate::run(arguments),
        Bench::Distance(arguments) => distance::run(arguments),
        Bench::Error(arguments) => error::run(arguments),
        Bench::Stability(arguments) => stability::run(arguments),
        Bench::Step(arguments) => step::run(arguments),
        Bench::Tradeoff(arguments) => tradeoff::run(arguments),
        Bench::Growth(arguments) => growth::run(arguments),
        Bench::Operators(arguments) => operators::run(arguments),
        Bench::Poses(arguments) => poses::run(arguments),
    }
}
