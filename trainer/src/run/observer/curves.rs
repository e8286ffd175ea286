//! `curves.png`: every loss over the steps, against the baseline that has learned nothing.

use super::history::SharedHistory;
use crate::config::{Config, stage_starts};
use crate::picture::chart::{ChartGrid, StageBoundary, Steps};
use crate::picture::save_png;
use crate::run::event::{Observer, TrainEvent};
use crate::run::folder::RunDir;
use crate::run::report::charts;
use miette::{IntoDiagnostic, Report};
use std::path::PathBuf;

/// Draws the curves of a run whenever a checkpoint is saved.
pub struct CurvesObserver {
    path: PathBuf,
    stages: Vec<StageBoundary>,
    total_steps: u64,
    history: SharedHistory,
    drawn_at: u64,
}

impl CurvesObserver {
    /// Draws what `history` holds.
    pub fn new(run: &RunDir, config: &Config, history: SharedHistory) -> Self {
        Self {
            path: run.curves(),
            stages: stage_boundaries(config),
            total_steps: config.total_steps(),
            history,
            drawn_at: u64::MAX,
        }
    }

    fn draw(&self) -> Result<(), Report> {
        let steps = Steps { total: self.total_steps, stages: &self.stages };
        let charts = charts(&self.history.borrow(), &steps).into_iter().map(|(_, chart)| chart);
        let grid = ChartGrid { title: "Training".into(), legend: Steps::legend(), charts: charts.collect() };
        save_png(&grid.draw(), &self.path).into_diagnostic()
    }
}

/// Where the stages of `config` begin.
pub(crate) fn stage_boundaries(config: &Config) -> Vec<StageBoundary> {
    let stages = stage_starts(&config.stages).zip(&config.stages);
    stages.map(|(step, stage)| StageBoundary { step: step as f64, name: stage.name.clone() }).collect()
}

impl Observer for CurvesObserver {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), Report> {
        match event {
            TrainEvent::CheckpointSaved { step, .. } if self.drawn_at != *step => {
                self.drawn_at = *step;
                self.draw()
            }
            _ => Ok(()),
        }
    }
}
