//! Body collision: a cubic penalty on vertices closer to the body than a margin (paper, equation for L_c).
//!
//! `Σ max(ε − d, 0)³` over garment vertices, `d` being the signed distance to the body ([`crate::query::Distance`] says
//! which one). The body is fixed; where the nearest vertex changes, `d` jumps a little, and the gradient is that of the
//! vertex in use. A body vertex without a normal (no face, or faces that cancel) has no side and takes no part.

use super::curvature::outer;
use super::{CurvatureSink, GarmentState, GarmentTerm, Weighted};
use crate::query::Gap;
use crate::real::Real;
use crate::vec3::{scale, to_f64};

/// The collision penalty between one garment and the body.
#[derive(Debug, Clone, Copy)]
pub struct BodyCollision;

/// Penalty (m³) for the signed distances `gaps` of the vertices, with margin `epsilon` (m); adds its weighted gradient to
/// `target`.
pub fn body_collision<T: Real>(gaps: &[Gap<T>], epsilon: f64, mut target: Option<Weighted<'_, T>>) -> f64 {
    let mut energy = 0.0;
    for (v, gap) in gaps.iter().enumerate() {
        let excess = epsilon - gap.gap.to_f64();
        // Written so that a NaN distance gives a NaN energy.
        if excess <= 0.0 || gap.gradient == [T::zero(); 3] {
            continue;
        }
        energy += excess * excess * excess;
        if let Some(target) = &mut target {
            target.add(v, scale(to_f64(gap.gradient), -3.0 * excess * excess));
        }
    }
    energy
}

impl<T: Real> GarmentTerm<T> for BodyCollision {
    fn evaluate(&self, state: &GarmentState<'_, T>, target: Option<Weighted<'_, T>>) -> f64 {
        body_collision(state.gaps, state.settings.body_collision_epsilon, target)
    }

    /// `6(ε − d) n nᵀ`: what the penalty has if the surface under the vertex is flat.
    fn curvature(&self, state: &GarmentState<'_, T>, sink: &mut dyn CurvatureSink) {
        for (v, gap) in state.gaps.iter().enumerate() {
            let excess = state.settings.body_collision_epsilon - gap.gap.to_f64();
            if excess > 0.0 {
                let normal = to_f64(gap.gradient);
                sink.add(v, v, outer(6.0 * excess, normal, normal));
            }
        }
    }
}
