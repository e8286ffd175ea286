//! Combinatorics of a triangle mesh: edges, hinges, one-rings, boundaries, components.

use std::collections::HashMap;

use crate::mesh::tri_mesh::unique_edges;
use crate::mesh::{DisjointSets, TriMesh};
use crate::rows::CompressedRows;

/// An interior edge with the two triangles that fold about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hinge {
    /// The edge, oriented as in `faces[0]`.
    pub edge: [u32; 2],
    /// The vertex of `faces[0]` and of `faces[1]` that is not on the edge.
    pub opposite: [u32; 2],
    /// The two incident faces, ascending.
    pub faces: [u32; 2],
}

/// Everything about a mesh that its positions do not change.
///
/// Never fails on a valid [`TriMesh`]: an edge with three or more faces is listed in `non_manifold_edges` and makes no
/// hinge; two faces of opposite orientation still make one.
#[derive(Debug, Clone)]
pub struct Topology {
    /// Unique edges `[low, high]`, sorted.
    pub edges: Vec<[u32; 2]>,
    /// One hinge per edge with exactly two faces, in the order of `edges`.
    pub hinges: Vec<Hinge>,
    /// Edges with one face, chained into loops (without repeating the first vertex).
    ///
    /// A loop follows the orientation of its faces and starts at its lowest vertex; loops are ordered by that vertex. Where
    /// faces are flipped or the boundary touches itself, chains are still complete and disjoint in edges, but may be open or
    /// pass a vertex twice.
    pub boundary_loops: Vec<Vec<u32>>,
    /// Connected component of each vertex `[V]`, numbered by the lowest vertex; an unreferenced vertex is a component of its
    /// own.
    pub component_of_vertex: Vec<u32>,
    /// Number of components.
    pub component_count: usize,
    /// Vertices that no face uses, ascending.
    pub unreferenced: Vec<u32>,
    /// Edges with three or more faces, sorted.
    pub non_manifold_edges: Vec<[u32; 2]>,
    rings: CompressedRows<u32>,
}

impl Topology {
    /// Analyses a mesh in O(F log F).
    pub fn new(mesh: &TriMesh) -> Self {
        let vertex_count = mesh.vertex_count();
        let faces = mesh.faces();
        let edges = unique_edges(faces);
        let (hinges, boundary, non_manifold_edges) = classify_edges(faces);
        let rings = one_rings(vertex_count, &edges);
        let (component_of_vertex, component_count) = components(vertex_count, &edges);
        let unreferenced = (0..vertex_count as u32).filter(|&v| rings.row(v as usize).is_empty()).collect();
        Self {
            edges,
            hinges,
            boundary_loops: chain_boundary(&boundary),
            component_of_vertex,
            component_count,
            unreferenced,
            non_manifold_edges,
            rings,
        }
    }

    /// Neighbours of vertex `v` along edges, ascending.
    pub fn ring(&self, v: usize) -> &[u32] {
        self.rings.row(v)
    }

    /// Number of vertices, unreferenced ones included.
    pub fn vertex_count(&self) -> usize {
        self.component_of_vertex.len()
    }
}

/// Sorts the half-edges and returns hinges, directed boundary edges and non-manifold edges, each in edge order.
fn classify_edges(faces: &[[u32; 3]]) -> (Vec<Hinge>, Vec<[u32; 2]>, Vec<[u32; 2]>) {
    struct HalfEdge {
        key: [u32; 2],
        face: u32,
        from: u32,
        to: u32,
        opposite: u32,
    }
    let mut half_edges = Vec::with_capacity(3 * faces.len());
    for (face, &[a, b, c]) in faces.iter().enumerate() {
        for (from, to, opposite) in [(a, b, c), (b, c, a), (c, a, b)] {
            half_edges.push(HalfEdge {
                key: [from.min(to), from.max(to)],
                face: face as u32,
                from,
                to,
                opposite,
            });
        }
    }
    half_edges.sort_unstable_by_key(|h| (h.key, h.face));

    let (mut hinges, mut boundary, mut non_manifold) = (Vec::new(), Vec::new(), Vec::new());
    for group in half_edges.chunk_by(|a, b| a.key == b.key) {
        match group {
            [only] => boundary.push([only.from, only.to]),
            [first, second] => hinges.push(Hinge {
                edge: [first.from, first.to],
                opposite: [first.opposite, second.opposite],
                faces: [first.face, second.face],
            }),
            more => non_manifold.push(more[0].key),
        }
    }
    (hinges, boundary, non_manifold)
}

/// Neighbours of every vertex, each row ascending. `edges` must be sorted and unique.
fn one_rings(vertex_count: usize, edges: &[[u32; 2]]) -> CompressedRows<u32> {
    // Lower neighbours first (edges sorted by their low end, then high), then higher ones: each row ends up ascending.
    let lower = edges.iter().map(|&[low, high]| (high as usize, low));
    let higher = edges.iter().map(|&[low, high]| (low as usize, high));
    CompressedRows::grouped(vertex_count, lower.chain(higher))
}

/// Components numbered in the order of their lowest vertices.
fn components(vertex_count: usize, edges: &[[u32; 2]]) -> (Vec<u32>, usize) {
    let mut sets = DisjointSets::new(vertex_count);
    edges.iter().for_each(|&[a, b]| sets.join(a, b));
    let mut component = vec![0u32; vertex_count];
    let mut count = 0;
    for v in 0..vertex_count {
        let r = sets.root(v as u32) as usize;
        if r == v {
            component[v] = count;
            count += 1;
        } else {
            component[v] = component[r];
        }
    }
    (component, count as usize)
}

/// Chains directed boundary edges. Each edge is used exactly once, so this ends on any input.
fn chain_boundary(boundary: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut outgoing: HashMap<u32, Vec<usize>> = HashMap::new();
    let mut incoming: HashMap<u32, usize> = HashMap::new();
    for (index, &[from, to]) in boundary.iter().enumerate() {
        outgoing.entry(from).or_default().push(index);
        *incoming.entry(to).or_default() += 1;
    }
    for indices in outgoing.values_mut() {
        // Popped from the end: the edge to the lowest vertex goes first.
        indices.sort_unstable_by_key(|&i| std::cmp::Reverse(boundary[i][1]));
    }
    // Open chains exist only where faces are flipped; they must start at a vertex with a surplus of outgoing edges, or they
    // would be cut in two.
    let mut starts: Vec<u32> = outgoing.keys().copied().collect();
    starts.sort_unstable_by_key(|v| {
        let surplus = outgoing[v].len() > incoming.get(v).copied().unwrap_or(0);
        (!surplus, *v)
    });
    let mut loops = Vec::new();
    for start in starts {
        while outgoing.get(&start).is_some_and(|edges| !edges.is_empty()) {
            let mut chain = vec![start];
            let mut at = start;
            while let Some(edge) = outgoing.get_mut(&at).and_then(Vec::pop) {
                at = boundary[edge][1];
                if at == start {
                    break;
                }
                chain.push(at);
            }
            if at == start {
                let lowest = (0..chain.len()).min_by_key(|&i| chain[i]).unwrap_or(0);
                chain.rotate_left(lowest);
            }
            loops.push(chain);
        }
    }
    loops.sort_by_key(|chain| chain.iter().copied().min());
    loops
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn mesh(vertex_count: usize, faces: &[[u32; 3]]) -> TriMesh {
        let positions =
            (0..vertex_count).map(|i| [i as f64, (i * i % 7) as f64, (i * 3 % 5) as f64]).collect();
        TriMesh::new(positions, faces.to_vec()).unwrap()
    }

    #[test]
    fn closed_mesh_satisfies_euler() {
        let sphere = shapes::icosphere(1.0, 2);
        let topology = Topology::new(&sphere);
        let euler = sphere.vertex_count() as i64 - topology.edges.len() as i64 + sphere.face_count() as i64;
        assert_eq!(euler, 2);
        assert_eq!(topology.hinges.len(), topology.edges.len());
        assert!(topology.boundary_loops.is_empty() && topology.unreferenced.is_empty());
        assert_eq!(topology.component_count, 1);
    }

    #[test]
    fn hinge_is_oriented_as_in_its_first_face() {
        let topology = Topology::new(&mesh(4, &[[0, 1, 2], [2, 1, 3]]));
        assert_eq!(topology.hinges, [Hinge { edge: [1, 2], opposite: [0, 3], faces: [0, 1] }]);
        // The second face flipped: still a hinge.
        let flipped = Topology::new(&mesh(4, &[[0, 1, 2], [1, 2, 3]]));
        assert_eq!(flipped.hinges, [Hinge { edge: [1, 2], opposite: [0, 3], faces: [0, 1] }]);
    }

    #[test]
    fn boundary_of_a_grid_is_one_ordered_loop() {
        let topology = Topology::new(&shapes::grid(1.0, 1.0, 2, 2));
        assert_eq!(topology.boundary_loops, [vec![0, 1, 2, 5, 8, 7, 6, 3]]);
    }

    #[test]
    fn tube_has_two_loops_that_follow_edges() {
        let tube = shapes::tube(0.2, 0.5, 9, 4);
        let topology = Topology::new(&tube);
        assert_eq!(topology.boundary_loops.iter().map(Vec::len).collect::<Vec<_>>(), [9, 9]);
        for chain in &topology.boundary_loops {
            for i in 0..chain.len() {
                assert!(topology.ring(chain[i] as usize).contains(&chain[(i + 1) % chain.len()]));
            }
        }
    }

    #[test]
    fn rings_are_sorted_and_symmetric() {
        let topology = Topology::new(&shapes::icosphere(1.0, 2));
        for v in 0..topology.vertex_count() {
            let ring = topology.ring(v);
            assert!(ring.windows(2).all(|w| w[0] < w[1]));
            assert!(ring.iter().all(|&u| topology.ring(u as usize).contains(&(v as u32))));
            assert!(!ring.contains(&(v as u32)));
        }
    }

    #[test]
    fn non_manifold_edge_makes_no_hinge_and_everything_terminates() {
        // Three pages of a book about edge 0–1.
        let topology = Topology::new(&mesh(5, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]));
        assert_eq!(topology.non_manifold_edges, [[0, 1]]);
        assert!(topology.hinges.is_empty());
        let used: usize = topology.boundary_loops.iter().map(Vec::len).sum();
        // Six boundary edges; an open chain has one vertex more than edges.
        assert!((6..=12).contains(&used));
        assert_eq!(topology.component_count, 1);
    }

    #[test]
    fn bow_tie_boundary_uses_every_edge_once() {
        let topology = Topology::new(&mesh(5, &[[0, 1, 2], [0, 3, 4]]));
        assert_eq!(topology.boundary_loops, [vec![0, 1, 2], vec![0, 3, 4]]);
    }

    #[test]
    fn components_and_unreferenced_vertices() {
        let topology = Topology::new(&mesh(8, &[[4, 5, 6], [0, 2, 3]]));
        assert_eq!(topology.unreferenced, [1, 7]);
        assert_eq!(topology.component_of_vertex, [0, 1, 0, 0, 2, 2, 2, 3]);
        assert_eq!(topology.component_count, 4);
        assert!(topology.ring(1).is_empty());
    }

    #[test]
    fn flipped_faces_do_not_hang_the_boundary() {
        let grid = shapes::grid(1.0, 1.0, 6, 6);
        let faces: Vec<[u32; 3]> = grid
            .faces()
            .iter()
            .enumerate()
            .map(|(i, &[a, b, c])| if i % 3 == 0 { [a, c, b] } else { [a, b, c] })
            .collect();
        let topology = Topology::new(&TriMesh::new(grid.positions().to_vec(), faces).unwrap());
        assert_eq!(topology.hinges.len() + 24, topology.edges.len());
        let mut seen: Vec<u32> = topology.boundary_loops.concat();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 24);
    }
}
