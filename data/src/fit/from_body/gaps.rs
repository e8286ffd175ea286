//! Cloth keeps its distance to the skin: what lay 5 mm off the source body lies 5 mm off the target.

use crate::mesh::{gaps_to, one_rings};
use clothcombo_physics::Surface;
use clothcombo_physics::query::Distance;
use clothcombo_physics::vec3::{add_scaled, norm, scale};
use rayon::prelude::*;

/// Cloth within this distance of the skin (m) follows it wholly …
const FOLLOWING_DISTANCE: f64 = 0.03;
/// … and from this one on only its neighbours.
const FREE_DISTANCE: f64 = 0.08;
/// Rounds of correction.
const RESTORE_ROUNDS: usize = 5;
/// Averaging steps per round.
const SMOOTHING_STEPS: usize = 20;
/// A larger correction than this (m) in one round goes to another part of the body.
const LONGEST_CORRECTION: f64 = 0.05;

/// How much a vertex at this distance follows the skin, 0–1.
fn weight(gap: f64) -> f64 {
    ((FREE_DISTANCE - gap.abs()) / (FREE_DISTANCE - FOLLOWING_DISTANCE)).clamp(0.0, 1.0)
}

/// Moves the vertices so that their signed distances to `target` (m) are `gaps` where these are small, smoothly over the garment.
pub(super) fn restore(positions: &mut [[f64; 3]], faces: &[[u32; 3]], gaps: &[f64], target: &Surface<f64>) {
    let rings = one_rings(positions.len(), faces);
    // Built before it is shared.
    target.closest_point();
    for _ in 0..RESTORE_ROUNDS {
        let mut values: Vec<[f64; 4]> = positions
            .par_iter()
            .zip(gaps)
            .map(|(p, gap)| {
                let found = target.gap(*p, Distance::ClosestPoint);
                let length = (gap - found.gap).clamp(-LONGEST_CORRECTION, LONGEST_CORRECTION);
                let w = weight(*gap);
                match length.is_finite() && norm(found.gradient) > 0.5 {
                    true => {
                        let [x, y, z] = scale(found.gradient, w * length);
                        [x, y, z, w]
                    }
                    false => [0.0; 4],
                }
            })
            .collect();
        for _ in 0..SMOOTHING_STEPS {
            values = (0..values.len()).into_par_iter().map(|v| averaged(&values, v, &rings[v])).collect();
        }
        for (p, [x, y, z, w]) in positions.iter_mut().zip(&values) {
            *p = add_scaled(*p, 1.0 / w.max(0.1), [*x, *y, *z]);
        }
    }
}

/// Half of the own value and half of the mean of the ring's.
fn averaged(values: &[[f64; 4]], v: usize, ring: &[u32]) -> [f64; 4] {
    if ring.is_empty() {
        return values[v];
    }
    let share = 0.5 / ring.len() as f64;
    let mut sum = values[v].map(|x| 0.5 * x);
    for n in ring {
        sum.iter_mut().zip(values[*n as usize]).for_each(|(s, x)| *s += share * x);
    }
    sum
}

/// Median distance of points to a surface (mm).
pub(super) fn apart_mm(points: &[[f64; 3]], surface: &Surface<f64>) -> f64 {
    let mut distances: Vec<f64> = gaps_to(points, surface).into_iter().map(f64::abs).collect();
    1e3 * median(&mut distances)
}

/// The middle one of some numbers; 0 of none.
pub(super) fn median(numbers: &mut [f64]) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_physics::mesh::shapes::{icosphere, tube};

    #[test]
    fn a_belt_follows_a_larger_ball() {
        let belt = tube(0.51, 0.2, 48, 6);
        let small = Surface::from_mesh(&icosphere(0.5, 4));
        let large = Surface::from_mesh(&icosphere(0.53, 4));
        let gaps = gaps_to(belt.positions(), &small);
        let mut moved = belt.positions().to_vec();
        restore(&mut moved, belt.faces(), &gaps, &large);
        let now = gaps_to(&moved, &large);
        assert!(gaps.iter().zip(&now).all(|(a, b)| (a - b).abs() < 0.003), "{now:?}");
    }
}
