//! Body collision: a cubic penalty on points of a garment closer to the body than a margin (paper, equation for L_c).
//!
//! `V/P Σ max(ε − d, 0)³` over the `P` contact points of a garment of `V` vertices
//! ([`ContactSamples`](super::ContactSamples); the paper's are the vertices), `d` being the signed distance to the body
//! ([`crate::query::Distance`] says which one). The body is fixed; where the nearest vertex changes, `d` jumps a
//! little, and the gradient is that of the vertex in use. A body vertex without a normal (no face, or faces that
//! cancel) has no side and takes no part.

use super::curvature::outer;
use super::{ContactPoints, CurvatureSink, GarmentState, GarmentTerm, Weighted};
use crate::query::Gap;
use crate::real::Real;
use crate::vec3::{scale, to_f64};

/// The collision penalty between one garment and the body.
#[derive(Debug, Clone)]
pub(super) struct BodyCollision(pub ContactPoints);

/// The contact points closer to the body than `epsilon` (m) by an excess, with the derivative of their distance.
fn in_contact<T: Real>(gaps: &[Gap<T>], epsilon: f64) -> impl Iterator<Item = (usize, f64, [f64; 3])> {
    let excess = gaps.iter().enumerate().map(move |(p, gap)| (p, epsilon - gap.gap.to_f64(), gap.gradient));
    // Written so that a NaN distance gives a NaN energy.
    let is_in_contact =
        |(_, excess, gradient): &(usize, f64, [T; 3])| !(*excess <= 0.0 || *gradient == [T::zero(); 3]);
    excess.filter(is_in_contact).map(|(p, excess, gradient)| (p, excess, to_f64(gradient)))
}

impl<T: Real> GarmentTerm<T> for BodyCollision {
    /// Energy (m³).
    fn evaluate(&self, state: &GarmentState<'_, T>, target: Option<Weighted<'_, T>>) -> f64 {
        let (epsilon, share) =
            (state.settings.body_collision_epsilon, self.0.share(state.settings.body_samples));
        let mut target = target.map(|t| Weighted { weight: t.weight * share, gradient: t.gradient });
        let mut energy = 0.0;
        for (point, excess, gradient) in in_contact(state.gaps, epsilon) {
            energy += excess * excess * excess;
            if let Some(target) = &mut target {
                self.0.add(target, point, scale(gradient, -3.0 * excess * excess));
            }
        }
        share * energy
    }

    /// `6(ε − d) n nᵀ` at every contact point: what the penalty has if the surface under it is flat.
    fn curvature(&self, state: &GarmentState<'_, T>, sink: &mut dyn CurvatureSink) {
        let (epsilon, share) =
            (state.settings.body_collision_epsilon, self.0.share(state.settings.body_samples));
        for (point, excess, normal) in in_contact(state.gaps, epsilon) {
            self.0.add_curvature(sink, point, outer(share * 6.0 * excess, normal, normal));
        }
    }
}
