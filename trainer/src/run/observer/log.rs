//! `log.txt`: what happened in a run besides its steps, one line each.

use super::log_file::LogFile;
use crate::run::event::{Observer, TrainEvent};
use crate::run::folder::RunDir;
use miette::Report;
use std::fmt::Display;
use std::time::Instant;

/// Appends to the log of a run. Nothing is ever removed from it: a step that is repeated after a resume stands there twice.
pub struct LogObserver {
    file: LogFile,
    /// What the session says of its device.
    device: String,
    start: Instant,
}

impl LogObserver {
    /// Goes on with the log of `run`, now computed on `device`; `earlier` is where it was before, if that was elsewhere.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn new(run: &RunDir, device: &str, earlier: Option<&str>) -> Result<Self, Report> {
        let file = LogFile::append(run.log(), Ok(()))?;
        let device = earlier.map_or_else(|| device.to_owned(), |earlier| moved(earlier, device));
        Ok(Self { file, device, start: Instant::now() })
    }

    /// One line, with the seconds since the session began.
    fn line(&mut self, text: impl Display) -> Result<(), Report> {
        self.file.line(format_args!("{:>10.1} s  {text}", self.start.elapsed().as_secs_f64()))?;
        self.file.flush()
    }
}

/// What to say of a run that moved from one device to another.
pub fn moved(earlier: &str, now: &str) -> String {
    format!("{now}; the checkpoint was computed on {earlier}: the run goes on, its last bits may differ")
}

impl Observer for LogObserver {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), Report> {
        match event {
            TrainEvent::Started { step, total_steps } => {
                self.line(format_args!("session starts after step {step} of {total_steps}"))?;
                self.line(format!("device: {}", self.device))
            }
            TrainEvent::StageStarted { name, step, steps } => {
                self.line(format_args!("stage {name}: {steps} steps from step {step}"))
            }
            TrainEvent::Spike { step, norm, usual } => {
                self.line(format_args!("step {step}: gradient norm {norm:.3e}, usually {usual:.3e}"))
            }
            TrainEvent::Skipped { step, count, file } => {
                let file = file.map(|f| format!(", scene in {}", f.display())).unwrap_or_default();
                self.line(format_args!(
                    "step {step} skipped: loss or gradient not finite ({count} lately){file}"
                ))
            }
            TrainEvent::Validated { step, report, .. } => match report.score() {
                Some(score) => self.line(format_args!("validation after step {step}: score {score:.4}")),
                None => self.line(format_args!("validation after step {step}")),
            },
            TrainEvent::CheckpointSaved { path } => self.line(format_args!("checkpoint {}", path.display())),
            TrainEvent::Interrupted { step } => self.line(format_args!("stopped after step {step}")),
            TrainEvent::GaveUp { step } => self.line(format_args!("gave up after step {step}")),
            TrainEvent::Finished { step } => self.line(format_args!("finished after step {step}")),
            TrainEvent::Step(_) | TrainEvent::CheckpointDue | TrainEvent::SampleDrawn { .. } => Ok(()),
        }
    }
}
