//! The progress bar: stage, steps per second, time left, loss. Without a terminal, a line now and then.

use super::history::SharedHistory;
use crate::run::event::{Observer, TrainEvent};
use crate::run::folder::RunDir;
use crate::system::closed_pipe::print_stderr;
use indicatif::{ProgressBar, ProgressStyle};
use miette::Report;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Seconds between lines when there is no terminal to draw on.
const PLAIN_INTERVAL: Duration = Duration::from_secs(15);

/// Shows a run on stderr. It comes after what keeps the history.
pub struct ProgressObserver {
    history: SharedHistory,
    log: PathBuf,
    bar: Option<ProgressBar>,
    terminal: bool,
    started_at: u64,
    total: u64,
    stage: String,
    smoothed_loss: f64,
    start: Instant,
    last_line: Instant,
}

impl ProgressObserver {
    /// Shows `run`, which `history` is kept of.
    pub fn new(run: &RunDir, history: SharedHistory) -> Self {
        Self {
            history,
            log: run.log(),
            bar: None,
            terminal: std::io::stderr().is_terminal(),
            started_at: 0,
            total: 0,
            stage: String::new(),
            smoothed_loss: f64::NAN,
            start: Instant::now(),
            last_line: Instant::now(),
        }
    }

    /// Prints `text` above the bar.
    fn print_line(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.println(text),
            None => print_stderr(text),
        }
    }

    fn abandon_bar(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.abandon();
        }
    }

    fn plain_line(&mut self, step: u64) {
        if self.last_line.elapsed() < PLAIN_INTERVAL {
            return;
        }
        self.last_line = Instant::now();
        let per_second = (step - self.started_at) as f64 / self.start.elapsed().as_secs_f64();
        let left = Duration::from_secs_f64((self.total - step) as f64 / per_second.max(1e-9));
        print_stderr(format_args!(
            "{} · step {step}/{} · {per_second:.1} steps/s · {} left · {}",
            self.stage,
            self.total,
            indicatif::HumanDuration(left),
            self.message()
        ));
    }

    /// The end of a progress line: the loss, and how many spikes of the gradient the run has had.
    fn message(&self) -> String {
        let loss = format!("loss {:.3}", self.smoothed_loss);
        match self.spikes() {
            None => loss,
            Some(spikes) => format!("{loss} · {spikes}"),
        }
    }

    fn spikes(&self) -> Option<String> {
        match self.history.borrow().spikes.len() {
            0 => None,
            1 => Some("1 spike".into()),
            several => Some(format!("{several} spikes")),
        }
    }

    /// Where the spikes stand, for the last line of a session.
    fn listed(&self) -> String {
        let listed = |spikes| format!(" · {spikes} of the gradient: {}", self.log.display());
        self.spikes().map(listed).unwrap_or_default()
    }
}

impl Observer for ProgressObserver {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), Report> {
        match event {
            TrainEvent::Started { step, total_steps } => {
                (self.started_at, self.total) = (*step, *total_steps);
                (self.start, self.last_line) = (Instant::now(), Instant::now());
                if self.terminal {
                    let style = ProgressStyle::with_template(
                        "{prefix:.bold} {wide_bar} {pos}/{len} · {per_sec} · {eta} left · {msg}",
                    )
                    .expect("the template is valid");
                    let bar = ProgressBar::new(*total_steps).with_style(style).with_position(*step);
                    bar.reset_eta();
                    self.bar = Some(bar);
                }
            }
            TrainEvent::StageStarted { name, step, steps } => {
                self.stage = (*name).to_owned();
                self.print_line(&format!("stage {name}: {steps} steps from step {step}"));
                if let Some(bar) = &self.bar {
                    bar.set_prefix((*name).to_owned());
                }
            }
            TrainEvent::Step(record) => {
                self.smoothed_loss = match self.smoothed_loss.is_finite() {
                    true => self.smoothed_loss + 0.02 * (record.loss - self.smoothed_loss),
                    false => record.loss,
                };
                match &self.bar {
                    Some(bar) => {
                        bar.set_message(self.message());
                        bar.set_position(record.step);
                    }
                    None => self.plain_line(record.step),
                }
            }
            TrainEvent::Validated { step, report, .. } => {
                self.print_line(&format!("validation after step {step}\n{report}"));
            }
            TrainEvent::Skipped { step, count, file } => {
                let file = file.map(|f| format!(", scene in {}", f.display())).unwrap_or_default();
                self.print_line(&format!(
                    "step {step} skipped: loss or gradient not finite ({count} lately){file}"
                ));
            }
            // Dozens of them are usual where poses are hard, and clipping makes them harmless: counted, and listed in the log.
            TrainEvent::Spike { .. } | TrainEvent::CheckpointDue => {}
            TrainEvent::CheckpointSaved { path } => {
                if !self.terminal {
                    self.print_line(&format!("checkpoint {}", path.display()));
                }
            }
            TrainEvent::SampleDrawn { path } => self.print_line(&format!("picture {}", path.display())),
            TrainEvent::Interrupted { step } => {
                self.print_line(&format!(
                    "stopped after step {step}; continue with --resume{}",
                    self.listed()
                ));
                self.abandon_bar();
            }
            TrainEvent::GaveUp { .. } => self.abandon_bar(),
            TrainEvent::Finished { step } => {
                if let Some(bar) = self.bar.take() {
                    bar.finish();
                }
                print_stderr(format_args!(
                    "finished after step {step} in {:.0} s{}",
                    self.start.elapsed().as_secs_f64(),
                    self.listed()
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::event::StepRecord;
    use crate::run::observer::{History, HistoryObserver};
    use std::cell::RefCell;
    use std::rc::Rc;

    #[test]
    fn spikes_are_one_count_in_the_line() {
        let history: SharedHistory = Rc::new(RefCell::new(History::default()));
        let folder = tempfile::tempdir().unwrap();
        let mut progress = ProgressObserver::new(&RunDir::follow(folder.path()), history.clone());
        let mut keeper = HistoryObserver(history);
        for (step, spike, expected) in
            [(1, false, "loss 2.000"), (2, true, "loss 2.000 · 1 spike"), (3, true, "loss 2.000 · 2 spikes")]
        {
            let record = StepRecord { step, loss: 2.0, spike, ..StepRecord::default() };
            keeper.observe(&TrainEvent::Step(&record)).unwrap();
            progress.observe(&TrainEvent::Step(&record)).unwrap();
            assert_eq!(progress.message(), expected);
        }
        assert!(
            progress.listed().contains("2 spikes of the gradient") && progress.listed().ends_with("log.txt")
        );
    }
}
