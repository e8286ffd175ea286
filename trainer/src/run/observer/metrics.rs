//! `metrics.jsonl` and `validation.jsonl`: one JSON object per line, flushed before every checkpoint
//! and every few seconds.

use super::log_file::LogFile;
use crate::run::event::{Observer, TrainEvent};
use crate::run::folder::{RunDir, truncate_log};
use miette::{IntoDiagnostic, Report};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// How long a line may wait for the disk: whoever watches a run sees it this fresh.
const FLUSH_EVERY: Duration = Duration::from_secs(10);

/// Writes the logs of a run.
pub struct MetricsObserver {
    metrics: LogFile,
    validation: LogFile,
    every: u64,
    flushed: Instant,
}

impl MetricsObserver {
    /// Continues the logs of `run` after `step`; every `every`-th step is logged, and
    /// every one that was skipped or is a spike.
    ///
    /// # Errors
    /// When a log cannot be written.
    pub fn new(run: &RunDir, step: u64, every: u64) -> Result<Self, Report> {
        let open = |path: PathBuf| {
            // Lines later than the step are made again.
            let truncated = truncate_log(&path, step);
            LogFile::append(path, truncated)
        };
        let (metrics, validation) = (open(run.metrics())?, open(run.validation())?);
        Ok(Self { metrics, validation, every, flushed: Instant::now() })
    }
}

impl Observer for MetricsObserver {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), Report> {
        match event {
            TrainEvent::Step(record) if record.step % self.every == 0 || record.skipped || record.spike => {
                self.metrics.line(serde_json::to_string(record).into_diagnostic()?)?;
                if self.flushed.elapsed() < FLUSH_EVERY {
                    return Ok(());
                }
                self.flushed = Instant::now();
                self.metrics.flush()
            }
            TrainEvent::Validated { step, report, best } => {
                self.validation.line(report.line(*step, *best))?;
                self.validation.flush()
            }
            TrainEvent::CheckpointDue
            | TrainEvent::Interrupted { .. }
            | TrainEvent::GaveUp { .. }
            | TrainEvent::Finished { .. } => self.metrics.flush(),
            _ => Ok(()),
        }
    }
}
