//! Layer collision: an outer garment stays outside an inner one (paper, equation for L_mc).
//!
//! `V/P Σ max(ε − d, 0)³` over the `P` contact points of an outer garment of `V` vertices (the paper's are the
//! vertices). Both garments move, so the gradient reaches both. [`LayerContact`] says how `d` is measured:
//! [`nearest_vertex`] is the paper's form, cheap enough for training; [`closest_point`] does not jump along a sheet or at its
//! hem, which a solver with a line search needs. Both jump between two sheets of the inner garment.

pub mod closest_point;
pub mod nearest_vertex;
mod outer_points;

use super::{CurvatureSink, EnergySettings, LayerContact, Weighted};
use crate::mesh::{Topology, TriMesh};
use crate::query::ClosestPoint;
use crate::real::Real;
use crate::vec3::to_f64;
use closest_point::InnerCloth;
use nearest_vertex::{InnerVertices, PosedVertices};
pub use outer_points::OuterPoints;

/// What stays the same of a garment that others lie on.
#[derive(Debug, Clone)]
pub struct InnerLayer {
    vertices: InnerVertices,
    cloth: InnerCloth,
}

/// An inner garment in its present position: made once per evaluation, used by every pair that it is the inner one of.
#[derive(Debug)]
pub enum PosedInnerLayer<T: Real> {
    /// For [`LayerContact::NearestVertex`].
    Vertices(PosedVertices<T>),
    /// For [`LayerContact::ClosestPoint`].
    Cloth(ClosestPoint),
}

impl InnerLayer {
    pub(super) fn new(rest: &TriMesh, topology: &Topology) -> Self {
        Self { vertices: InnerVertices::new(rest), cloth: InnerCloth::new(rest, topology) }
    }

    /// Median edge of the rest shape (m).
    pub(crate) fn median_edge(&self) -> f64 {
        self.vertices.median_edge
    }

    /// Prepares the garment at `positions` `[V, 3]` (m) for queries.
    pub fn posed<T: Real>(&self, positions: &[[T; 3]], contact: LayerContact) -> PosedInnerLayer<T> {
        match contact {
            LayerContact::NearestVertex => PosedInnerLayer::Vertices(self.vertices.posed(positions)),
            LayerContact::ClosestPoint => {
                let positions = positions.iter().map(|p| to_f64(*p)).collect();
                PosedInnerLayer::Cloth(ClosestPoint::new(positions, &self.vertices.faces))
            }
        }
    }

    /// Penalty (m³) of the points `outer` against this garment at `inner` `[V, 3]` (m); adds its weighted gradient to
    /// `targets`, the inner garment's first.
    pub fn evaluate<T: Real>(
        &self,
        inner: &[[T; 3]],
        posed: &PosedInnerLayer<T>,
        outer: OuterPoints<'_, T>,
        settings: &EnergySettings,
        targets: Option<[Weighted<'_, T>; 2]>,
    ) -> f64 {
        let share = outer.share;
        let targets = targets.map(|t| t.map(|t| Weighted { weight: share * t.weight, gradient: t.gradient }));
        share
            * match posed {
                PosedInnerLayer::Vertices(posed) => {
                    self.vertices.evaluate(inner, posed, &outer, settings, targets)
                }
                PosedInnerLayer::Cloth(closest) => self.cloth.evaluate(closest, &outer, settings, targets),
            }
    }

    /// Curvature of the penalty, for an inner and an outer garment whose vertices start at `offsets`. The paper's form
    /// has none: no solver gets far with it.
    pub(super) fn curvature<T: Real>(
        &self,
        posed: &PosedInnerLayer<T>,
        outer: &OuterPoints<'_, T>,
        settings: &EnergySettings,
        offsets: [usize; 2],
        sink: &mut dyn CurvatureSink,
    ) {
        if let PosedInnerLayer::Cloth(closest) = posed {
            self.cloth.curvature(closest, outer, settings, offsets, sink);
        }
    }
}
