//! What a run leaves behind. Nothing here changes what is learned.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Checkpoints, pictures and logs.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OutputConfig {
    /// Steps between checkpoints; one is always written at the end of a stage and when the run is interrupted. What a
    /// `kill -9` can cost is this many steps.
    pub checkpoint_every: u64,
    /// Newest checkpoints that are kept: more than one, because the newest may be what went wrong.
    pub keep_checkpoints: usize,
    /// Keep the checkpoint with the best validation score as well, however old, and write one whenever a validation is the
    /// best so far. The score is the mean total loss of the networks over the validation scenes, mean over the groups.
    pub keep_best: bool,
    /// Keep every checkpoint whose step is a multiple of this for ever; 0 keeps none for ever. For looking back at how a
    /// run developed.
    pub keep_every: u64,
    /// Steps between sample pictures; 0 draws them only at the end of each stage. A sheet takes a few seconds.
    pub sample_every: u64,
    /// Validation scenes of each kind (single, layered) in a sample picture.
    pub sample_scenes: usize,
    /// Steps between lines of `metrics.jsonl` (about 600 bytes each) and points of the TensorBoard curves.
    pub metrics_every: u64,
    /// Write TensorBoard event files into `RUN/tensorboard`: scalars every `metrics_every` steps, pictures, validation.
    pub tensorboard: bool,
    /// Seconds between refreshes of `RUN/report.html`, besides those after every validation and checkpoint; 0 leaves only
    /// those.
    pub report_every: f64,
}

impl Default for OutputConfig {
    fn default() -> Self {
        Self {
            checkpoint_every: 1000,
            keep_checkpoints: 3,
            keep_best: true,
            keep_every: 0,
            sample_every: 0,
            sample_scenes: 4,
            metrics_every: 1,
            tensorboard: true,
            report_every: 60.0,
        }
    }
}

impl OutputConfig {
    /// What is inconsistent, as (place, what, hint).
    pub(super) fn problem(&self) -> Option<(String, String, String)> {
        let says = |p: &str, w: &str, h: &str| Some((p.into(), w.into(), h.into()));
        if self.checkpoint_every == 0 || self.keep_checkpoints == 0 || self.metrics_every == 0 {
            return says(
                "output",
                "checkpoint_every, keep_checkpoints and metrics_every must be at least 1",
                "use 1 or more",
            );
        }
        if !(self.report_every.is_finite() && self.report_every >= 0.0) {
            return says("output.report_every", "is not a time in seconds", "for example 60.0");
        }
        None
    }
}
