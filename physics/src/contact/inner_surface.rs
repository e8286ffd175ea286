//! The closest-point form of the order of two layers: a garment as the surface that others lie over or under.

use crate::mesh::{Topology, vertex_normals};
use crate::query::ClosestPoint;
use crate::query::triangle_tree::TriangleTree;
use crate::vec3::{add_scaled, bounds, dot, norm, scale, sub};

/// Components and border of a garment: what its order against others needs to know, whatever its positions.
#[derive(Debug)]
pub struct LayerTopology {
    component_of_vertex: Vec<u32>,
    component_count: usize,
    /// Vertices on an edge with one face.
    is_border: Vec<bool>,
    /// For every face, which of its edges (corner k → k+1) have no second face: bit k.
    border_edges: Vec<u8>,
}

impl LayerTopology {
    /// `edges_of_faces`: for every face, the topology's edges between its corners k and k+1.
    pub(super) fn new(topology: &Topology, edges_of_faces: &[[u32; 3]]) -> Self {
        let mut faces_at_edge = vec![0; topology.edges.len()];
        edges_of_faces.iter().flatten().for_each(|&e| faces_at_edge[e as usize] += 1);
        let is_single = |e: u32| faces_at_edge[e as usize] == 1;
        let mut is_border = vec![false; topology.vertex_count()];
        for (edge, faces) in topology.edges.iter().zip(&faces_at_edge) {
            edge.iter().for_each(|&v| is_border[v as usize] |= *faces == 1);
        }
        let bits = |edges: &[u32; 3]| (0..3).fold(0, |bits, k| bits | u8::from(is_single(edges[k])) << k);
        Self {
            component_of_vertex: topology.component_of_vertex.clone(),
            component_count: topology.component_count,
            is_border,
            border_edges: edges_of_faces.iter().map(bits).collect(),
        }
    }

    /// For every vertex 1 or −1: which side of its component looks away from the body, by a vote of its vertices. `outward`:
    /// the direction away from the body at a vertex, zero where unknown.
    pub(super) fn facing(
        &self,
        positions: &[[f64; 3]],
        faces: &[[u32; 3]],
        outward: impl Fn(usize) -> [f64; 3],
    ) -> Vec<f64> {
        let normals = vertex_normals(positions, faces);
        let mut votes = vec![0.0; self.component_count];
        for v in 0..positions.len() {
            votes[self.component_of_vertex[v] as usize] += dot(normals[v], outward(v));
        }
        self.component_of_vertex.iter().map(|&c| if votes[c as usize] < 0.0 { -1.0 } else { 1.0 }).collect()
    }
}

/// A garment in its present position, under others.
pub(super) struct InnerSurface<'a> {
    topology: &'a LayerTopology,
    closest: ClosestPoint,
    /// As of [`LayerTopology::facing`].
    facing: Vec<f64>,
    bounds: ([f64; 3], [f64; 3]),
}

impl<'a> InnerSurface<'a> {
    /// Of the garment of `tree`; `facing` as of [`LayerTopology::facing`].
    pub fn new(topology: &'a LayerTopology, tree: &TriangleTree<'_>, facing: Vec<f64>) -> Self {
        let closest = ClosestPoint::of_tree(tree, |_| true);
        Self { topology, closest, facing, bounds: bounds(tree.positions().iter().copied()) }
    }

    /// Height of `p` over the garment (m), negative under it, if it is within `reach` and `p` lies over or under the garment and
    /// not beside it.
    pub fn height(&self, p: [f64; 3], reach: f64) -> Option<f64> {
        let (low, high) = self.bounds;
        if !(0..3).all(|k| p[k] - reach <= high[k] && low[k] - reach <= p[k]) {
            return None;
        }
        let found = self.closest.project_within(p, reach)?;
        let face = self.closest.face(found.face);
        let normal = scale(found.normal, self.facing[face[0] as usize]);
        let offset = sub(p, found.position);
        let along = dot(offset, normal);
        if self.is_at_border(found.face, face, found.barycentric) {
            // Past the hem there is nothing to be over; right at it there is.
            let beside = norm(add_scaled(offset, -along, normal));
            return (beside <= 0.5 * along.abs()).then_some(along);
        }
        let distance = found.distance_squared.sqrt();
        Some(if along < 0.0 { -distance } else { distance })
    }

    fn is_at_border(&self, f: u32, face: [u32; 3], barycentric: [f64; 3]) -> bool {
        let LayerTopology { is_border, border_edges, .. } = self.topology;
        let zero: Vec<usize> = (0..3).filter(|&k| barycentric[k] <= 1e-9).collect();
        match zero[..] {
            [] => false,
            // On the edge opposite to corner k, which starts at corner k + 1.
            [k] => border_edges[f as usize] >> ((k + 1) % 3) & 1 == 1,
            _ => (0..3).any(|k| barycentric[k] > 0.5 && is_border[face[k] as usize]),
        }
    }
}
