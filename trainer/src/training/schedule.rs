//! Where in the run a step lies: stage, progress, learning rate, pose scale.

use crate::config::{Config, StageConfig, stage_starts};

/// The stages of a run laid end to end.
#[derive(Clone, Debug)]
pub struct Schedule {
    stages: Vec<StageConfig>,
}

/// The schedule at one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduleAt {
    /// Index of the stage.
    pub stage: usize,
    /// Whether this is the first step of its stage.
    pub first_of_stage: bool,
    /// Whether this is the last step of its stage.
    pub last_of_stage: bool,
    /// Fraction of the stage that is done before this step, 0–1.
    pub stage_progress: f64,
    /// Fraction of the run that is done before this step, 0–1.
    pub run_progress: f64,
    /// Adam's step size.
    pub learning_rate: f64,
    /// Share of the full pose.
    pub pose_scale: f64,
}

impl Schedule {
    /// The schedule of `config`.
    pub fn new(config: &Config) -> Self {
        Self { stages: config.stages.clone() }
    }

    /// Number of steps of the run.
    pub fn total_steps(&self) -> u64 {
        self.stages.iter().map(|s| s.steps).sum()
    }

    /// The stages.
    pub fn stages(&self) -> &[StageConfig] {
        &self.stages
    }

    /// First step of each stage.
    pub fn boundaries(&self) -> Vec<u64> {
        stage_starts(&self.stages).collect()
    }

    /// The schedule at `step`; a step past the end is the end of the last stage.
    pub fn at(&self, step: u64) -> ScheduleAt {
        let boundaries = self.boundaries();
        let stage = boundaries.iter().rposition(|&first| first <= step).unwrap_or(0);
        let config = &self.stages[stage];
        let inside = step - boundaries[stage];
        let stage_progress = (inside as f64 / config.steps as f64).min(1.0);
        ScheduleAt {
            stage,
            first_of_stage: inside == 0,
            last_of_stage: inside + 1 == config.steps,
            stage_progress,
            run_progress: (step as f64 / self.total_steps() as f64).min(1.0),
            learning_rate: config.learning_rate_at(inside, stage_progress),
            pose_scale: config.pose_scale.at(stage_progress),
        }
    }
}
