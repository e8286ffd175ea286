//! Keeps `RUN/report.html` and `RUN/curves.png` fresh.

use super::history::SharedHistory;
use crate::config::{Config, StageConfig, stage_starts, to_toml};
use crate::dataset::{DataCheck, LicenceLine};
use crate::picture::chart::{ChartGrid, RunSteps, StageBoundary};
use crate::picture::save_png;
use crate::run::event::{Observer, TrainEvent};
use crate::run::folder::RunDir;
use crate::run::memory::MemoryEstimate;
use crate::run::report::{RunFacts, RunPage, RunState, StageBaseline, charts, run_name};
use crate::system::files::write_file;
use crate::system::memory::Memory;
use miette::{IntoDiagnostic, Report};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Writes the report of a run, and at every checkpoint its charts as a picture.
pub struct ReportObserver {
    path: PathBuf,
    curves: PathBuf,
    facts: RunFacts,
    history: SharedHistory,
    every: Option<Duration>,
    written: Instant,
    session: (Instant, u64),
}

impl ReportObserver {
    /// A page about what `history` holds. `device` is the name of the one it runs on, `memory` what the run was
    /// expected to need.
    ///
    /// # Errors
    /// When the configuration has no text.
    pub fn new(
        run: &RunDir,
        config: &Config,
        device: String,
        licences: Vec<LicenceLine>,
        memory: Option<MemoryEstimate>,
        history: SharedHistory,
    ) -> Result<Self, Report> {
        let every = config.output.report_every;
        Ok(Self {
            path: run.report(),
            curves: run.curves(),
            facts: RunFacts {
                name: run_name(run.root()),
                config: to_toml(config).into_diagnostic()?,
                device,
                steps: steps(config),
                baselines: StageBaseline::of_stages(config),
                licences,
                memory,
                warned_files: warned_files(&run.data_check()),
            },
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
        let page = RunPage {
            facts: &self.facts,
            state,
            made: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs()),
            speed: (done > 0).then(|| done as f64 / start.elapsed().as_secs_f64()),
            history: &history,
            peak: Memory::now().map(|m| m.peak),
        };
        write_file(&self.path, page.html().as_bytes())
    }

    fn draw_curves(&self) -> Result<(), Report> {
        let RunFacts { steps, baselines, .. } = &self.facts;
        let charts = charts(&self.history.borrow(), steps, baselines).into_iter().map(|(_, chart)| chart);
        let grid =
            ChartGrid { title: "Training".into(), legend: RunSteps::legend(), charts: charts.collect() };
        save_png(&grid.draw(), &self.curves).into_diagnostic()
    }
}

/// Number of files that the check of the data warned of; 0 where nothing was checked.
fn warned_files(check: &Path) -> usize {
    let read = std::fs::read(check).ok().and_then(|bytes| serde_json::from_slice::<DataCheck>(&bytes).ok());
    read.map_or(0, |check| check.warnings.len())
}

/// The steps of a run that `config` asks for.
fn steps(config: &Config) -> RunSteps {
    let stages = stage_starts(&config.stages).zip(&config.stages);
    let boundary =
        |(step, stage): (u64, &StageConfig)| StageBoundary { step: step as f64, name: stage.name.clone() };
    RunSteps { total: config.total_steps(), stages: stages.map(boundary).collect() }
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
            TrainEvent::Validated { .. } => self.write(RunState::Running),
            TrainEvent::CheckpointSaved { .. } => {
                self.draw_curves()?;
                self.write(RunState::Running)
            }
            TrainEvent::Interrupted { .. } => self.write(RunState::Interrupted),
            TrainEvent::GaveUp { .. } => self.write(RunState::GaveUp),
            TrainEvent::Finished { .. } => self.write(RunState::Finished),
            _ => Ok(()),
        }
    }
}
