//! How smoothly a motion moves: accelerations of the garments' vertices beside those of linear blend skinning.

use super::bodies::Moment;
use super::drape::{Drape, GarmentDrape};
use crate::run::spread::Spread;
use serde::{Deserialize, Serialize};

/// Accelerations over all vertices and inner frames of a motion (m/s²).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Acceleration {
    /// 95th percentile of the result.
    pub draped_95: f64,
    /// 95th percentile of what came to the post-process: what the networks made, averaged over frames if that was asked for.
    pub before_95: f64,
    /// 95th percentile of linear blend skinning of the start state.
    pub skinned_95: f64,
    /// Their ratio; above 1 the cloth moves less smoothly than skin.
    pub ratio: f64,
}

/// The accelerations of `drapes`, consecutive frames at `moments`; `None` for fewer than three frames, or where nothing
/// moves.
pub fn acceleration(drapes: &[Drape], moments: &[Moment]) -> Option<Acceleration> {
    if drapes.len() < 3 || moments.len() != drapes.len() {
        return None;
    }
    let step = moments[1].seconds - moments[0].seconds;
    let of = |positions: fn(&GarmentDrape) -> &Vec<[f64; 3]>| {
        let mut values = Vec::new();
        for frames in drapes.windows(3) {
            for g in 0..frames[1].garments.len() {
                let [before, now, after] = [0, 1, 2].map(|f| positions(&frames[f].garments[g]));
                for ((p, q), r) in before.iter().zip(now).zip(after) {
                    let second = (0..3).map(|a| (p[a] - 2.0 * q[a] + r[a]).powi(2)).sum::<f64>().sqrt();
                    values.push(second / (step * step));
                }
            }
        }
        (!values.is_empty()).then(|| Spread::of(values).p95)
    };
    let [draped_95, before_95, skinned_95] =
        [of(|g| &g.positions)?, of(|g| &g.network)?, of(|g| &g.skinned)?];
    (skinned_95 > 0.0 && step > 0.0).then(|| Acceleration {
        draped_95,
        before_95,
        skinned_95,
        ratio: draped_95 / skinned_95,
    })
}
