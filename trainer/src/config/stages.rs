//! One stage of training: what learns, how long, on how many layers.

use super::ramp::{Ramp, RampShape};
use serde::{Deserialize, Serialize};

/// Which networks a stage trains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Trains {
    /// Embedding, draping and skinning, on single garments (the paper's pre-training).
    Single,
    /// The untangling network on the frozen first stage.
    Untangling,
    /// All networks end to end.
    All,
}

/// A stage.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageConfig {
    /// Name in logs and pictures.
    pub name: String,
    /// Which networks learn.
    pub trains: Trains,
    /// Number of optimiser steps.
    pub steps: u64,
    /// Fewest and most layers of a scene; each step draws a number between them.
    #[serde(default = "one_layer")]
    pub layers: [usize; 2],
    /// Bodies (shape and pose) that one step drapes the same garments on; they share the garment embedding.
    #[serde(default = "one_scene")]
    pub scenes_per_step: usize,
    /// Adam's step size.
    #[serde(default = "paper_rate")]
    pub learning_rate: Ramp,
    /// Share of the full pose, 0 = T-pose (progressive learning).
    #[serde(default = "full_pose")]
    pub pose_scale: Ramp,
}

fn one_layer() -> [usize; 2] {
    [1, 1]
}
fn one_scene() -> usize {
    1
}
fn paper_rate() -> Ramp {
    Ramp::constant(1e-4)
}
fn full_pose() -> Ramp {
    Ramp { from: 1.0, to: 1.0, start: 0.0, end: 1.0, shape: RampShape::Linear }
}

impl StageConfig {
    /// What is wrong, as (key, what, hint).
    pub(crate) fn problem(&self) -> Option<(String, String, String)> {
        let says = |k: &str, w: &str, h: &str| Some((k.into(), w.into(), h.into()));
        let [low, high] = self.layers;
        if self.steps == 0 {
            says("steps", "a stage of no steps trains nothing", "remove the stage or give it steps")
        } else if low == 0 || low > high {
            says("layers", "is not a range [fewest, most] of at least one layer", "for example [1, 6]")
        } else if self.trains == Trains::Single && high > 1 {
            says(
                "layers",
                "single-garment training has one layer",
                "use layers = [1, 1], or trains = \"all\"",
            )
        } else if self.trains == Trains::Untangling && low < 2 {
            says("layers", "one garment alone has nothing to untangle", "use at least 2 layers")
        } else if self.scenes_per_step == 0 {
            says("scenes_per_step", "a step needs at least one body", "use 1 or more")
        } else if self.learning_rate.from <= 0.0 || self.learning_rate.to <= 0.0 {
            says("learning_rate", "must be positive", "the paper uses 1e-4")
        } else if self.pose_scale.from < 0.0 || self.pose_scale.to < 0.0 {
            says("pose_scale", "must not be negative", "0 is the T-pose, 1 the full pose")
        } else {
            None
        }
    }
}
