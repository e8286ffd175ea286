//! What training and draping cost: time by part of a step, time beside other implementations, memory.

mod case;
mod export;
mod memory;
mod phases;
mod subject;

pub use case::Case;
pub use export::export;
pub use memory::{peak_memory, reset_peak_memory};
pub use phases::{OTHER, PHASES, PhaseTimes, record_phases};
pub use subject::{Costs, Profile, Subject, median_ms};
