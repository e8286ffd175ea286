//! `curves.png`: every loss over the steps, against the baseline that has learned nothing.

use super::history::SharedHistory;
use crate::config::{Config, stage_starts};
use crate::picture::{Series, StageBoundary, draw_curves, save_png};
use crate::run::event::{Observer, StepRecord, TrainEvent};
use crate::run::folder::RunDir;
use miette::{IntoDiagnostic, Report};
use std::path::PathBuf;

/// Draws the curves of a run whenever a checkpoint is saved.
pub struct CurvesObserver {
    path: PathBuf,
    stages: Vec<StageBoundary>,
    history: SharedHistory,
    drawn_at: u64,
}

impl CurvesObserver {
    /// Draws what `history` holds.
    pub fn new(run: &RunDir, config: &Config, history: SharedHistory) -> Self {
        Self { path: run.curves(), stages: stage_boundaries(config), history, drawn_at: u64::MAX }
    }

    fn draw(&self) -> Result<(), Report> {
        let history = self.history.borrow();
        let series = |name: &'static str, unit: &str| Series {
            name: name.to_owned(),
            unit: unit.to_owned(),
            points: history.points(name).to_vec(),
            baseline: history.baselines.get(name).copied(),
        };
        let mut all = vec![series("loss", "weighted J"), series("grad_norm", "before clipping")];
        all.extend(StepRecord::term_names().map(|n| series(n, "raw")));
        let picture = draw_curves("Training", &all, &self.stages).into_diagnostic()?;
        save_png(&picture, &self.path).into_diagnostic()
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
