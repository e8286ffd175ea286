//! Programs' eyes on a run: each observer turns events into one kind of output.

mod curves;
mod metrics;
mod progress;

pub use curves::CurvesObserver;
pub use metrics::MetricsObserver;
pub use progress::ProgressObserver;
