//! A garment as the post-process sees it: what its positions do not change, and where it is.

use super::ResolveError;
use crate::contact::{LayerTopology, Triangle};
use crate::energy::{EnergySettings, Material, strain::Strain};
use crate::mesh::{Topology, TriMesh};
use crate::query::Surface;
use crate::rows::{CompressedRows, faces_at_vertices};
use crate::vec3::{self, norm, sub};

/// Positions farther from the origin than this are refused (m): the exact predicates would hold, but no distance would.
pub const FARTHEST_POSITION: f64 = 1e3;

/// Everything about a garment that its positions do not change: made once, used for every frame and body.
#[derive(Debug)]
pub struct RestGarment {
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) topology: Topology,
    /// Lengths of the topology's edges (m).
    pub(super) edge_lengths: Vec<f64>,
    /// For every face, the topology's edges between its corners k and k+1.
    pub(super) edges_of_faces: Vec<[u32; 3]>,
    pub(super) layer: LayerTopology,
    faces_at: CompressedRows<u32>,
    /// The first face with the vertices of an earlier one, and that one.
    doubled: Option<[u32; 2]>,
    strain: Strain,
}

impl RestGarment {
    /// From the undeformed garment, of the default material.
    pub fn new(rest: &TriMesh) -> Self {
        Self::of_material(rest, &Material::default())
    }

    /// From the undeformed garment and what it is made of.
    pub fn of_material(rest: &TriMesh, material: &Material) -> Self {
        let topology = Topology::new(rest);
        let faces = rest.faces().to_vec();
        let edge_between = |[a, b]: [u32; 2]| -> u32 {
            let edge = [a.min(b), a.max(b)];
            // Every side of a face is an edge of the topology.
            topology.edges.partition_point(|other| *other < edge) as u32
        };
        let edges_of_faces: Vec<[u32; 3]> =
            faces.iter().map(|&[a, b, c]| [[a, b], [b, c], [c, a]].map(edge_between)).collect();
        let layer = LayerTopology::new(&topology, &edges_of_faces);
        let at = |v: u32| rest.positions()[v as usize];
        let edge_lengths = topology.edges.iter().map(|&[a, b]| norm(sub(at(a), at(b)))).collect();
        let faces_at = faces_at_vertices(rest.vertex_count(), &faces, 0..faces.len() as u32);
        let strain = Strain::new(rest, material, EnergySettings::default().needle_ratio);
        let doubled = rest.doubled_face();
        Self { faces, topology, edge_lengths, edges_of_faces, layer, faces_at, doubled, strain }
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.topology.vertex_count()
    }

    /// Faces `[F, 3]`.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Faces around vertex `v`, ascending.
    pub(super) fn faces_of(&self, v: u32) -> &[u32] {
        self.faces_at.row(v as usize)
    }

    /// Strain energy at `positions` `[V, 3]` (J).
    ///
    /// # Panics
    /// When there are fewer positions than vertices.
    pub fn strain_energy(&self, positions: &[[f64; 3]]) -> f64 {
        self.strain.evaluate(positions, None)
    }
}

/// One garment of an outfit.
#[derive(Debug, Clone, Copy)]
pub struct Layer<'a> {
    /// Its constants.
    pub garment: &'a RestGarment,
    /// Where it is, `[V, 3]` (m).
    pub positions: &'a [[f64; 3]],
}

/// The same garments elsewhere.
pub(super) fn at<'a>(layers: &[Layer<'a>], positions: &'a [Vec<[f64; 3]>]) -> Vec<Layer<'a>> {
    layers.iter().zip(positions).map(|(l, positions)| Layer { garment: l.garment, positions }).collect()
}

/// Corners of all faces of the garments.
pub(super) fn triangles(layers: &[Layer<'_>]) -> Vec<Triangle> {
    let corners = |l: &Layer<'_>, face: &[u32; 3]| face.map(|v| l.positions[v as usize]);
    layers.iter().flat_map(|l| l.garment.faces.iter().map(move |face| corners(l, face))).collect()
}

/// Whether the input can be worked on.
pub(super) fn check(body: &Surface<f64>, layers: &[Layer<'_>]) -> Result<(), ResolveError> {
    let is_near = |p: &[f64; 3]| vec3::is_finite(*p) && p.iter().all(|x| x.abs() <= FARTHEST_POSITION);
    let is_whole = |f: &[u32; 3]| f.iter().all(|&v| body.positions.get(v as usize).is_some_and(is_near));
    if !body.faces.iter().any(is_whole) {
        return Err(ResolveError::EmptyBody);
    }
    for (garment, layer) in layers.iter().enumerate() {
        let (expected, found) = (layer.garment.vertex_count(), layer.positions.len());
        if expected != found {
            return Err(ResolveError::Count { garment, expected, found });
        }
        if let Some([face, first]) = layer.garment.doubled {
            return Err(ResolveError::DoubledFace { garment, face, first });
        }
        if let Some(vertex) = layer.positions.iter().position(|p| !is_near(p)) {
            return Err(ResolveError::Position { garment, vertex, position: layer.positions[vertex] });
        }
    }
    Ok(())
}
