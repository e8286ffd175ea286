//! What is left of the gradient where contact has a kink.
//!
//! The distance to a body has a kink wherever two of its parts are equally near: over a concave edge, in an armpit. A vertex
//! that comes to rest there is pushed by both parts, but the gradient knows only one of them and cannot vanish. The
//! minimum is where *some* convex combination of the forces on all sides balances the rest: zero lies in Clarke's
//! subdifferential. Contact acts on each vertex apart, so the element of smallest norm of that set is found vertex by
//! vertex: the point nearest to the origin in the hull of the forces sampled within [`RADIUS`] (Goldstein's
//! ε-subdifferential). Where the forces within that radius agree, there is no kink, and the gradient stays as it is.

use crate::energy::{SceneEnergy, Term};
use crate::vec3::{add, add_scaled, dot, norm, norm_squared, scale, sub};

/// How near a kink has to be [m].
const RADIUS: f64 = 1e-7;

/// Forces that differ by more than this share of the larger one within the radius belong to different parts of the body.
const KINK: f64 = 1e-2;

/// Corners of a cube and its face centres.
const DIRECTIONS: [[f64; 3]; 14] = [
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
    [0.577, 0.577, 0.577],
    [0.577, 0.577, -0.577],
    [0.577, -0.577, 0.577],
    [0.577, -0.577, -0.577],
    [-0.577, 0.577, 0.577],
    [-0.577, 0.577, -0.577],
    [-0.577, -0.577, 0.577],
    [-0.577, -0.577, -0.577],
];

/// Replaces, at every vertex that rests on a kink of the body collision, the gradient by the subgradient of smallest norm.
pub(super) fn remove_balanced(energy: &SceneEnergy<f64>, posed: &[[f64; 3]], gradient: &mut [[f64; 3]]) {
    let (margin, distance) = (energy.settings.body_collision_epsilon, energy.settings.distance);
    let mut start = 0;
    for garment in &energy.garments {
        let range = start..start + garment.energies.vertex_count();
        start = range.end;
        let weight = garment.weights[Term::BodyCollision];
        if weight == 0.0 {
            continue;
        }
        let force = |p: [f64; 3]| {
            let gap = energy.body.gap(p, distance);
            let excess = (margin - gap.gap).max(0.0);
            scale(gap.gradient, -3.0 * weight * excess * excess)
        };
        for v in range {
            let here = force(posed[v]);
            if here == [0.0; 3] || gradient[v] == [0.0; 3] {
                continue;
            }
            let around = DIRECTIONS.map(|d| force(add_scaled(posed[v], RADIUS, d)));
            let differs = |f: &[f64; 3]| norm(sub(*f, here)) > KINK * norm(*f).max(norm(here));
            if around.iter().any(differs) {
                let rest = sub(gradient[v], here);
                gradient[v] = nearest_to_origin(gradient[v], &around.map(|f| add(rest, f)));
            }
        }
    }
}

/// The point nearest to the origin in the convex hull of `start` and `points` (Gilbert's algorithm).
fn nearest_to_origin(start: [f64; 3], points: &[[f64; 3]]) -> [f64; 3] {
    let mut x = start;
    for _ in 0..300 {
        let ahead = points.iter().copied().min_by(|a, b| dot(*a, x).total_cmp(&dot(*b, x)));
        let Some(p) = ahead else { return x };
        let step = sub(p, x);
        let gain = -dot(x, step);
        if !(gain > 1e-9 * norm_squared(x)) {
            return x;
        }
        x = add_scaled(x, (gain / norm_squared(step)).clamp(0.0, 1.0), step);
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_of_a_hull() {
        // Inside, on a segment, at a corner.
        let inside = [[1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0], [1.0, 1.0, 1.0]];
        assert!(norm(nearest_to_origin(inside[0], &inside)) < 1e-3);
        let segment = [[1.0, 2.0, 0.0], [1.0, -1.0, 0.0]];
        assert!(norm(sub(nearest_to_origin(segment[0], &segment), [1.0, 0.0, 0.0])) < 1e-6);
        let corner = [[1.0, 1.0, 0.0], [2.0, 1.0, 0.0], [1.0, 3.0, 0.5]];
        assert!(norm(sub(nearest_to_origin(corner[1], &corner), corner[0])) < 1e-6);
    }
}
