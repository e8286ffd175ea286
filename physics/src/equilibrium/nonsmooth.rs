//! What is left of the gradient where contact is not smooth.
//!
//! The distance to a body has no derivative wherever two of its parts are equally near: over a concave edge, in an armpit. A vertex
//! that comes to rest there is pushed by both parts, but the gradient knows only one of them and cannot vanish. The
//! minimum is where *some* convex combination of the forces on all sides balances the rest: zero lies in Clarke's
//! subdifferential. Contact acts on each vertex apart, so the element of smallest norm of that set is found vertex by
//! vertex: the point nearest to the origin in the hull of the forces sampled within [`RADIUS`] (Goldstein's
//! ε-subdifferential). Where the forces within that radius agree, the point is smooth, and the gradient stays as it is.
//!
//! The solver moves vertices along the nonsmooth sets they rest on, not across: the energy is smooth there (the U-space of Lemaréchal,
//! Oustry and Sagastizábal, "The U-Lagrangian of a convex function", 2000). A vertex that is driven against a nonsmooth point nearby is
//! put on it ([`onto_nonsmooth_points`]), where it is kept as long as the forces on both sides balance.

use rayon::prelude::*;

use crate::energy::{SceneEnergy, Term};
use crate::query::closest_on_triangle;
use crate::vec3::{add, add_scaled, cross, dot, norm, norm_squared, scale, sub};

/// How near a nonsmooth point has to be (m).
const RADIUS: f64 = 1e-7;

/// Forces that differ by more than this share of the larger one within the radius belong to different parts of the body.
const DIFFERENT: f64 = 1e-2;

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

/// How far the nonsmooth point that a vertex is driven against may be for the vertex to be put on it (m), nearest first.
const REACH: [f64; 3] = [1e-6, 1e-5, 1e-4];

/// Distance over which the forces of a single part of the body may turn (m): they do not by less than reach over this.
const TURN: f64 = 1e-3;

/// Most parts of the body that are looked at in one nonsmooth point.
const MOST_SIDES: usize = 6;

/// Halvings of the distance to a nonsmooth point.
const HALVINGS: usize = 40;

/// Directions whose rest after projection is shorter than this share are dependent on those before.
const INDEPENDENT: f64 = 1e-2;

/// A vertex that rests where the body collision is not smooth.
pub(super) struct NonsmoothPoint {
    vertex: usize,
    /// The subgradient of smallest norm.
    gradient: [f64; 3],
    /// Orthonormal directions across the nonsmooth set, along which the forces that balance in it differ; a vertex that is
    /// driven off to one side has none.
    across: Vec<[f64; 3]>,
}

impl NonsmoothPoint {
    /// A vertex that is not to move at all.
    pub(super) fn held(vertex: usize, gradient: [f64; 3]) -> Self {
        Self { vertex, gradient, across: vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] }
    }

    /// `x` without its part across the nonsmooth set.
    fn along(&self, x: [f64; 3]) -> [f64; 3] {
        self.across.iter().fold(x, |x, m| add_scaled(x, -dot(x, *m), *m))
    }
}

/// The vertices of `posed` that rest on a nonsmooth point and whose part of `gradient`, which is that at `posed`, is longer than `least`.
pub(super) fn nonsmooth_points(
    energy: &SceneEnergy<f64>,
    posed: &[[f64; 3]],
    gradient: &[[f64; 3]],
    least: f64,
) -> Vec<NonsmoothPoint> {
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
        let mut sides = vec![gradient[vertex]];
        for f in around.map(|f| add(rest, f)) {
            let is_known = |side: &[f64; 3]| !differ(sub(*side, rest), sub(f, rest));
            if !sides.iter().any(is_known) && sides.len() < MOST_SIDES {
                sides.push(f);
            }
        }
        let (smallest, balanced) = nearest_to_origin(&sides);
        let mut across: Vec<[f64; 3]> = Vec::new();
        for side in balanced.iter().skip(1) {
            let difference = sub(*side, balanced[0]);
            let left = across.iter().fold(difference, |x, m| add_scaled(x, -dot(x, *m), *m));
            if norm(left) > INDEPENDENT * norm(difference) {
                across.push(scale(left, 1.0 / norm(left)));
            }
        }
        Some(NonsmoothPoint { vertex, gradient: smallest, across })
    };
    in_contact(energy, gradient, least, at)
}

/// Where vertices that are driven against a nonsmooth point nearby would rest on it.
pub(super) fn onto_nonsmooth_points(
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
            // The forces turn a little with every step; a nonsmooth point turns them at once.
            let is_beyond = |length: f64| differ_by(beyond(length), here, DIFFERENT + reach / TURN);
            if !is_beyond(reach) {
                near = reach;
                continue;
            }
            let mut far = reach;
            for _ in 0..HALVINGS {
                let middle = 0.5 * (near + far);
                if is_beyond(middle) { far = middle } else { near = middle }
            }
            // Beyond the nonsmooth point, the vertex must be driven back.
            let there = add(sub(gradient[vertex], here), beyond(far + RADIUS));
            let is_nonsmooth = differ(beyond(far + 0.1 * RADIUS), beyond((far - 0.1 * RADIUS).max(0.0)));
            return (is_nonsmooth && far > 0.5 * RADIUS && dot(there, downhill) > 0.0)
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
    differ_by(a, b, DIFFERENT)
}

/// Whether two forces differ by more than `share` of the larger.
fn differ_by(a: [f64; 3], b: [f64; 3], share: f64) -> bool {
    norm(sub(a, b)) > share * norm(a).max(norm(b))
}

/// Puts the smallest subgradients in the place of the gradients at `points`.
pub(super) fn balance(points: &[NonsmoothPoint], gradient: &mut [[f64; 3]]) {
    for point in points {
        gradient[point.vertex] = point.gradient;
    }
}

/// Takes the components across `points` out of `x`.
pub(super) fn project(points: &[NonsmoothPoint], x: &mut [[f64; 3]]) {
    for point in points {
        x[point.vertex] = point.along(x[point.vertex]);
    }
}

/// The point nearest to the origin in the convex hull of `points`, and those of them whose convex combination it is.
fn nearest_to_origin(points: &[[f64; 3]]) -> ([f64; 3], Vec<[f64; 3]>) {
    let n = points.len();
    let mut best = (points[0], vec![points[0]]);
    let is_inside = |corners: [[f64; 3]; 4]| {
        // The origin is on the same side of every face as the corner opposite.
        (0..4).all(|k| {
            let [a, b, c, d] = [1, 2, 3, 0].map(|i| corners[(k + i) % 4]);
            let normal = cross(sub(b, a), sub(c, a));
            dot(normal, sub(d, a)) * -dot(normal, a) > 0.0
        })
    };
    for i in 0..n {
        for j in i..n {
            for k in j..n {
                let corners = [points[i], points[j], points[k]];
                let found = closest_on_triangle([0.0; 3], corners);
                if found.distance_squared < norm_squared(best.0) {
                    let with_weight = (0..3).filter(|c| found.barycentric[*c] > 0.0);
                    best = (found.position, with_weight.map(|c| corners[c]).collect());
                }
                for l in k + 1..n {
                    let corners = [points[i], points[j], points[k], points[l]];
                    if i < j && j < k && is_inside(corners) {
                        return ([0.0; 3], corners.to_vec());
                    }
                }
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_of_a_hull() {
        // Inside, on a segment, at a corner.
        let inside = [[1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0], [1.0, 1.0, 1.0]];
        assert_eq!(nearest_to_origin(&inside), ([0.0; 3], inside.to_vec()));
        let segment = [[1.0, 2.0, 0.0], [1.0, -1.0, 0.0]];
        let (found, of) = nearest_to_origin(&segment);
        assert!(norm(sub(found, [1.0, 0.0, 0.0])) < 1e-12 && of == segment);
        let corner = [[1.0, 1.0, 0.0], [2.0, 1.0, 0.0], [1.0, 3.0, 0.5]];
        assert_eq!(nearest_to_origin(&corner), (corner[0], vec![corner[0]]));
    }
}
