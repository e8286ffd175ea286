//! Registration of points to a surface by iterated closest points with point-to-plane distances, trimmed.

use crate::asset::NormalEquations;
use crate::asset::rotation::{self, IDENTITY, Matrix3};
use clothcombo_physics::Surface;
use clothcombo_physics::vec3::{add, cross, dot, scale, sub};
use rayon::prelude::*;

/// Share of the points that have a say; what two people do not share, hair and shoes, is left out.
const ICP_SHARE: f64 = 0.8;
/// Closest points farther away (m) are on another part of the body.
const ICP_REACH: f64 = 0.15;
/// The scale stays within this factor of where it began.
const SCALE_RANGE: f64 = 1.2;

/// `p ↦ scale · rotation · p + translation`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Similarity {
    pub scale: f64,
    pub rotation: Matrix3,
    pub translation: [f64; 3],
}

impl Similarity {
    pub fn scaling(factor: f64, translation: [f64; 3]) -> Self {
        Self { scale: factor, rotation: IDENTITY, translation }
    }

    pub fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        add(scale(rotation::apply(&self.rotation, p), self.scale), self.translation)
    }

    /// A direction.
    pub fn turned(&self, direction: [f64; 3]) -> [f64; 3] {
        rotation::apply(&self.rotation, direction)
    }

    /// The point that goes to `q`.
    pub fn inverse(&self, q: [f64; 3]) -> [f64; 3] {
        let back = rotation::transpose(&self.rotation);
        scale(rotation::apply(&back, sub(q, self.translation)), 1.0 / self.scale)
    }
}

/// Refines `start` over some `rounds`: rigid first, from the middle on with one uniform scale unless that `is_rigid`.
pub(super) fn registered(
    points: &[[f64; 3]],
    surface: &Surface<f64>,
    start: Similarity,
    rounds: usize,
    is_rigid: bool,
) -> Similarity {
    // Built before it is shared.
    surface.closest_point();
    let mut motion = start;
    for round in 0..rounds {
        let with_scale = !is_rigid && 2 * round >= rounds;
        let Some(next) = step(points, surface, &motion, with_scale) else { break };
        motion = next;
        motion.scale = motion.scale.clamp(start.scale / SCALE_RANGE, start.scale * SCALE_RANGE);
    }
    motion
}

/// One Gauss–Newton step; none where the points do not determine it.
fn step(
    points: &[[f64; 3]],
    surface: &Surface<f64>,
    motion: &Similarity,
    with_scale: bool,
) -> Option<Similarity> {
    let mut pairs: Vec<([f64; 3], [f64; 3], f64)> = points
        .par_iter()
        .with_min_len(64)
        .filter_map(|p| {
            let p = motion.apply(*p);
            let found = surface.closest_point().project_within(p, ICP_REACH)?;
            Some((p, found.normal, dot(found.normal, sub(found.position, p))))
        })
        .collect();
    pairs.sort_by(|a, b| a.2.abs().total_cmp(&b.2.abs()));
    pairs.truncate((ICP_SHARE * pairs.len() as f64) as usize);
    let count = pairs.len() as f64;
    // Fewer do not tell how a body stands.
    if pairs.len() < 50 {
        return None;
    }
    let centre = scale(pairs.iter().fold([0.0; 3], |sum, (p, _, _)| add(sum, *p)), 1.0 / count);
    let size = if with_scale { 7 } else { 6 };
    let mut equations = NormalEquations::new(size);
    for (p, n, wanted) in &pairs {
        let arm = sub(*p, centre);
        let [a, b, c] = cross(arm, *n);
        equations.add(&[a, b, c, n[0], n[1], n[2], dot(arm, *n)][..size], *wanted);
    }
    let x = equations.solution(|_| 1e-9 * count)?;
    let turn = rotation::matrix_from_axis_angle([x[0], x[1], x[2]]);
    let factor = if with_scale { 1.0 + x[6] } else { 1.0 };
    // About the centre: p ↦ c + factor · turn · (p − c) + shift.
    let about = |p: [f64; 3]| {
        add(scale(rotation::apply(&turn, sub(p, centre)), factor), add(centre, [x[3], x[4], x[5]]))
    };
    let next = Similarity {
        scale: factor * motion.scale,
        rotation: rotation::product(&turn, &motion.rotation),
        translation: about(motion.translation),
    };
    (next.scale.is_finite() && next.translation.iter().all(|t| t.is_finite())).then_some(next)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::mannequin;
    use clothcombo_physics::vec3::norm;

    #[test]
    fn a_turned_and_scaled_body_comes_back() {
        let body = mannequin();
        let surface = Surface::from_mesh(&body.zero_body());
        let turn = rotation::matrix_from_axis_angle([0.03, -0.08, 0.02]);
        let points: Vec<[f64; 3]> = body
            .template
            .iter()
            .map(|p| add(scale(rotation::apply(&turn, *p), 1.0 / 1.04), [0.02, -0.01, 0.03]))
            .collect();
        let found = registered(&points, &surface, Similarity::scaling(1.0, [0.0; 3]), 40, false);
        let error = points
            .iter()
            .zip(&body.template)
            .map(|(p, q)| norm(sub(found.apply(*p), *q)))
            .fold(0.0, f64::max);
        assert!(error < 1e-3 && (found.scale - 1.04).abs() < 1e-3, "{error} {}", found.scale);
    }
}
