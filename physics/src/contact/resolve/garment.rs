//! A garment as the post-process sees it: what its positions do not change, and where it is.

use crate::energy::{EnergySettings, Material, strain::Strain};
use crate::mesh::{FacesAtVertex, Topology, TriMesh};
use crate::vec3::{norm, sub};

/// Everything about a garment that its positions do not change: made once, used for every frame and body.
#[derive(Debug)]
pub struct RestGarment {
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) topology: Topology,
    /// Lengths of the topology's edges [m].
    pub(super) edge_lengths: Vec<f64>,
    /// For every face, the topology's edges between its corners k and k+1.
    pub(super) edges_of_faces: Vec<[u32; 3]>,
    /// Vertices on an edge with one face.
    pub(super) is_border: Vec<bool>,
    /// For every face, which of its edges (corner k → k+1) have no second face: bit k.
    pub(super) border_edges: Vec<u8>,
    faces_at: FacesAtVertex,
    strain: Strain,
}

impl RestGarment {
    /// From the undeformed garment.
    pub fn new(rest: &TriMesh) -> Self {
        let topology = Topology::new(rest);
        let faces = rest.faces().to_vec();
        let edge_between = |[a, b]: [u32; 2]| -> u32 {
            let edge = [a.min(b), a.max(b)];
            // Every side of a face is an edge of the topology.
            topology.edges.partition_point(|other| *other < edge) as u32
        };
        let edges_of_faces: Vec<[u32; 3]> =
            faces.iter().map(|&[a, b, c]| [[a, b], [b, c], [c, a]].map(edge_between)).collect();
        let mut faces_at_edge = vec![0; topology.edges.len()];
        edges_of_faces.iter().flatten().for_each(|&e| faces_at_edge[e as usize] += 1);
        let is_single = |e: u32| faces_at_edge[e as usize] == 1;
        let mut is_border = vec![false; rest.vertex_count()];
        for (edge, faces) in topology.edges.iter().zip(&faces_at_edge) {
            edge.iter().for_each(|&v| is_border[v as usize] |= *faces == 1);
        }
        let bits = |edges: &[u32; 3]| (0..3).fold(0, |bits, k| bits | u8::from(is_single(edges[k])) << k);
        let border_edges = edges_of_faces.iter().map(bits).collect();
        let at = |v: u32| rest.positions()[v as usize];
        let edge_lengths = topology.edges.iter().map(|&[a, b]| norm(sub(at(a), at(b)))).collect();
        let faces_at = FacesAtVertex::new(rest.vertex_count(), &faces);
        let strain = Strain::new(rest, &Material::default(), EnergySettings::default().needle_ratio);
        Self { faces, topology, edge_lengths, edges_of_faces, is_border, border_edges, faces_at, strain }
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.is_border.len()
    }

    /// Faces `[F, 3]`.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Faces around vertex `v`, ascending.
    pub(super) fn faces_of(&self, v: u32) -> &[u32] {
        self.faces_at.of(v)
    }

    /// Strain energy at `positions` `[V, 3]` [J], of the default material.
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
    /// Where it is, `[V, 3]` [m].
    pub positions: &'a [[f64; 3]],
}
