//! Programs' eyes on a run: each observer turns events into one kind of output.

mod history;
mod log;
mod log_file;
mod metrics;
mod progress;
mod report;
mod tensorboard;

pub use history::{History, HistoryObserver, SharedHistory};
pub use log::{LogObserver, moved};
pub use metrics::MetricsObserver;
pub use progress::ProgressObserver;
pub use report::ReportObserver;
pub use tensorboard::{EventFile, TensorBoardObserver};
