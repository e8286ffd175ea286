//! The zero body as a chart: a point over it has the nearest body vertex and the height over that as its coordinates.

use super::binding::smooth;
use clothcombo_physics::mesh::{Topology, TriMesh, vertex_normals};

/// Averaging steps over the body, half towards the mean of the ring each: at edges of a centimetre what ends at the hem of a garment
/// fades over some three centimetres, as cloth over it would.
const FADE: usize = 10;

/// Neighbours and normals of the vertices of the zero body.
#[derive(Debug)]
pub(super) struct BodyChart {
    topology: Topology,
    /// Unit normals `[V]`.
    pub normals: Vec<[f64; 3]>,
}

impl BodyChart {
    pub fn new(zero_body: &TriMesh) -> Self {
        let normals = vertex_normals(zero_body.positions(), zero_body.faces());
        Self { topology: Topology::new(zero_body), normals }
    }

    /// Fades one value per body vertex `[V]` over a few centimetres.
    pub fn fade(&self, values: &mut Vec<f32>) {
        smooth(values, 1, &self.topology, FADE);
    }
}
