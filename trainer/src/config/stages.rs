//! One stage of training: what learns, how long, on how many layers.

use super::ramp::Ramp;
use clothcombo_model::Mode;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which networks a stage trains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Trains {
    /// Embedding, draping and skinning, on single garments (the paper's pre-training).
    Single,
    /// Draping and skinning on single garments; the embedding stays as it is, is computed once for every garment and costs nothing
    /// more, which halves a step.
    Draping,
    /// The untangling network on the frozen first stage.
    Untangling,
    /// The networks of both phases end to end.
    All,
}

impl Trains {
    /// How far the forward pass goes.
    pub fn mode(self) -> Mode {
        match self {
            Self::Single | Self::Draping => Mode::Single,
            Self::Untangling | Self::All => Mode::Layered,
        }
    }

    /// Whether some networks stay as they are: the embedding among them.
    pub fn freezes(self) -> bool {
        matches!(self, Self::Draping | Self::Untangling)
    }
}

/// First step of each of `stages`, which follow each other.
pub fn stage_starts(stages: &[StageConfig]) -> impl Iterator<Item = u64> + '_ {
    stages.iter().scan(0, |at, stage| {
        let first = *at;
        *at += stage.steps;
        Some(first)
    })
}

/// A stage.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageConfig {
    /// Name in logs and pictures.
    pub name: String,
    /// Which networks learn.
    pub trains: Trains,
    /// Number of optimiser steps.
    #[schemars(range(min = 1))]
    pub steps: u64,
    /// Fewest and most layers of a scene; each step draws a number between them, all equally likely.
    #[serde(default = "one_layer")]
    pub layers: [usize; 2],
    /// Garments below those of a scene at most, of which only the thickness counts (`model.surroundings`): a scene of an outfit of
    /// one to so many garments and one more, and a place in it, are drawn. 0, the default, drapes all on the bare body.
    #[serde(default)]
    pub below: usize,
    /// Fraction of the stage over which the most layers of a scene grow from the fewest to the most of `layers`, in equal
    /// parts. 0, the default, allows the most at once; 0.5 lets pairs settle before whole outfits pull at the networks.
    #[serde(default)]
    pub layer_curriculum: f64,
    /// Bodies (shape and pose) that one step drapes the same garments on; they share the garment embedding, which makes a
    /// second body cheaper than a second step.
    #[serde(default = "one", alias = "scenes_per_step")]
    pub bodies: usize,
    /// Scenes with garments of their own whose gradients are averaged before one update (gradient accumulation). They are
    /// computed in parallel: on two cores a step with 2 takes 1.5 to 1.9 times as long as one with 1. The gradient is
    /// less noisy. Processes of one run share the scenes.
    #[serde(default = "one")]
    pub accumulate: usize,
    /// Adam's step size. 1e-4 is the paper's, for networks of width 512; small networks take ten times that.
    #[serde(default = "paper_rate")]
    pub learning_rate: Ramp,
    /// Steps at the start of the stage over which the learning rate grows linearly from nothing to `learning_rate`; 0, the
    /// default, starts at full. Adam's moments are rough in the first hundreds of steps of newly trained networks.
    #[serde(default)]
    pub warm_up_steps: u64,
    /// Share of the full pose, 0 = T-pose (progressive learning): the paper starts at 0, where drapes are easy. Above 1
    /// poses are exaggerated.
    #[serde(default = "full_pose")]
    pub pose_scale: Ramp,
}

/// Steps of a stage at most: sums of them must stay countable.
const MOST_STAGE_STEPS: u64 = 1_000_000_000_000;

/// Outfits of a step, and bodies of an outfit, at most.
const MOST_STEP_SCENES: usize = 1024;

/// Layers of a scene at most; the number of pairs grows with its square.
pub(super) const MOST_LAYERS: usize = 32;

fn one_layer() -> [usize; 2] {
    [1, 1]
}
fn one() -> usize {
    1
}
fn paper_rate() -> Ramp {
    Ramp::constant(1e-4)
}
fn full_pose() -> Ramp {
    Ramp::constant(1.0)
}

impl StageConfig {
    /// Fewest and most layers at `progress` (fraction of the stage, 0–1).
    pub fn layers_at(&self, progress: f64) -> [usize; 2] {
        let [low, high] = self.layers;
        if self.layer_curriculum <= 0.0 || progress >= self.layer_curriculum {
            return [low, high];
        }
        let grown = (progress / self.layer_curriculum * (high - low + 1) as f64) as usize;
        [low, (low + grown).min(high)]
    }

    /// Adam's step size at step `inside` of the stage (from 0), `progress` its fraction of the stage.
    pub fn learning_rate_at(&self, inside: u64, progress: f64) -> f64 {
        let full = self.learning_rate.at(progress);
        if inside < self.warm_up_steps {
            full * (inside + 1) as f64 / self.warm_up_steps as f64
        } else {
            full
        }
    }

    /// What is wrong, as (key, what, hint).
    pub(crate) fn problem(&self) -> Option<(String, String, String)> {
        let says = |k: &str, w: &str, h: &str| Some((k.into(), w.into(), h.into()));
        let [low, high] = self.layers;
        if self.steps == 0 {
            says("steps", "a stage of no steps trains nothing", "remove the stage or give it steps")
        } else if self.steps > MOST_STAGE_STEPS {
            says("steps", "is more than a trillion", "the paper trains some hundred thousand")
        } else if low == 0 || low > high {
            says("layers", "is not a range [fewest, most] of at least one layer", "for example [1, 6]")
        } else if self.trains.mode() == Mode::Single && high > 1 {
            says(
                "layers",
                "single-garment training has one layer",
                "use layers = [1, 1], or trains = \"all\"",
            )
        } else if self.trains == Trains::Untangling && low < 2 {
            says("layers", "a single garment has nothing to untangle", "use at least 2 layers")
        } else if high + self.below > MOST_LAYERS {
            says("layers", "are more garments than anyone wears", "the paper goes up to 6, 32 are allowed")
        } else if !(0.0..=1.0).contains(&self.layer_curriculum) {
            says("layer_curriculum", "is not a fraction of the stage", "for example 0.5; 0 switches it off")
        } else if self.bodies == 0 || self.bodies > MOST_STEP_SCENES {
            says("bodies", "must lie between 1 and 1024", "1 drapes every outfit on one body")
        } else if self.accumulate == 0 || self.accumulate > MOST_STEP_SCENES {
            says("accumulate", "must lie between 1 and 1024", "1 makes an update after every scene")
        } else if self.warm_up_steps > self.steps {
            says("warm_up_steps", "is longer than the stage", "use some hundred steps, or 0 for none")
        } else if self.learning_rate.from <= 0.0 || self.learning_rate.to <= 0.0 {
            says("learning_rate", "must be positive", "the paper uses 1e-4")
        } else if self.pose_scale.from < 0.0 || self.pose_scale.to < 0.0 {
            says("pose_scale", "must not be negative", "0 is the T-pose, 1 the full pose")
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(rest: &str) -> StageConfig {
        toml::from_str(&format!("name = \"s\"\ntrains = \"all\"\nsteps = 100\n{rest}")).unwrap()
    }

    #[test]
    fn layers_grow_in_equal_parts_and_reach_the_most() {
        let s = stage("layers = [2, 5]\nlayer_curriculum = 0.8");
        let most: Vec<usize> = (0..100).map(|i| s.layers_at(f64::from(i) / 100.0)[1]).collect();
        assert!(most.windows(2).all(|w| w[0] <= w[1]));
        for layers in 2..5 {
            // A fraction that is no binary number may fall on either side of a boundary.
            let count = most.iter().filter(|m| **m == layers).count();
            assert!((19..=21).contains(&count), "{layers}: {count}");
        }
        assert_eq!(stage("layers = [2, 5]").layers_at(0.0), [2, 5]);
    }

    #[test]
    fn warm_up_ends_at_the_full_rate() {
        let s = stage("learning_rate = 1e-3\nwarm_up_steps = 10");
        assert_eq!(s.learning_rate_at(0, 0.0), 1e-4);
        assert!((0..20).all(|i| s.learning_rate_at(i, 0.1) <= s.learning_rate_at(i + 1, 0.1)));
        assert_eq!(s.learning_rate_at(9, 0.09), 1e-3);
        assert_eq!(stage("learning_rate = 1e-3").learning_rate_at(0, 0.0), 1e-3);
    }
}
