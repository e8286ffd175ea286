//! What a mesh is like: counts, edge lengths, defects.

use super::clean::{AREA_SHARE, WELD_SHARE, clean_faces, diagonal, weld};
use clothcombo_physics::vec3::{norm, sub};
use clothcombo_physics::{Topology, TriMesh};
use serde::Serialize;

/// Counts, edge lengths and defects of a triangle mesh; defects name their elements, counted from 0.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MeshMeasures {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Connected components, isolated vertices left out.
    pub components: usize,
    /// Boundary curves.
    pub boundary_loops: usize,
    /// Median edge length (mm).
    pub edge_median_mm: f64,
    /// Shortest edge (mm).
    pub edge_min_mm: f64,
    /// Longest edge (mm).
    pub edge_max_mm: f64,
    /// What is wrong with it.
    pub defects: MeshDefects,
}

/// Defects of a triangle mesh; vertices, edges and triangles by their 0-based numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MeshDefects {
    /// Edges with three or more triangles.
    pub non_manifold_edges: Vec<[u32; 2]>,
    /// Edges through which both triangles run in one direction, so that one of them faces inward.
    pub flipped_edges: Vec<[u32; 2]>,
    /// Triangles without area.
    pub degenerate_triangles: Vec<u32>,
    /// Triangles with the vertices of an earlier one.
    pub doubled_triangles: Vec<u32>,
    /// Vertices at the place of an earlier one (within 10⁻⁵ of the diagonal).
    pub duplicate_vertices: Vec<u32>,
    /// Vertices of no triangle.
    pub isolated_vertices: Vec<u32>,
}

impl MeshDefects {
    /// Number of each kind that occurs, with its name.
    pub fn counts(&self) -> Vec<(usize, &'static str)> {
        [
            (self.non_manifold_edges.len(), "non-manifold edges"),
            (self.flipped_edges.len(), "flipped edges"),
            (self.degenerate_triangles.len(), "degenerate triangles"),
            (self.doubled_triangles.len(), "doubled triangles"),
            (self.duplicate_vertices.len(), "duplicate vertices"),
            (self.isolated_vertices.len(), "isolated vertices"),
        ]
        .into_iter()
        .filter(|(n, _)| *n > 0)
        .collect()
    }
}

impl MeshMeasures {
    /// Measures a mesh in metres.
    pub fn new(mesh: &TriMesh, topology: &Topology) -> Self {
        let positions = mesh.positions();
        let mut lengths: Vec<f64> = topology
            .edges
            .iter()
            .map(|[a, b]| 1e3 * norm(sub(positions[*a as usize], positions[*b as usize])))
            .collect();
        lengths.sort_by(f64::total_cmp);
        let diagonal = diagonal(positions);
        let clean = clean_faces(positions, mesh.faces(), AREA_SHARE * diagonal * diagonal);
        let duplicate_vertices =
            if diagonal > 0.0 { weld(positions, WELD_SHARE * diagonal).merged } else { Vec::new() };
        let flipped_edges = topology
            .hinges
            .iter()
            .filter(|h| {
                let other = mesh.faces()[h.faces[1] as usize];
                (0..3).any(|i| [other[i], other[(i + 1) % 3]] == h.edge)
            })
            .map(|h| h.edge)
            .collect();
        Self {
            vertices: mesh.vertex_count(),
            triangles: mesh.face_count(),
            components: topology.component_count - topology.unreferenced.len(),
            boundary_loops: topology.boundary_loops.len(),
            edge_median_mm: lengths.get(lengths.len() / 2).copied().unwrap_or(0.0),
            edge_min_mm: lengths.first().copied().unwrap_or(0.0),
            edge_max_mm: lengths.last().copied().unwrap_or(0.0),
            defects: MeshDefects {
                non_manifold_edges: topology.non_manifold_edges.clone(),
                flipped_edges,
                degenerate_triangles: clean.degenerate,
                doubled_triangles: clean.repeated,
                duplicate_vertices,
                isolated_vertices: topology.unreferenced.clone(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_physics::mesh::shapes::grid;

    #[test]
    fn every_defect_is_found_and_a_clean_grid_has_none() {
        let mesh = grid(0.3, 0.2, 3, 2);
        let clean = MeshMeasures::new(&mesh, &Topology::new(&mesh));
        assert!(clean.defects.counts().is_empty(), "{:?}", clean.defects);
        assert_eq!((clean.vertices, clean.triangles, clean.components, clean.boundary_loops), (12, 12, 1, 1));
        assert!((clean.edge_min_mm - 100.0).abs() < 1e-9 && (clean.edge_max_mm - 141.42).abs() < 0.01);

        let mut positions = mesh.positions().to_vec();
        let mut faces = mesh.faces().to_vec();
        faces[2].swap(0, 1);
        // A fin on the first interior edge, with a vertex at the place of vertex 0; an isolated vertex; a flat face.
        let hinge = Topology::new(&mesh).hinges[0].edge;
        positions.push(positions[0]);
        positions.push([0.0, 0.0, 1.0]);
        let fin = positions.len() as u32 - 1;
        faces.push([hinge[0], hinge[1], fin]);
        positions.push([5.0, 0.0, 0.0]);
        positions.extend([[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0]]);
        let n = positions.len() as u32;
        faces.push([n - 3, n - 2, n - 1]);
        let [a, b, c] = faces[5];
        faces.push([c, b, a]);
        let broken = TriMesh::new(positions, faces).unwrap();
        let defects = MeshMeasures::new(&broken, &Topology::new(&broken)).defects;
        // The fin's, and the three of the doubled face.
        assert_eq!(defects.non_manifold_edges.len(), 4);
        assert!(!defects.flipped_edges.is_empty());
        assert_eq!(defects.degenerate_triangles, [13]);
        assert_eq!(defects.doubled_triangles, [14]);
        assert_eq!(defects.duplicate_vertices, [12]);
        assert_eq!(defects.isolated_vertices, [12, 14]);
        assert_eq!(defects.counts().len(), 6);
    }
}
