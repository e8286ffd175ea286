//! The configuration of a run: one TOML file, every key documented here with unit, default and reason.
//!
//! Unknown keys are errors. Every value used is written back to `RUN/config.toml`.

mod data;
mod load;
mod losses;
mod ramp;
mod stages;

pub use data::{
    CacheConfig, DataConfig, GarmentSource, GenerateConfig, PoseConfig, PoseEncoding, SplitConfig,
    StartConfig,
};
pub use load::{ConfigError, load, to_toml};
pub use losses::{DistanceMode, LossesConfig};
pub use ramp::{Ramp, RampShape};
pub use stages::{StageConfig, Trains};

use clothcombo_model::ModelConfig;
use serde::{Deserialize, Serialize};

/// A whole run.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Everything random follows from this number.
    pub seed: u64,
    /// Body, garments and poses.
    pub data: DataConfig,
    /// The state the networks start from.
    #[serde(default)]
    pub start: StartConfig,
    /// Sizes of the networks.
    #[serde(default)]
    pub model: ModelConfig,
    /// Weights and constants of the eight losses.
    #[serde(default)]
    pub losses: LossesConfig,
    /// Optimiser.
    #[serde(default)]
    pub optimizer: OptimizerConfig,
    /// What is trained, in order.
    pub stages: Vec<StageConfig>,
    /// The fixed scenes every validation scores.
    #[serde(default)]
    pub validation: ValidationConfig,
    /// What a run leaves behind, and how often.
    #[serde(default)]
    pub output: OutputConfig,
}

/// Adam with a clip on the global gradient norm.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OptimizerConfig {
    /// Decay of the first moment.
    pub beta_1: f32,
    /// Decay of the second moment.
    pub beta_2: f32,
    /// Added to the root of the second moment.
    pub epsilon: f32,
    /// Largest norm of the gradient over all parameters together; 0 switches clipping off.
    pub clip_norm: f64,
}

impl Default for OptimizerConfig {
    fn default() -> Self {
        Self { beta_1: 0.9, beta_2: 0.999, epsilon: 1e-8, clip_norm: 1.0 }
    }
}

/// Fixed validation scenes, drawn from the seed, of held-out poses and shapes.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ValidationConfig {
    /// Scenes of one garment.
    pub single_scenes: usize,
    /// Scenes of one garment on motion clips never trained on (data.poses.held_out_clips).
    pub unseen_scenes: usize,
    /// Scenes of one garment never trained on (data.split.validation), in held-out poses.
    pub unseen_garment_scenes: usize,
    /// Scenes of several layers.
    pub layered_scenes: usize,
    /// Fewest and most layers of the layered scenes.
    pub layers: [usize; 2],
    /// Steps between validations; 0 scores only before and after training and at the end of each stage.
    pub every: u64,
}

impl Default for ValidationConfig {
    fn default() -> Self {
        Self {
            single_scenes: 48,
            unseen_scenes: 24,
            unseen_garment_scenes: 24,
            layered_scenes: 16,
            layers: [2, 4],
            every: 0,
        }
    }
}

/// Checkpoints, pictures and logs.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OutputConfig {
    /// Steps between checkpoints; one is always written at the end.
    pub checkpoint_every: u64,
    /// Newest checkpoints that are kept.
    pub keep_checkpoints: usize,
    /// Steps between sample pictures; 0 draws them only at the end of each stage.
    pub sample_every: u64,
    /// Validation scenes of each kind (single, layered) in a sample picture.
    pub sample_scenes: usize,
    /// Steps between lines of `metrics.jsonl`.
    pub metrics_every: u64,
}

impl Default for OutputConfig {
    fn default() -> Self {
        Self {
            checkpoint_every: 1000,
            keep_checkpoints: 3,
            sample_every: 0,
            sample_scenes: 4,
            metrics_every: 1,
        }
    }
}

impl Config {
    /// Total number of steps.
    pub fn total_steps(&self) -> u64 {
        self.stages.iter().map(|s| s.steps).sum()
    }

    /// The most layers any stage or validation scene uses.
    pub fn max_layers(&self) -> usize {
        let stages = self.stages.iter().map(|s| s.layers[1]).max().unwrap_or(1);
        stages.max(if self.validation.layered_scenes > 0 { self.validation.layers[1] } else { 1 })
    }

    /// What is inconsistent, as (place, what, hint).
    pub(crate) fn problem(&self) -> Option<(String, String, String)> {
        let at = |place: &str, what: &str, hint: &str| Some((place.into(), what.into(), hint.into()));
        if self.stages.is_empty() {
            return at("stages", "there is no stage to train", "add a [[stages]] table");
        }
        for (i, stage) in self.stages.iter().enumerate() {
            if let Some((key, what, hint)) = stage.problem() {
                return Some((format!("stages[{i}].{key}"), what, hint));
            }
        }
        let [low, high] = self.validation.layers;
        if self.validation.layered_scenes > 0 && !(2 <= low && low <= high) {
            return at("validation.layers", "is not a range of at least two layers", "for example [2, 4]");
        }
        if self.data.garments.is_empty() {
            return at("data.garments", "there are no garments", "add a [[data.garments]] table");
        }
        for (i, source) in self.data.garments.iter().enumerate() {
            if source.folder.is_some() == source.generate.is_some() {
                return Some((
                    format!("data.garments[{i}]"),
                    "needs exactly one of `folder` and `generate`".into(),
                    "folder = \"…\" reads OBJ files, generate = { count = … } makes garments".into(),
                ));
            }
        }
        if self.output.checkpoint_every == 0
            || self.output.keep_checkpoints == 0
            || self.output.metrics_every == 0
        {
            return at(
                "output",
                "checkpoint_every, keep_checkpoints and metrics_every must be at least 1",
                "use 1 or more",
            );
        }
        let optimizer = &self.optimizer;
        if !(0.0..1.0).contains(&optimizer.beta_1)
            || !(0.0..1.0).contains(&optimizer.beta_2)
            || optimizer.epsilon <= 0.0
        {
            return at(
                "optimizer",
                "beta_1 and beta_2 lie in [0, 1), epsilon is positive",
                "use 0.9, 0.999, 1e-8",
            );
        }
        self.data.problem().or_else(|| {
            if let Err(error) = self.losses.energy_settings().check() {
                return Some((
                    "losses".into(),
                    error.to_string(),
                    "configs/paper.toml shows every value".into(),
                ));
            }
            let error = self.model.validate().err()?;
            Some((
                "model".into(),
                error.to_string(),
                "configs/smoke.toml and paper.toml show usable sizes".into(),
            ))
        })
    }
}
