//! How parameters follow gradients.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the norm of the gradient is clipped of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClipScope {
    /// Of every scene (an outfit on all its bodies), before the scenes of a step are averaged.
    #[default]
    Scene,
    /// Of the mean over the scenes of a step (the paper's).
    Step,
}

/// Adam with a clip on the global gradient norm.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OptimizerConfig {
    /// Decay of the first moment per step. 0.9 averages over about ten steps, as everyone's Adam does.
    pub beta_1: f32,
    /// Decay of the second moment per step. 0.999 averages over about a thousand steps: scenes differ much in difficulty.
    pub beta_2: f32,
    /// Added to the root of the second moment, in units of a gradient. Only keeps a parameter without gradient from dividing
    /// zero by zero.
    pub epsilon: f32,
    /// Largest norm of the gradient over all parameters together; 0 switches clipping off. 1 is the paper's: a garment
    /// caught in an armpit has a gradient a thousand times the usual one.
    pub clip_norm: f64,
    /// Which gradient is clipped: that of each `"scene"` before the mean over the scenes of a step (`accumulate`), or
    /// the mean, once per `"step"`. Default: `"scene"`, since a scene with a garment caught in an armpit otherwise
    /// takes the whole step, and the scenes beside it teach nothing; the mean of clipped gradients is no longer than
    /// `clip_norm` either. `"step"` is the paper's. With one scene per step both are the same.
    pub clip: ClipScope,
    /// Decay per step of the running average of the weights, in [0, 1); 0 keeps none. With an average, validation,
    /// pictures and the exported model use it, training does not. 0.999 removes most of the noise that single scenes leave
    /// in the weights. Early in a run the average forgets faster: the decay is at most (1 + n) / (10 + n) after n steps.
    pub ema_decay: f64,
}

impl Default for OptimizerConfig {
    fn default() -> Self {
        Self {
            beta_1: 0.9,
            beta_2: 0.999,
            epsilon: 1e-8,
            clip_norm: 1.0,
            clip: ClipScope::default(),
            ema_decay: 0.0,
        }
    }
}

impl OptimizerConfig {
    /// Largest norm of a gradient; `None` where nothing is clipped.
    pub fn max_norm(&self) -> Option<f64> {
        (self.clip_norm > 0.0).then_some(self.clip_norm)
    }

    /// What is inconsistent, as (place, what, hint).
    pub(super) fn problem(&self) -> Option<(String, String, String)> {
        let says = |p: &str, w: &str, h: &str| Some((p.into(), w.into(), h.into()));
        let decays = (0.0..1.0).contains(&self.beta_1) && (0.0..1.0).contains(&self.beta_2);
        if !(decays && self.epsilon.is_finite() && self.epsilon > 0.0) {
            return says(
                "optimizer",
                "beta_1 and beta_2 lie in [0, 1), epsilon is positive",
                "use 0.9, 0.999, 1e-8",
            );
        }
        if !(self.clip_norm.is_finite() && self.clip_norm >= 0.0) {
            return says(
                "optimizer.clip_norm",
                "is not a norm",
                "the paper uses 1.0; 0 switches clipping off",
            );
        }
        if !(0.0..1.0).contains(&self.ema_decay) {
            return says(
                "optimizer.ema_decay",
                "does not lie in [0, 1)",
                "for example 0.999; 0 keeps no average",
            );
        }
        None
    }
}
