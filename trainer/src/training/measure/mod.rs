//! What training and draping cost: time by part of a step, memory, and files for comparison with other implementations.

mod benchmark_run;
mod case;
mod export;
mod phases;

pub use benchmark_run::{BenchmarkRun, Costs, Profile};
pub use case::Case;
pub use export::{NETWORKS, export};
pub use phases::{OTHER, PHASES, SpanSeconds, record_phases};
