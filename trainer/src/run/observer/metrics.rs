//! `metrics.jsonl` and `validation.jsonl`: one JSON object per line, flushed before every checkpoint
//! and every few seconds.

use crate::run::event::{Observer, TrainEvent};
use crate::run::folder::{RunDir, truncate_log};
use miette::{IntoDiagnostic, Report, WrapErr};
use serde_json::json;
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How long a line may wait for the disk: whoever watches a run sees it this fresh.
const FLUSH_EVERY: Duration = Duration::from_secs(10);

/// Writes the logs of a run.
pub struct MetricsObserver {
    metrics: Log,
    validation: Log,
    every: u64,
    flushed: Instant,
}

struct Log {
    path: PathBuf,
    file: BufWriter<File>,
}

impl Log {
    /// Opens for appending after dropping lines later than `step`.
    fn open(path: &Path, step: u64) -> Result<Self, Report> {
        let opened = truncate_log(path, step)
            .and_then(|()| OpenOptions::new().create(true).append(true).open(path))
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot write {}", path.display()))?;
        Ok(Self { path: path.to_owned(), file: BufWriter::new(opened) })
    }

    fn line(&mut self, value: &impl serde::Serialize) -> Result<(), Report> {
        let write = |file: &mut BufWriter<File>| -> std::io::Result<()> {
            serde_json::to_writer(&mut *file, value)?;
            file.write_all(b"\n")
        };
        write(&mut self.file)
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot write {}", self.path.display()))
    }

    fn flush(&mut self) -> Result<(), Report> {
        self.file.flush().into_diagnostic().wrap_err_with(|| format!("cannot write {}", self.path.display()))
    }
}

impl MetricsObserver {
    /// Continues the logs of `run` after `step`; every `every`-th step is logged, and
    /// every one that was skipped or is a spike.
    ///
    /// # Errors
    /// When a log cannot be written.
    pub fn new(run: &RunDir, step: u64, every: u64) -> Result<Self, Report> {
        Ok(Self {
            metrics: Log::open(&run.metrics(), step)?,
            validation: Log::open(&run.validation(), step)?,
            every,
            flushed: Instant::now(),
        })
    }
}

impl Observer for MetricsObserver {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), Report> {
        match event {
            TrainEvent::Step(record) if record.step % self.every == 0 || record.skipped || record.spike => {
                self.metrics.line(record)?;
                if self.flushed.elapsed() < FLUSH_EVERY {
                    return Ok(());
                }
                self.flushed = Instant::now();
                self.metrics.flush()
            }
            TrainEvent::Validated { step, report, best } => {
                let best = best.map(|best| json!({ "step": best.step, "score": best.score.0 }));
                let (score, groups) = (report.score(), &report.groups);
                self.validation
                    .line(&json!({ "step": step, "score": score, "best": best, "groups": groups }))?;
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
