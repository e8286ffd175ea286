//! Layer collision: an outer garment stays outside an inner one (paper, equation for L_mc).
//!
//! `Σ max(ε − d, 0)³` over outer vertices. Both garments move, so the gradient reaches both. [`LayerContact`] says how `d` is
//! measured: [`nearest_vertex`] is the paper's form, cheap enough for training; [`closest_point`] has no jumps where the nearest
//! feature changes, and is what a solver with a line search needs.

pub mod closest_point;
pub mod nearest_vertex;

use std::sync::Arc;

use super::{CurvatureSink, EnergySettings, LayerContact, Weighted};
use crate::mesh::{Topology, TriMesh};
use crate::query::ClosestPoint;
use crate::real::Real;
use crate::vec3::to_f64;
use closest_point::InnerCloth;
use nearest_vertex::{InnerVertices, PosedVertices};

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
    pub(super) fn new(rest: &TriMesh, topology: &Topology, median_edge: f64) -> Self {
        let vertices = InnerVertices::with_median_edge(rest, median_edge);
        Self { vertices, cloth: InnerCloth::new(rest, topology) }
    }

    /// Faces `[F, 3]`, shared by all surfaces of the garment.
    pub(crate) fn faces(&self) -> &Arc<[[u32; 3]]> {
        self.vertices.faces()
    }

    /// Median edge of the rest shape (m).
    pub(crate) fn median_edge(&self) -> f64 {
        self.vertices.median_edge()
    }

    /// Prepares the garment at `positions` `[V, 3]` (m) for queries.
    pub fn posed<T: Real>(&self, positions: &[[T; 3]], contact: LayerContact) -> PosedInnerLayer<T> {
        match contact {
            LayerContact::NearestVertex => PosedInnerLayer::Vertices(self.vertices.posed(positions)),
            LayerContact::ClosestPoint => {
                let positions = positions.iter().map(|p| to_f64(*p)).collect();
                PosedInnerLayer::Cloth(ClosestPoint::new(positions, self.vertices.faces()))
            }
        }
    }

    /// Penalty (m³) of the vertices of `outer` against this garment at `inner` (both `[V, 3]` (m)); adds its weighted gradient to
    /// `targets`, the inner garment's first.
    pub fn evaluate<T: Real>(
        &self,
        inner: &[[T; 3]],
        posed: &PosedInnerLayer<T>,
        outer: &[[T; 3]],
        settings: &EnergySettings,
        targets: Option<[Weighted<'_, T>; 2]>,
    ) -> f64 {
        match posed {
            PosedInnerLayer::Vertices(posed) => {
                self.vertices.evaluate(inner, posed, outer, settings, targets)
            }
            PosedInnerLayer::Cloth(closest) => self.cloth.evaluate(closest, outer, settings, targets),
        }
    }

    /// The outer vertices that are nearer than the gate, with the corners of the inner faces that they are nearest to, and their penalty
    /// (m³); none by the nearest vertex.
    pub(super) fn touches<T: Real>(
        &self,
        posed: &PosedInnerLayer<T>,
        outer: &[[T; 3]],
        settings: &EnergySettings,
    ) -> Vec<(usize, [u32; 3], f64)> {
        match posed {
            PosedInnerLayer::Vertices(_) => Vec::new(),
            PosedInnerLayer::Cloth(closest) => self.cloth.touches(closest, outer, settings),
        }
    }

    /// Curvature of the penalty, for an inner and an outer garment whose vertices start at `offsets`. The paper's form has none: no
    /// solver gets far with it.
    pub(super) fn curvature<T: Real>(
        &self,
        posed: &PosedInnerLayer<T>,
        outer: &[[T; 3]],
        settings: &EnergySettings,
        offsets: [usize; 2],
        sink: &mut dyn CurvatureSink,
    ) {
        if let PosedInnerLayer::Cloth(closest) = posed {
            self.cloth.curvature(closest, outer, settings, offsets, sink);
        }
    }
}
