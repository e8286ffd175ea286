//! A triangle mesh that has been checked once, so that nothing downstream has to.

use std::collections::HashMap;
use thiserror::Error;

use crate::vec3;

/// Why a mesh was refused. All indices are 0-based.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A mesh needs at least one face.
    #[error(
        "the mesh has no face; hint: check that the file holds triangles or quads and not only points or lines"
    )]
    NoFaces,

    /// A coordinate is NaN or infinite.
    #[error(
        "vertex {vertex} has the non-finite position [{}, {}, {}]; hint: repair or remove the vertex (indices count from 0)",
        position[0], position[1], position[2]
    )]
    NonFinitePosition {
        /// Index of the vertex.
        vertex: usize,
        /// What was found there.
        position: [f64; 3],
    },

    /// A face names a vertex that does not exist.
    #[error(
        "face {face} uses vertex {vertex}, but the mesh has only {vertex_count} vertices; hint: indices count from 0 \
         here and from 1 in OBJ files"
    )]
    IndexOutOfRange {
        /// Index of the face.
        face: usize,
        /// The index it asked for.
        vertex: u32,
        /// Number of vertices.
        vertex_count: usize,
    },

    /// A face names the same vertex more than once.
    #[error("face {face} uses vertex {vertex} twice; hint: remove collapsed faces from the mesh")]
    RepeatedVertex {
        /// Index of the face.
        face: usize,
        /// The repeated vertex.
        vertex: u32,
    },

    /// New positions do not fit the faces.
    #[error(
        "got {found} positions for a mesh of {expected} vertices; hint: both meshes must share one topology"
    )]
    VertexCountMismatch {
        /// Vertices of the mesh.
        expected: usize,
        /// Positions given.
        found: usize,
    },

    /// More vertices than a 32-bit index can name.
    #[error("the mesh has {vertex_count} vertices, more than a 32-bit index can name; hint: decimate it")]
    TooManyVertices {
        /// Number of vertices.
        vertex_count: usize,
    },
}

/// A triangle mesh: positions `[V, 3]` in metres and faces `[F, 3]`, counter-clockwise seen from outside.
///
/// Holds: at least one face; every position finite; every index in range; three different vertices per face. Zero-area
/// faces, non-manifold edges, flipped faces and unreferenced vertices are allowed; see [`crate::Topology`].
#[derive(Debug, Clone, PartialEq)]
pub struct TriMesh {
    positions: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
}

impl TriMesh {
    /// Checks and wraps a mesh.
    ///
    /// # Errors
    /// A [`MeshError`] that names the first offending vertex or face.
    pub fn new(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        let vertex_count = positions.len();
        if vertex_count > u32::MAX as usize {
            return Err(MeshError::TooManyVertices { vertex_count });
        }
        if faces.is_empty() {
            return Err(MeshError::NoFaces);
        }
        check_finite(&positions)?;
        for (face, &[a, b, c]) in faces.iter().enumerate() {
            if let Some(&vertex) = [a, b, c].iter().find(|&&v| v as usize >= vertex_count) {
                return Err(MeshError::IndexOutOfRange { face, vertex, vertex_count });
            }
            if a == b || a == c {
                return Err(MeshError::RepeatedVertex { face, vertex: a });
            }
            if b == c {
                return Err(MeshError::RepeatedVertex { face, vertex: b });
            }
        }
        Ok(Self { positions, faces })
    }

    /// The same faces over other positions (a drape, a pose).
    ///
    /// # Errors
    /// [`MeshError::VertexCountMismatch`] or [`MeshError::NonFinitePosition`].
    pub fn with_positions(&self, positions: Vec<[f64; 3]>) -> Result<Self, MeshError> {
        if positions.len() != self.positions.len() {
            return Err(MeshError::VertexCountMismatch {
                expected: self.positions.len(),
                found: positions.len(),
            });
        }
        check_finite(&positions)?;
        Ok(Self { positions, faces: self.faces.clone() })
    }

    /// Vertex positions `[V, 3]` (m).
    pub fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// Vertex indices of each face `[F, 3]`.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Number of vertices `V`, unreferenced ones included.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// Number of faces `F`.
    pub fn face_count(&self) -> usize {
        self.faces.len()
    }

    /// The first face with the vertices of an earlier one, in any order, and that one: cloth that lies on itself, which contact
    /// would keep apart.
    pub fn doubled_face(&self) -> Option<[u32; 2]> {
        let mut seen = HashMap::with_capacity(self.faces.len());
        self.faces.iter().zip(0..).find_map(|(face, number)| {
            let mut corners = *face;
            corners.sort_unstable();
            Some([number, seen.insert(corners, number)?])
        })
    }

    /// The three corners of face `face`.
    pub fn corners(&self, face: usize) -> [[f64; 3]; 3] {
        self.faces[face].map(|v| self.positions[v as usize])
    }

    /// Area of one face (m²).
    pub fn face_area(&self, face: usize) -> f64 {
        let [a, b, c] = self.corners(face);
        0.5 * vec3::norm(vec3::cross(vec3::sub(b, a), vec3::sub(c, a)))
    }

    /// Area of the mesh (m²).
    pub fn area(&self) -> f64 {
        (0..self.face_count()).map(|face| self.face_area(face)).sum()
    }

    /// Median length of the unique edges (m) (the upper one of the two middle values).
    pub fn median_edge_length(&self) -> f64 {
        let mut lengths: Vec<f64> = unique_edges(&self.faces)
            .into_iter()
            .map(|[a, b]| vec3::norm(vec3::sub(self.positions[a as usize], self.positions[b as usize])))
            .collect();
        let middle = lengths.len() / 2;
        *lengths.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// Longest side of the bounding box (m).
    pub fn extent(&self) -> f64 {
        let (low, high) = self.bounds();
        (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max)
    }

    /// The same mesh inside out: every face is turned over.
    pub fn turned(&self) -> Self {
        let faces = self.faces.iter().map(|&[a, b, c]| [a, c, b]).collect();
        Self { positions: self.positions.clone(), faces }
    }

    /// Smallest and largest coordinates over all vertices (m).
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        vec3::bounds(self.positions.iter().copied())
    }
}

/// The edges of `faces`, each once as `[low, high]`, sorted.
pub(super) fn unique_edges(faces: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = faces
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

fn check_finite(positions: &[[f64; 3]]) -> Result<(), MeshError> {
    match positions.iter().position(|p| !vec3::is_finite(*p)) {
        Some(vertex) => Err(MeshError::NonFinitePosition { vertex, position: positions[vertex] }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Vec<[f64; 3]> {
        vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
    }

    #[test]
    fn measures_of_a_rectangle() {
        let mesh = TriMesh::new(square(), vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        assert_eq!((mesh.vertex_count(), mesh.face_count()), (4, 2));
        assert!((mesh.area() - 2.0).abs() < 1e-15);
        assert_eq!(mesh.bounds(), ([0.0; 3], [2.0, 1.0, 0.0]));
        // Lengths 1, 1, 2, 2, √5.
        assert_eq!(mesh.median_edge_length(), 2.0);
    }

    #[test]
    fn refusals_name_the_element() {
        let nan = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, f64::NAN, 0.0]];
        let error = TriMesh::new(nan, vec![[0, 1, 2]]).unwrap_err();
        assert!(matches!(error, MeshError::NonFinitePosition { vertex: 2, .. }));
        assert!(error.to_string().contains("vertex 2"));

        assert_eq!(TriMesh::new(square(), vec![]), Err(MeshError::NoFaces));
        assert_eq!(
            TriMesh::new(square(), vec![[0, 1, 2], [0, 2, 4]]),
            Err(MeshError::IndexOutOfRange { face: 1, vertex: 4, vertex_count: 4 })
        );
        for (face, vertex) in [([1, 1, 2], 1), ([1, 2, 1], 1), ([1, 2, 2], 2)] {
            assert_eq!(
                TriMesh::new(square(), vec![[0, 1, 2], face]),
                Err(MeshError::RepeatedVertex { face: 1, vertex })
            );
        }

        let mesh = TriMesh::new(square(), vec![[0, 1, 2]]).unwrap();
        assert_eq!(
            mesh.with_positions(vec![[0.0; 3]]),
            Err(MeshError::VertexCountMismatch { expected: 4, found: 1 })
        );
        let mut moved = square();
        moved[3][2] = f64::INFINITY;
        assert!(matches!(mesh.with_positions(moved), Err(MeshError::NonFinitePosition { vertex: 3, .. })));
    }
}
