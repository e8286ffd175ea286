//! A whole run: the tables of a configuration, and what must hold between them.

use super::data::{DataConfig, StartConfig};
use super::guard::GuardConfig;
use super::losses::LossesConfig;
use super::optimizer::OptimizerConfig;
use super::output::OutputConfig;
use super::stages::StageConfig;
use super::validation::ValidationConfig;
use clothcombo_model::{ModelConfig, ModelError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A whole run.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Everything random follows from this number: the same seed gives the same run, bit for bit. At most 2⁶³ − 1.
    pub seed: u64,
    /// Folder that relative paths are relative to, where it exists; else the working folder. A run writes down the
    /// folder in which it was started, and so resumes from anywhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<PathBuf>,
    /// Run, checkpoint or model folder whose parameters the networks start with, to train a model further on other data or
    /// another schedule; absent: random ones. Sizes of the networks, body, joints and pose encoding must be its own. Give such
    /// a run a seed of its own: scenes follow from seed and step, and that of the model would bring its scenes again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub init_from: Option<String>,
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
    /// What happens to steps that are not finite, and to gradient spikes.
    #[serde(default)]
    pub guard: GuardConfig,
}

impl Config {
    /// Total number of steps.
    pub fn total_steps(&self) -> u64 {
        self.stages.iter().map(|s| s.steps).sum()
    }

    /// How thick a garment is for those above it (m), if the networks ask: the distance that the layer collision keeps.
    pub fn layer_thickness(&self) -> Option<f64> {
        (self.model.surroundings > 0).then_some(self.losses.layer_collision.epsilon)
    }

    /// Seed of the scenes that are scored.
    pub fn validation_seed(&self) -> u64 {
        self.validation.seed.unwrap_or(self.seed)
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
            if stage.below > 0 && self.model.surroundings == 0 {
                return Some((
                    format!("stages[{i}].below"),
                    "the networks do not see the garments below".into(),
                    "set model.surroundings, for example to 64, or below = 0".into(),
                ));
            }
        }
        if self.data.garments.is_empty() {
            return at("data.garments", "there are no garments", "add a [[data.garments]] table");
        }
        for (i, source) in self.data.garments.iter().enumerate() {
            if source.folder.is_some() == source.generate.is_some() {
                return Some((
                    format!("data.garments[{i}]"),
                    "needs exactly one of `folder` and `generate`".into(),
                    "folder = \"…\" reads mesh files, generate = { count = … } makes garments".into(),
                ));
            }
        }
        let sections = [
            self.validation.problem(),
            self.output.problem(),
            self.optimizer.problem(),
            self.guard.problem(),
            model_problem(&self.model),
        ];
        if let Some(problem) = sections.into_iter().flatten().next() {
            return Some(problem);
        }
        self.data.problem().or_else(|| self.losses.problem()).or_else(|| {
            const USABLE: &str = "configs/smoke.toml and paper.toml show usable sizes";
            Some(match self.model.validate().err()? {
                ModelError::Config { key, value, expected } => {
                    (format!("model.{key}"), format!("is {value}, but must be {expected}"), USABLE.into())
                }
                error => ("model".into(), error.to_string(), USABLE.into()),
            })
        })
    }
}

/// Networks that no machine holds, as (place, what, hint): a slip of the finger must not end in an allocation that fails.
fn model_problem(model: &ModelConfig) -> Option<(String, String, String)> {
    let widths: [(&str, usize, usize); 10] = [
        ("width", model.width, 16_384),
        ("embedding", model.embedding, 16_384),
        ("diffusion_width", model.diffusion_width, 16_384),
        ("siren_width", model.siren_width, 16_384),
        ("skinning_width", model.skinning_width, 16_384),
        ("eigen_count", model.eigen_count, 4096),
        ("diffusion_blocks", model.diffusion_blocks, 256),
        ("mlp_layers", model.mlp_layers, 256),
        ("siren_layers", model.siren_layers, 256),
        ("skinning_layers", model.skinning_layers, 256),
    ];
    let (key, _, most) = widths.into_iter().find(|(_, value, most)| value > most)?;
    Some((
        format!("model.{key}"),
        format!("is more than {most}"),
        "configs/paper.toml has the paper's sizes".into(),
    ))
}
