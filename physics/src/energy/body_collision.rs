//! Body collision: a cubic penalty on points of a garment closer to the body than a margin (paper, equation for L_c).
//!
//! `V/P Σ max(ε − d, 0)³` over the `P` contact points of a garment of `V` vertices
//! ([`ContactSamples`](super::ContactSamples); the paper's are the vertices), `d` being the signed distance to the body
//! ([`crate::query::Distance`] says which one). The body is fixed; where the nearest vertex changes, `d` jumps a
//! little, and the gradient is that of the vertex in use. A body vertex without a normal (no face, or faces that
//! cancel) has no side and takes no part.

use super::curvature::outer;
use super::{ContactPoints, CurvatureSink, GarmentState, GarmentTerm, Weighted};
use crate::real::Real;
use crate::vec3::{scale, to_f64};

/// The collision penalty between one garment and the body.
#[derive(Debug, Clone)]
pub(super) struct BodyCollision {
    pub points: ContactPoints,
    /// Of the garment (m).
    pub thickness: f64,
}

impl BodyCollision {
    /// The points closer to the body, and to garments between, than the margin by an excess (m), with the derivative of their
    /// distance.
    fn in_contact<T: Real>(
        &self,
        state: &GarmentState<'_, T>,
    ) -> impl Iterator<Item = (usize, f64, [f64; 3])> {
        let epsilon = state.settings.body_margin(self.thickness);
        let margin = move |point| epsilon + self.points.mean(state.thickness_below, point);
        let excess = state
            .gaps
            .iter()
            .enumerate()
            .map(move |(p, gap)| (p, margin(p) - gap.gap.to_f64(), gap.gradient));
        // Written so that a NaN distance gives a NaN energy.
        let is_in_contact =
            |(_, excess, gradient): &(usize, f64, [T; 3])| !(*excess <= 0.0 || *gradient == [T::zero(); 3]);
        excess.filter(is_in_contact).map(|(p, excess, gradient)| (p, excess, to_f64(gradient)))
    }
}

impl<T: Real> GarmentTerm<T> for BodyCollision {
    /// Energy (m³).
    fn evaluate(&self, state: &GarmentState<'_, T>, target: Option<Weighted<'_, T>>) -> f64 {
        let share = self.points.share(state.settings.body_samples);
        let mut target = target.map(|t| Weighted { weight: t.weight * share, gradient: t.gradient });
        let mut energy = 0.0;
        for (point, excess, gradient) in self.in_contact(state) {
            energy += excess * excess * excess;
            if let Some(target) = &mut target {
                self.points.add(target, point, scale(gradient, -3.0 * excess * excess));
            }
        }
        share * energy
    }

    /// `6(ε − d) n nᵀ` at every contact point: what the penalty has if the surface under it is flat.
    fn curvature(&self, state: &GarmentState<'_, T>, sink: &mut dyn CurvatureSink) {
        let share = self.points.share(state.settings.body_samples);
        for (point, excess, normal) in self.in_contact(state) {
            self.points.add_curvature(sink, point, outer(share * 6.0 * excess, normal, normal));
        }
    }
}
