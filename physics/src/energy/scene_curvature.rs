//! Curvature of the weighted sum of a scene, and where its garments touch: what the static solver needs besides the gradient.

use super::curvature::{CurvatureSink, Scaled};
use super::layer_collision::{InnerLayer, PosedInnerLayer};
use super::{LayerContact, SceneEnergy, SceneLayers, Term};
use crate::real::Real;

/// One vertex near an inner garment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerTouch {
    /// Number of the pair.
    pub pair: usize,
    /// The outer vertex, numbered in the scene.
    pub vertex: usize,
    /// The corners of the inner face it is nearest to, numbered alike.
    pub corners: [usize; 3],
    /// Weighted energy (J).
    pub energy: f64,
}

/// A pair of garments, the inner one ready for queries.
struct Touching<'a, T: Real> {
    pub pair: usize,
    pub as_inner: &'a InnerLayer,
    pub surface: PosedInnerLayer<T>,
    pub outer: &'a [[T; 3]],
    /// Where the vertices of the inner and of the outer garment start.
    pub offsets: [usize; 2],
    pub weight: f64,
}

impl<T: Real> SceneEnergy<T> {
    /// A positive semidefinite approximation of the second derivatives of the weighted sum with respect to posed positions,
    /// vertices numbered as in `posed`; with respect to canonical ones for the holding energy of garments that are not pulled
    /// back. Of the layer terms only the collision by the closest point has one.
    ///
    /// # Panics
    /// As [`evaluate`](Self::evaluate).
    pub fn curvature(&self, posed: &[[T; 3]], canonical: &[[T; 3]], sink: &mut dyn CurvatureSink) {
        for (i, (garment, range)) in self.garments.iter().zip(self.ranges()).enumerate() {
            let offset = range.start;
            let canonical = canonical.get(range.clone()).unwrap_or(&[]);
            let shared = self.share(i, &posed[range], canonical, &|_, weight| weight != 0.0);
            for (term, energy) in garment.energies.terms() {
                let weight = garment.weights[term];
                if weight > 0.0 {
                    energy.curvature(&shared.state(), &mut Scaled { sink, offset, weight });
                }
            }
        }
        for touching in self.touching(posed) {
            let Touching { as_inner, surface, outer, offsets, weight, .. } = touching;
            let mut sink = Scaled { sink, offset: 0, weight };
            as_inner.curvature(&surface, outer, &self.settings, offsets, &mut sink);
        }
    }

    /// Whether [`curvature`](Self::curvature) couples vertices that touch at the moment.
    pub fn couples_garments(&self) -> bool {
        self.layers.iter().any(|pair| self.couples(pair))
    }

    fn couples(&self, pair: &SceneLayers) -> bool {
        self.settings.layer_contact == LayerContact::ClosestPoint && pair.weights[Term::LayerCollision] > 0.0
    }

    /// Every vertex at `posed` that is near an inner garment, of those that [`couples_garments`](Self::couples_garments) is about.
    pub fn layer_touches(&self, posed: &[[T; 3]]) -> Vec<LayerTouch> {
        let mut found = Vec::new();
        for touching in self.touching(posed) {
            let Touching { pair, as_inner, surface, outer, offsets: [inner_offset, outer_offset], weight } =
                touching;
            let touches = as_inner.touches(&surface, outer, &self.settings).into_iter();
            found.extend(touches.map(|(vertex, corners, penalty)| LayerTouch {
                pair,
                vertex: outer_offset + vertex,
                corners: corners.map(|v| inner_offset + v as usize),
                energy: weight * penalty,
            }));
        }
        found
    }

    /// The pairs that [`couples_garments`](Self::couples_garments) is about.
    fn touching<'a>(&'a self, posed: &'a [[T; 3]]) -> impl Iterator<Item = Touching<'a, T>> {
        let ranges = self.ranges();
        let pairs = self.layers.iter().enumerate();
        pairs.filter(|(_, pair)| self.couples(pair)).map(move |(number, pair)| {
            let [inner, outer] = [pair.inner, pair.outer].map(|garment| ranges[garment].clone());
            let as_inner = self.garments[pair.inner].energies.as_inner();
            Touching {
                pair: number,
                as_inner,
                surface: as_inner.posed(&posed[inner.clone()], self.settings.layer_contact),
                offsets: [inner.start, outer.start],
                outer: &posed[outer],
                weight: pair.weights[Term::LayerCollision],
            }
        })
    }
}
