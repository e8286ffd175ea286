//! The memory that a run is expected to use, estimated before it starts.

mod activations;
mod estimate;

pub use activations::largest_tensor;
pub use estimate::MemoryEstimate;
