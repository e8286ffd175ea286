//! The cotangent Laplacian.

use crate::mesh::TriMesh;
use crate::operators::SparseMatrix;
use crate::vec3;

/// The smallest area a face counts as, relative to its longest edge squared: a height of 2·10⁻⁴ of that edge.
///
/// A needle's cotangents grow without bound and would drown every other entry; with this floor they stay below 5,000.
const FACE_AREA_FLOOR: f64 = 1e-4;

/// The cotangent Laplacian `[V, V]`, positive semidefinite, dimensionless: `xᵀ L x = ∫ |∇x|²` for the piecewise linear `x`.
///
/// Each face contributes `G / 4A` with the Gram matrix `G_ij = e_i·e_j` of its edge vectors (`e_i` opposite corner `i`):
/// exactly the half cotangents off the diagonal. Because `G` is positive semidefinite and has zero row sums whatever the
/// shape, a floor under `A` alone (10⁻⁴ of the longest edge squared) makes needles and zero-area faces harmless and keeps
/// both properties. A face whose corners coincide contributes nothing. Unreferenced vertices have empty rows.
pub fn cotangent_laplacian(mesh: &TriMesh) -> SparseMatrix {
    let mut triplets = Vec::with_capacity(9 * mesh.face_count());
    for (face, corners) in mesh.faces().iter().enumerate() {
        let [a, b, c] = mesh.corners(face);
        let edges = [vec3::sub(c, b), vec3::sub(a, c), vec3::sub(b, a)];
        let longest_squared = edges.iter().map(|e| vec3::norm_squared(*e)).fold(0.0, f64::max);
        let area = mesh.face_area(face).max(FACE_AREA_FLOOR * longest_squared);
        if area < f64::MIN_POSITIVE {
            continue;
        }
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let weight = -vec3::dot(edges[i], edges[j]) / (4.0 * area);
            let (vi, vj) = (corners[i], corners[j]);
            triplets.extend([(vi, vj, -weight), (vj, vi, -weight), (vi, vi, weight), (vj, vj, weight)]);
        }
    }
    SparseMatrix::from_triplets(mesh.vertex_count(), mesh.vertex_count(), triplets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{self, SplitMix};

    fn hard_mesh() -> TriMesh {
        // Collinear, needle, and coincident corners beside healthy faces.
        let positions = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.4, 0.0, 0.0],
            [0.5, 1e-8, 0.0],
            [0.5, 0.8, 0.1],
            [0.5, 0.8, 0.1],
            [0.5, 0.8, 0.1],
        ];
        TriMesh::new(positions, vec![[0, 1, 2], [0, 3, 1], [0, 1, 4], [4, 5, 6], [1, 5, 4]]).unwrap()
    }

    #[test]
    fn constants_are_in_the_kernel() {
        for mesh in
            [shapes::icosphere(0.3, 3), shapes::irregular_grid(0.4, 0.4, 20, 20, 0.35, 2), hard_mesh()]
        {
            let laplacian = cotangent_laplacian(&mesh);
            let image = laplacian.apply(&vec![1.0; mesh.vertex_count()]);
            let largest = laplacian.values().iter().fold(0.0f64, |m, v| m.max(v.abs()));
            assert!(image.iter().all(|v| v.abs() < 1e-12 * largest.max(1.0)));
        }
    }

    #[test]
    fn symmetric_and_positive_semidefinite() {
        let mut random = SplitMix::new(5);
        for mesh in [shapes::irregular_grid(0.4, 0.4, 12, 12, 0.45, 2), hard_mesh()] {
            let laplacian = cotangent_laplacian(&mesh);
            for row in 0..laplacian.rows() {
                let (columns, values) = laplacian.row(row);
                for (&column, &value) in columns.iter().zip(values) {
                    assert!((laplacian.get(column as usize, row as u32) - value).abs() <= 1e-9 * value.abs());
                }
            }
            for _ in 0..200 {
                let x: Vec<f64> = (0..mesh.vertex_count()).map(|_| random.symmetric()).collect();
                let energy: f64 = laplacian.apply(&x).iter().zip(&x).map(|(l, x)| l * x).sum();
                assert!(energy >= -1e-12 && energy.is_finite());
            }
        }
    }

    #[test]
    fn entries_are_half_cotangents() {
        // An equilateral pair: cot 60° = 1/√3 on both sides of the shared edge.
        let height = 0.75f64.sqrt();
        let mesh = TriMesh::new(
            vec![[0.0; 3], [1.0, 0.0, 0.0], [0.5, height, 0.0], [0.5, -height, 0.0]],
            vec![[0, 1, 2], [1, 0, 3]],
        )
        .unwrap();
        let laplacian = cotangent_laplacian(&mesh);
        assert!((laplacian.get(0, 1) + 1.0 / 3f64.sqrt()).abs() < 1e-12);
        assert!((laplacian.get(0, 2) + 0.5 / 3f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn dirichlet_energy_of_a_linear_function_is_exact() {
        let mesh = shapes::irregular_grid(0.6, 0.5, 11, 9, 0.3, 7);
        let x: Vec<f64> = mesh.positions().iter().map(|p| 3.0 * p[0] - 4.0 * p[1]).collect();
        let laplacian = cotangent_laplacian(&mesh);
        let energy: f64 = laplacian.apply(&x).iter().zip(&x).map(|(l, x)| l * x).sum();
        assert!((energy - 25.0 * 0.3).abs() < 1e-10);
    }
}
