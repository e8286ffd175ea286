//! What is left of the gradient where contact has a kink.
//!
//! The distance to a body has a kink wherever two of its parts are equally near: over a concave edge, in an armpit. A vertex
//! that comes to rest there is pushed by both parts, but the gradient knows only one of them and cannot vanish. The
//! minimum is where *some* convex combination of the forces on all sides balances the rest: zero lies in Clarke's
//! subdifferential. Contact acts on each vertex apart, so the element of smallest norm of that set is found vertex by
//! vertex: the point nearest to the origin in the hull of the forces sampled within [`RADIUS`] (Goldstein's
//! ε-subdifferential). Where the forces within that radius agree, there is no kink, and the gradient stays as it is.
//!
//! The solver moves vertices along the kinks they rest on, not across: the energy is smooth there (the U-space of Lemaréchal,
//! Oustry and Sagastizábal, "The U-Lagrangian of a convex function", 2000). A vertex that is driven against a kink nearby is
//! put on it ([`onto_kinks`]), where it is kept as long as the forces on both sides balance.

use rayon::prelude::*;

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

/// How far the kink that a vertex is driven against may be for the vertex to be put on it [m], nearest first.
const REACH: [f64; 4] = [1e-6, 1e-5, 1e-4, 5e-4];

/// Halvings of the way to a kink.
const HALVINGS: usize = 40;

/// Directions whose rest after projection is shorter than this share are dependent on those before.
const INDEPENDENT: f64 = 1e-2;

/// A vertex that rests on a kink of the body collision.
pub(super) struct Kink {
    vertex: usize,
    /// The subgradient of smallest norm.
    gradient: [f64; 3],
    /// Orthonormal directions across the kink, along which its forces differ.
    across: Vec<[f64; 3]>,
}

impl Kink {
    /// `x` without its part across the kink.
    fn along(&self, x: [f64; 3]) -> [f64; 3] {
        self.across.iter().fold(x, |x, m| add_scaled(x, -dot(x, *m), *m))
    }
}

/// The vertices of `posed` that rest on a kink and whose part of `gradient`, which is that at `posed`, is longer than `least`.
pub(super) fn kinks(
    energy: &SceneEnergy<f64>,
    posed: &[[f64; 3]],
    gradient: &[[f64; 3]],
    least: f64,
) -> Vec<Kink> {
    let at = |vertex: usize, force: &dyn Fn([f64; 3]) -> [f64; 3]| {
        let here = force(posed[vertex]);
        if here == [0.0; 3] {
            return None;
        }
        let around = DIRECTIONS.map(|d| force(add_scaled(posed[vertex], RADIUS, d)));
        if !around.iter().any(|f| differ(*f, here)) {
            return None;
        }
        let rest = sub(gradient[vertex], here);
        let smallest = nearest_to_origin(gradient[vertex], &around.map(|f| add(rest, f)));
        let mut across: Vec<[f64; 3]> = Vec::new();
        for difference in around.into_iter().filter(|f| differ(*f, here)).map(|f| sub(f, here)) {
            let left = across.iter().fold(difference, |x, m| add_scaled(x, -dot(x, *m), *m));
            if norm(left) > INDEPENDENT * norm(difference) {
                across.push(scale(left, 1.0 / norm(left)));
            }
        }
        Some(Kink { vertex, gradient: smallest, across })
    };
    in_contact(energy, gradient, least, at)
}

/// Where vertices that are driven against a kink nearby would rest on it.
pub(super) fn onto_kinks(
    energy: &SceneEnergy<f64>,
    posed: &[[f64; 3]],
    gradient: &[[f64; 3]],
    least: f64,
) -> Vec<(usize, [f64; 3])> {
    let at = |vertex: usize, force: &dyn Fn([f64; 3]) -> [f64; 3]| {
        let here = force(posed[vertex]);
        if here == [0.0; 3] {
            return None;
        }
        let downhill = scale(gradient[vertex], -1.0 / norm(gradient[vertex]));
        let beyond = |length: f64| force(add_scaled(posed[vertex], length, downhill));
        let mut near = 0.0;
        for reach in REACH {
            // The forces turn a little with every step; a kink turns them at once.
            if !differ(beyond(reach), here) {
                near = reach;
                continue;
            }
            let mut far = reach;
            for _ in 0..HALVINGS {
                let middle = 0.5 * (near + far);
                if differ(beyond(middle), here) { far = middle } else { near = middle }
            }
            // Beyond the kink, the vertex must be driven back.
            let there = add(sub(gradient[vertex], here), beyond(far + RADIUS));
            let is_kink = differ(beyond(far + 0.1 * RADIUS), beyond((far - 0.1 * RADIUS).max(0.0)));
            return (is_kink && far > 0.5 * RADIUS && dot(there, downhill) > 0.0)
                .then(|| (vertex, add_scaled(posed[vertex], far, downhill)));
        }
        None
    };
    in_contact(energy, gradient, least, at)
}

/// `look` at every vertex of a garment with a body collision whose gradient is longer than `least`, with its contact force.
fn in_contact<R: Send>(
    energy: &SceneEnergy<f64>,
    gradient: &[[f64; 3]],
    least: f64,
    look: impl Fn(usize, &dyn Fn([f64; 3]) -> [f64; 3]) -> Option<R> + Sync,
) -> Vec<R> {
    let (margin, distance) = (energy.settings.body_collision_epsilon, energy.settings.distance);
    let mut found = Vec::new();
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
        let of_garment = range.into_par_iter().with_min_len(64).filter(|v| norm(gradient[*v]) > least);
        found.par_extend(of_garment.filter_map(|v| look(v, &force)));
    }
    found
}

/// Whether two forces belong to different parts of the body.
fn differ(a: [f64; 3], b: [f64; 3]) -> bool {
    norm(sub(a, b)) > KINK * norm(a).max(norm(b))
}

/// Puts the smallest subgradients in the place of the gradients at `kinks`.
pub(super) fn balance(kinks: &[Kink], gradient: &mut [[f64; 3]]) {
    for kink in kinks {
        gradient[kink.vertex] = kink.gradient;
    }
}

/// Takes what points across `kinks` out of `x`.
pub(super) fn project(kinks: &[Kink], x: &mut [[f64; 3]]) {
    for kink in kinks {
        x[kink.vertex] = kink.along(x[kink.vertex]);
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
