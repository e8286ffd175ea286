//! Curvature of the weighted sum of a scene: what the static solver needs besides the gradient.

use super::curvature::{CurvatureSink, Scaled};
use super::scene_sum::{BodyMemory, is_weighted, memories};
use super::{LayerContact, SceneEnergy, SceneLayers, Term};
use crate::real::Real;

impl<T: Real> SceneEnergy<T> {
    /// A positive semidefinite approximation of the second derivatives of the weighted sum with respect to posed positions,
    /// vertices numbered as in `posed`; with respect to canonical ones for the holding energy of garments that are not pulled
    /// back. Of the layer terms only the collision by the closest point has one. `memory`: of earlier calls for positions that are
    /// near these.
    ///
    /// # Panics
    /// As [`evaluate`](Self::evaluate).
    pub(crate) fn curvature(
        &self,
        posed: &[[T; 3]],
        canonical: &[[T; 3]],
        sink: &mut dyn CurvatureSink,
        memory: Option<&mut BodyMemory>,
    ) {
        let ranges = self.ranges();
        let memories = memories(memory, self.garments.len());
        for (i, (garment, near)) in self.garments.iter().zip(memories).enumerate() {
            let (range, offset) = (ranges[i].clone(), ranges[i].start);
            let canonical = canonical.get(range.clone()).unwrap_or(&[]);
            let shared = self.share(i, &posed[range], canonical, is_weighted, near);
            for (term, energy) in garment.energies.terms() {
                let weight = garment.weights[term];
                if weight > 0.0 {
                    energy.curvature(&shared.state(), &mut Scaled { sink, offset, weight });
                }
            }
        }
        let is_smooth = self.settings.layer_contact == LayerContact::ClosestPoint;
        let couples = |pair: &&SceneLayers| is_smooth && pair.weights[Term::LayerCollision] > 0.0;
        for pair in self.layers.iter().filter(couples) {
            let [inner, outer] = [pair.inner, pair.outer].map(|garment| ranges[garment].clone());
            let as_inner = self.garments[pair.inner].energies.as_inner();
            let surface = as_inner.posed(&posed[inner.clone()], self.settings.layer_contact);
            let points = self.outer_points(pair, &posed[outer.clone()]);
            let mut sink = Scaled { sink, offset: 0, weight: pair.weights[Term::LayerCollision] };
            let settings = self.settings_of(pair);
            as_inner.curvature(&surface, &points, &settings, [inner.start, outer.start], &mut sink);
        }
    }
}
