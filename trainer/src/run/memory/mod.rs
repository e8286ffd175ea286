//! The memory that a run is expected to use, estimated before it starts.

mod activations;
mod estimate;

pub use estimate::MemoryEstimate;
