//! What every validation scores.

use super::stages::MOST_LAYERS;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Fixed validation scenes of held-out poses and shapes. The test set (data.held_out_garments, data.split.test,
/// data.poses.test_clips) is in none of them.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ValidationConfig {
    /// Seed of these scenes, and of those of `clothcombo eval`; absent: that of the run. Set it to compare runs with
    /// different seeds on the same scenes. At most 2⁶³ − 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Scenes of one garment. About fifty bring the standard error of a mean loss to a tenth of its spread.
    pub single_scenes: usize,
    /// Scenes of one garment in the motion clips of data.poses.validation_clips.
    pub unseen_scenes: usize,
    /// Scenes of one garment of data.split.validation, in held-out poses.
    pub unseen_garment_scenes: usize,
    /// Scenes of several layers. Fewer than single ones: each costs several times as much.
    pub layered_scenes: usize,
    /// Fewest and most layers of the layered scenes.
    pub layers: [usize; 2],
    /// Steps between validations; 0 scores only before and after training and at the end of each stage.
    pub every: u64,
}

impl Default for ValidationConfig {
    fn default() -> Self {
        Self {
            seed: None,
            single_scenes: 48,
            unseen_scenes: 24,
            unseen_garment_scenes: 24,
            layered_scenes: 16,
            layers: [2, 4],
            every: 0,
        }
    }
}

/// Scenes of a group at most: all of them are drawn before the first is scored.
const MOST_GROUP_SCENES: usize = 100_000;

impl ValidationConfig {
    /// What is inconsistent, as (place, what, hint).
    pub(super) fn problem(&self) -> Option<(String, String, String)> {
        let says = |p: &str, w: &str, h: &str| Some((p.into(), w.into(), h.into()));
        let [low, high] = self.layers;
        let counts =
            [self.single_scenes, self.unseen_scenes, self.unseen_garment_scenes, self.layered_scenes];
        if self.layered_scenes > 0 && !(2 <= low && low <= high && high <= MOST_LAYERS) {
            return says("validation.layers", "is not a range of at least two layers", "for example [2, 4]");
        }
        if counts.iter().any(|count| *count > MOST_GROUP_SCENES) {
            return says("validation", "has more than 100,000 scenes of a kind", "some dozens are enough");
        }
        None
    }
}
