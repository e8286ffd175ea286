//! What happens to steps that are not finite, and to gradient spikes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What happens when a loss or gradient is not finite, or a gradient is far out of the ordinary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GuardConfig {
    /// The run stops when this many steps within `window` were skipped because their loss or gradient was not finite. One
    /// such scene is bad luck, twenty are a run that has diverged.
    pub max_incidents: usize,
    /// Steps over which incidents are counted.
    pub window: u64,
    /// Incidents that are written to `RUN/incidents` in full (scene and weights), the first ones of the run; later ones are
    /// only counted. Each costs as much disk as the weights.
    pub kept_incidents: usize,
    /// A step whose gradient norm is more than this many times the median of the last 100 counts as a spike; 0 counts
    /// none. Spikes are listed in `RUN/log.txt` and counted in the progress line. Clipping makes spikes harmless; many
    /// of them say that something in the data is hard.
    pub spike_factor: f64,
    /// Test hook: makes steps fail on purpose, to prove that they are caught and can be replayed. Never set it in a run
    /// that matters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inject: Option<InjectConfig>,
}

impl Default for GuardConfig {
    fn default() -> Self {
        Self { max_incidents: 20, window: 1000, kept_incidents: 10, spike_factor: 100.0, inject: None }
    }
}

/// What a test breaks, and when.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InjectConfig {
    /// Steps between injections: this step (the first is 1), twice this step, and so on.
    pub every: u64,
    /// What is made not finite.
    pub what: Injected,
}

/// What an injection makes not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Injected {
    /// A NaN coordinate of the first vertex the networks start from: the loss is not finite.
    Position,
    /// The gradient of a finite loss.
    Gradient,
}

impl GuardConfig {
    /// What is injected into the step that makes `done` steps done.
    pub fn injected(&self, done: u64) -> Option<Injected> {
        self.inject.filter(|i| i.every > 0 && done.is_multiple_of(i.every)).map(|i| i.what)
    }

    /// What is inconsistent, as (place, what, hint).
    pub(super) fn problem(&self) -> Option<(String, String, String)> {
        let says = |p: &str, w: &str, h: &str| Some((p.into(), w.into(), h.into()));
        if self.max_incidents == 0 || self.window == 0 {
            return says("guard", "max_incidents and window must be at least 1", "for example 20 and 1000");
        }
        if !(self.spike_factor.is_finite() && self.spike_factor >= 0.0) {
            return says("guard.spike_factor", "is not a factor", "for example 100.0; 0 reports no spikes");
        }
        None
    }
}
