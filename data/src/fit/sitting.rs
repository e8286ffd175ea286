//! How a placed garment sits on the body.

use crate::asset::Body;
use crate::mesh::gaps_to;
use clothcombo_physics::Surface;
use serde::Serialize;

/// Number of directions around the trunk.
const SECTORS: usize = 8;
/// Half the height around a joint of the spine in which cloth is looked for (m).
const SLICE_HALF_HEIGHT: f64 = 0.08;
/// Cloth this deep in the body is inside it (m): less is a matter of the body's shape.
const INSIDE_DEPTH: f64 = 0.003;

/// How a placed garment sits on the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Sitting {
    /// Mean distance of the cloth to the body, inside or outside (m).
    pub mean_distance: f64,
    /// Distance of the nearest twentieth of the cloth (m), negative inside.
    pub nearest: f64,
    /// Share of the cloth inside the body, 0–1.
    pub inside: f64,
    /// Share of the directions around the trunk in which there is cloth, 0–1, at the best height.
    pub wrap: f64,
}

impl Sitting {
    /// Measures points of a garment (m) against the surface of the body.
    pub(super) fn new(points: &[[f64; 3]], body: &Body, surface: &Surface<f64>) -> Self {
        let mut gaps = gaps_to(points, surface);
        gaps.sort_by(f64::total_cmp);
        let count = gaps.len().max(1) as f64;
        let spine = ["pelvis", "spine1", "spine2", "spine3"].iter().filter_map(|name| body.joint_place(name));
        let wrap = |centre: [f64; 3]| {
            let mut sectors = [false; SECTORS];
            for p in points.iter().filter(|p| (p[1] - centre[1]).abs() < SLICE_HALF_HEIGHT) {
                let turn = (p[0] - centre[0]).atan2(p[2] - centre[2]) / std::f64::consts::TAU;
                sectors[((turn.rem_euclid(1.0) * SECTORS as f64) as usize).min(SECTORS - 1)] = true;
            }
            sectors.iter().filter(|s| **s).count() as f64 / SECTORS as f64
        };
        Self {
            mean_distance: gaps.iter().map(|g| g.abs()).sum::<f64>() / count,
            nearest: gaps.get(gaps.len() / 20).copied().unwrap_or(f64::MAX),
            inside: gaps.iter().filter(|g| **g < -INSIDE_DEPTH).count() as f64 / count,
            wrap: spine.map(wrap).fold(0.0, f64::max),
        }
    }

    /// Whether cloth that is not known to be worn lies on the trunk all around.
    pub(super) fn is_snug(&self) -> bool {
        // An eighth inside is a tight fit; six of eight directions leave an open front; a coat hangs 6 cm off on average.
        self.inside < 0.12 && self.wrap >= 0.75 && self.mean_distance < 0.06
    }
}
