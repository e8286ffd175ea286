//! A form that jumps less than that of the nearest vertex: `Σ w(c)·f(d)`, `d` being the signed distance to the closest point `c`
//! of the inner garment's surface.
//!
//! `f(d) = max(ε − d, 0)³` near the surface. Cloth that is deeper than the gate under another is over some other part of it, and
//! no force can tell where it belongs: from half of that depth on `f` fades to nothing. Past a hem an open surface has no
//! sides, and `d` changes its sign at once: `w = s²(3 − 2s)`, `s` being 0 on the border and where more than two faces meet, 1 at
//! all other vertices, and linear on the faces. So the force fades out as well: with `w = s` it would end at the border at
//! once, and cloth that it drives past the hem would come to rest there against a kink that no solver gets over.
//!
//! **It still jumps** where two sheets of the inner garment (a fold, the panels of an open front) are equally near and the point
//! lies over one and under the other: `f` is 0 on one side and `(ε + |d|)³` on the other. In dressed outfits such a jump of
//! one step has been as much as 0.4 J.
//!
//! The closest point moves with both garments, but to first order the distance does not notice: `∂d/∂x = u`,
//! `∂d/∂q = −b u` for the direction `u` out of the surface and the corners `q` with barycentric coordinates `b`. `w` does notice;
//! its derivative is that of the barycentric coordinates of a projection.

use rayon::prelude::*;

use super::outer_points::OuterPoints;
use crate::energy::curvature::outer as dyad;
use crate::energy::elements::GRAIN;
use crate::energy::{CurvatureSink, EnergySettings, Weighted};
use crate::mesh::{Topology, TriMesh};
use crate::query::{ClosestPoint, Feature, SurfacePoint};
use crate::real::Real;
use crate::vec3::{add, add_scaled, dot, norm_squared, scale, sub, to_f64};

/// What stays the same of an inner garment.
#[derive(Debug, Clone)]
pub(super) struct InnerCloth {
    /// `s` per vertex.
    inside: Vec<f64>,
}

/// One outer point against the point of the inner surface that is closest to it.
struct SurfaceContact {
    outer: usize,
    corners: [u32; 3],
    barycentric: [f64; 3],
    /// `∂d/∂x`.
    direction: [f64; 3],
    /// `w` and its derivatives by the outer point and by the corners.
    share: f64,
    share_gradients: [[f64; 3]; 4],
    /// `f`, `f′` and what `f″` has of a flat surface.
    penalty: [f64; 3],
}

impl InnerCloth {
    pub fn new(rest: &TriMesh, topology: &Topology) -> Self {
        let mut inside = vec![1.0; rest.vertex_count()];
        let border = topology.boundary_loops.iter().flatten();
        for &v in border.chain(topology.non_manifold_edges.iter().flatten()) {
            inside[v as usize] = 0.0;
        }
        Self { inside }
    }

    /// As [`InnerLayer::evaluate`](super::InnerLayer::evaluate).
    pub fn evaluate<T: Real>(
        &self,
        closest: &ClosestPoint,
        outer: &OuterPoints<'_, T>,
        settings: &EnergySettings,
        targets: Option<[Weighted<'_, T>; 2]>,
    ) -> f64 {
        let contacts = self.contacts(closest, outer, settings);
        if let Some([mut inner_target, mut outer_target]) = targets {
            for contact in &contacts {
                let [value, slope, _] = contact.penalty;
                let push = scale(contact.direction, contact.share * slope);
                let [by_outer, by_corners @ ..] = contact.share_gradients;
                outer.points.add(&mut outer_target, contact.outer, add_scaled(push, value, by_outer));
                for k in 0..3 {
                    let force = scale(push, -contact.barycentric[k]);
                    inner_target.add(contact.corners[k] as usize, add_scaled(force, value, by_corners[k]));
                }
            }
        }
        contacts.iter().map(|contact| contact.share * contact.penalty[0]).sum()
    }

    /// `w·6(ε − d) a aᵀ` with `a = ∂d/∂(x, q)`: what the penalty has if the surface is flat.
    pub fn curvature<T: Real>(
        &self,
        closest: &ClosestPoint,
        outer: &OuterPoints<'_, T>,
        settings: &EnergySettings,
        [inner_offset, outer_offset]: [usize; 2],
        sink: &mut dyn CurvatureSink,
    ) {
        for contact in self.contacts(closest, outer, settings) {
            let stiffness = outer.share * contact.share * contact.penalty[2];
            let corners = outer.points.corners(contact.outer);
            // Every vertex with its share in how d changes along u.
            let mut parts: [(usize, f64); 6] = [(0, 0.0); 6];
            let own = corners.iter().map(|v| (outer_offset + v, corners.weight()));
            let other = contact.corners.iter().zip(contact.barycentric);
            let all = own.chain(other.map(|(v, b)| (inner_offset + *v as usize, -b)));
            let count = all.zip(&mut parts).map(|(part, to)| *to = part).count();
            for (k, (i, a)) in parts[..count].iter().enumerate() {
                for (j, b) in &parts[..=k] {
                    sink.add(*i, *j, dyad(stiffness * a * b, contact.direction, contact.direction));
                }
            }
        }
    }

    fn contacts<T: Real>(
        &self,
        closest: &ClosestPoint,
        outer: &OuterPoints<'_, T>,
        settings: &EnergySettings,
    ) -> Vec<SurfaceContact> {
        let (epsilon, gate) = (settings.layer_collision_epsilon, settings.layer_gate.unwrap_or_default());
        let contact = |(outer, p): (usize, &[T; 3])| {
            let p = to_f64(*p);
            let found = closest.project_within(p, gate.depth.max(epsilon))?;
            let (distance, direction) = found.signed(p, found.is_behind(p));
            let penalty = penalty(distance, epsilon, gate.depth);
            if penalty[0] == 0.0 {
                return None;
            }
            let corners = closest.face(found.face);
            let values = corners.map(|v| self.inside[v as usize]);
            let [share, slope] = smooth_step(dot(values, found.barycentric));
            if share == 0.0 {
                return None;
            }
            let gradients = interpolated_gradients(values, closest.corners(found.face), &found, p);
            Some(SurfaceContact {
                outer,
                corners,
                barycentric: found.barycentric,
                direction,
                share,
                share_gradients: gradients.map(|gradient| scale(gradient, slope)),
                penalty,
            })
        };
        outer.at.par_iter().with_min_len(GRAIN / 2).enumerate().filter_map(contact).collect()
    }
}

/// `f`, `f′` and `6(ε − d)` at the signed distance `d`, with margin `epsilon`, faded out at −`depth` (m).
fn penalty(d: f64, epsilon: f64, depth: f64) -> [f64; 3] {
    let excess = epsilon - d;
    if excess <= 0.0 || d <= -depth {
        return [0.0; 3];
    }
    let (cube, slope) = (excess.powi(3), -3.0 * excess * excess);
    if d >= -0.5 * depth {
        return [cube, slope, 6.0 * excess];
    }
    let [fade, fade_slope] = smooth_step(2.0 * (d + depth) / depth);
    [cube * fade, slope * fade + cube * fade_slope * 2.0 / depth, 6.0 * excess * fade]
}

/// `t²(3 − 2t)`, which goes from 0 to 1 with `t` and is flat at both ends, and its derivative.
fn smooth_step(t: f64) -> [f64; 2] {
    [t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t)]
}

/// Derivatives of `Σ values·barycentric` of the point `found` of the triangle `q` that is closest to `p`, by `p` and by
/// the corners.
fn interpolated_gradients(
    values: [f64; 3],
    q: [[f64; 3]; 3],
    found: &SurfacePoint,
    p: [f64; 3],
) -> [[f64; 3]; 4] {
    let mut gradients = [[0.0; 3]; 4];
    if values[0] == values[1] && values[1] == values[2] {
        return gradients;
    }
    let offset = sub(p, found.position);
    match found.feature {
        Feature::Vertex(_) => (),
        Feature::Edge(a) => {
            // μ = e·(p − q_a)/e² along the edge e from a to b.
            let b = (a + 1) % 3;
            let edge = sub(q[b], q[a]);
            let rise = (values[b] - values[a]) / norm_squared(edge);
            let (along, mu) = (scale(edge, rise), found.barycentric[b]);
            gradients[0] = along;
            gradients[1 + b] = add_scaled(scale(offset, rise), -mu, along);
            gradients[1 + a] = add_scaled(scale(offset, -rise), mu - 1.0, along);
        }
        Feature::Face => {
            // With the edges e_k from q_0 and G_kl = e_k·e_l: G λ = (e_k·(p − q_0)), so that
            // G dλ = (offset·de_k + e_k·(dp − Σ b dq)).
            let (first, second) = (sub(q[1], q[0]), sub(q[2], q[0]));
            let (a, b, c) = (norm_squared(first), dot(first, second), norm_squared(second));
            let determinant = a * c - b * b;
            let (rise, other) = (values[1] - values[0], values[2] - values[0]);
            let g = [(c * rise - b * other) / determinant, (a * other - b * rise) / determinant];
            let along = add(scale(first, g[0]), scale(second, g[1]));
            gradients[0] = along;
            for (k, tilt) in [-(g[0] + g[1]), g[0], g[1]].into_iter().enumerate() {
                gradients[1 + k] = add_scaled(scale(offset, tilt), -found.barycentric[k], along);
            }
        }
    }
    gradients
}

#[cfg(test)]
mod tests;
