//! How well a placed garment sits.

use serde::Serialize;

/// How well a placed garment sits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Sitting {
    /// Mean distance of the cloth to the body, inside or outside (m).
    pub mean_distance: f64,
    /// Share of the cloth inside the body, 0–1.
    pub inside: f64,
    /// Share of the directions around the trunk in which there is cloth, 0–1, at the best height.
    pub wrap: f64,
    #[serde(skip)]
    pub(super) cost: f64,
}

impl Sitting {
    pub(super) fn is_good(&self) -> bool {
        let is_close = self.inside < 0.12 && self.wrap >= 0.75 && self.mean_distance < 0.06;
        // A wide skirt is far from the legs, but surrounds them and is nowhere inside.
        let is_wide = self.inside < 0.01 && self.wrap == 1.0 && self.mean_distance < 0.25;
        is_close || is_wide
    }

    /// Whether the cloth follows the trunk, be it partly inside: made for another body, but no hat and no shoe.
    pub(super) fn is_around_trunk(&self) -> bool {
        self.wrap >= 0.75 && self.mean_distance < 0.02
    }
}
