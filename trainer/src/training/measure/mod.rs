//! What training and draping cost: time by part of a step, time beside other implementations, memory.

mod case;
mod export;
mod phases;
mod subject;

pub use case::Case;
pub use export::export;
pub use phases::{OTHER, PHASES, SpanSeconds, record_phases};
pub use subject::{Costs, Profile, Subject};
