//! Keeps `RUN/report.html` fresh.

use super::curves::stage_boundaries;
use super::history::SharedHistory;
use crate::config::{Config, to_toml};
use crate::dataset::LicenceLine;
use crate::picture::chart::StageBoundary;
use crate::run::event::{Observer, TrainEvent};
use crate::run::folder::RunDir;
use crate::run::memory::MemoryEstimate;
use crate::run::report::{Page, RunState, run_name};
use crate::system::memory::Memory;
use clothcombo_data::format::atomic;
use miette::{IntoDiagnostic, Report, WrapErr};
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Writes the report of a run.
pub struct ReportObserver {
    path: PathBuf,
    name: String,
    config: String,
    stages: Vec<StageBoundary>,
    total_steps: u64,
    licences: Vec<LicenceLine>,
    memory: Option<MemoryEstimate>,
    history: SharedHistory,
    every: Option<Duration>,
    written: Instant,
    session: (Instant, u64),
}

impl ReportObserver {
    /// A page about what `history` holds. `memory` is what the run was expected to need.
    ///
    /// # Errors
    /// When the configuration has no text.
    pub fn new(
        run: &RunDir,
        config: &Config,
        licences: Vec<LicenceLine>,
        memory: Option<MemoryEstimate>,
        history: SharedHistory,
    ) -> Result<Self, Report> {
        let every = config.output.report_every;
        Ok(Self {
            path: run.report(),
            name: run_name(run.root()),
            config: to_toml(config).into_diagnostic()?,
            stages: stage_boundaries(config),
            total_steps: config.total_steps(),
            licences,
            memory,
            history,
            every: (every > 0.0).then(|| Duration::try_from_secs_f64(every).unwrap_or(Duration::MAX)),
            written: Instant::now(),
            session: (Instant::now(), 0),
        })
    }

    fn write(&mut self, state: RunState) -> Result<(), Report> {
        self.written = Instant::now();
        let history = self.history.borrow();
        let (start, first) = self.session;
        let done = history.last.as_ref().map_or(0, |(step, _)| step.saturating_sub(first));
        let page = Page {
            name: &self.name,
            state,
            total_steps: self.total_steps,
            made: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs()),
            speed: (done > 0).then(|| done as f64 / start.elapsed().as_secs_f64()),
            stages: &self.stages,
            history: &history,
            config: &self.config,
            licences: &self.licences,
            memory: self.memory,
            peak: Memory::now().map(|m| m.peak),
        };
        atomic::write(&self.path, page.html().as_bytes())
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot write {}", self.path.display()))
    }
}

impl Observer for ReportObserver {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), Report> {
        match event {
            TrainEvent::Started { step, .. } => {
                self.session = (Instant::now(), *step);
                self.write(RunState::Running)
            }
            TrainEvent::Step(_) if self.every.is_some_and(|every| self.written.elapsed() >= every) => {
                self.write(RunState::Running)
            }
            TrainEvent::Validated { .. } | TrainEvent::CheckpointSaved { .. } => {
                self.write(RunState::Running)
            }
            TrainEvent::Interrupted { .. } => self.write(RunState::Interrupted),
            TrainEvent::GaveUp { .. } => self.write(RunState::GaveUp),
            TrainEvent::Finished { .. } => self.write(RunState::Finished),
            _ => Ok(()),
        }
    }
}
