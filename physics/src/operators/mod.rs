//! The surface operators that DiffusionNet is built on (Sharp et al., "DiffusionNet: Discretization Agnostic Learning on
//! Surfaces", ACM TOG 2022), computed once per garment in `f64`.

pub(crate) mod cholesky;
mod eigenbasis;
mod error;
mod frames;
mod gradient;
mod lanczos;
mod laplacian;
mod mass;
mod sparse;

use crate::mesh::{Topology, TriMesh};
use crate::vec3;

pub use eigenbasis::{Eigenbasis, eigenbasis};
pub use error::OperatorError;
pub use frames::{TangentFrame, tangent_frames};
pub use gradient::{SurfaceGradient, surface_gradient};
pub use laplacian::cotangent_laplacian;
pub use mass::lumped_mass;
pub use sparse::SparseMatrix;

/// What a DiffusionNet needs to know of a surface of `V` vertices, with `k` eigenvectors.
///
/// Spectral diffusion gives `x_diff = Φ c` with `c = e^{−λt} ⊙ (Φᵀ M x)`, hence `∇x_diff = (G_xΦ) c, (G_yΦ) c`: with the two
/// products precomputed dense, a network needs no sparse matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceOperators {
    /// Number of vertices `V`.
    pub vertex_count: usize,
    /// Number of eigenvector columns `k`: what was asked for, whatever the mesh can give.
    pub eigen_count: usize,
    /// Lumped barycentric vertex areas `[V]` (m²); zero for a vertex without a face.
    pub mass: Vec<f64>,
    /// Eigenvalues `[k]` (1/m²), ascending; zero in padded columns.
    pub eigenvalues: Vec<f64>,
    /// Φ: mass-orthonormal eigenvectors `[V, k]` row-major (1/m); padded columns and rows of unreferenced vertices are zero.
    pub eigenvectors: Vec<f32>,
    /// `G_x Φ` `[V, k]` row-major (1/m²): derivative of each eigenvector along the first tangent axis of each vertex.
    pub gradient_x_basis: Vec<f32>,
    /// `G_y Φ` `[V, k]` row-major (1/m²), along the second tangent axis.
    pub gradient_y_basis: Vec<f32>,
}

impl SurfaceOperators {
    /// Computes all operators of a mesh. Deterministic, single-threaded.
    ///
    /// # Errors
    /// [`OperatorError`] if the mesh has no area, sizes overflow, or the eigenvalue iteration fails.
    pub fn new(mesh: &TriMesh, eigen_count: usize) -> Result<Self, OperatorError> {
        let topology = Topology::new(mesh);
        let mass = lumped_mass(mesh);
        let laplacian = cotangent_laplacian(mesh);
        check_sizes(mesh, &mass)?;
        let basis = eigenbasis(&laplacian, &mass, eigen_count)?;
        let gradient = surface_gradient(mesh, &topology);
        Ok(Self {
            vertex_count: mesh.vertex_count(),
            eigen_count,
            gradient_x_basis: to_f32(&gradient.x.apply_columns(&basis.vectors, eigen_count)),
            gradient_y_basis: to_f32(&gradient.y.apply_columns(&basis.vectors, eigen_count)),
            eigenvectors: to_f32(&basis.vectors),
            eigenvalues: basis.values,
            mass,
        })
    }
}

/// Areas and squared lengths must be finite, and their sum far enough from zero to divide by.
fn check_sizes(mesh: &TriMesh, mass: &[f64]) -> Result<(), OperatorError> {
    for face in 0..mesh.face_count() {
        let [a, b, c] = mesh.corners(face);
        let lengths = [(a, b), (b, c), (c, a)].map(|(p, q)| vec3::distance_squared(p, q));
        if !mesh.face_area(face).is_finite() || lengths.iter().any(|l| !l.is_finite()) {
            return Err(OperatorError::NotFinite { face });
        }
    }
    if mass.iter().sum::<f64>() < 1e-200 {
        return Err(OperatorError::NoArea { faces: mesh.face_count() });
    }
    Ok(())
}

fn to_f32(values: &[f64]) -> Vec<f32> {
    values.iter().map(|&v| v as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn shapes_and_padding() {
        let mesh = shapes::tetrahedron();
        let operators = SurfaceOperators::new(&mesh, 6).unwrap();
        assert_eq!((operators.vertex_count, operators.eigen_count), (4, 6));
        assert_eq!(operators.eigenvalues.len(), 6);
        for dense in [&operators.eigenvectors, &operators.gradient_x_basis, &operators.gradient_y_basis] {
            assert_eq!(dense.len(), 24);
            assert!(dense.chunks(6).all(|row| row[4] == 0.0 && row[5] == 0.0));
            assert!(dense.iter().all(|v| v.is_finite()));
        }
    }

    #[test]
    fn gradient_products_are_the_sparse_gradients_of_the_basis() {
        let mesh = shapes::irregular_grid(0.3, 0.5, 9, 14, 0.3, 3);
        let operators = SurfaceOperators::new(&mesh, 12).unwrap();
        let gradient = surface_gradient(&mesh, &Topology::new(&mesh));
        for j in 0..12 {
            let column: Vec<f64> =
                (0..mesh.vertex_count()).map(|v| f64::from(operators.eigenvectors[v * 12 + j])).collect();
            for (plain, fused) in [
                (gradient.x.apply(&column), &operators.gradient_x_basis),
                (gradient.y.apply(&column), &operators.gradient_y_basis),
            ] {
                let largest = plain.iter().fold(1.0f64, |m, v| m.max(v.abs()));
                for v in 0..mesh.vertex_count() {
                    assert!((plain[v] - f64::from(fused[v * 12 + j])).abs() < 1e-5 * largest);
                }
            }
        }
    }

    #[test]
    fn collapsed_mesh_is_a_typed_error() {
        let line = TriMesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], vec![[0, 1, 2]]).unwrap();
        assert_eq!(SurfaceOperators::new(&line, 3), Err(OperatorError::NoArea { faces: 1 }));
        let huge =
            TriMesh::new(vec![[0.0; 3], [1e200, 0.0, 0.0], [0.0, 1e200, 0.0]], vec![[0, 1, 2]]).unwrap();
        assert_eq!(SurfaceOperators::new(&huge, 3), Err(OperatorError::NotFinite { face: 0 }));
    }

    #[test]
    fn hard_meshes_give_finite_operators() {
        // A zero-area face, a needle, an unreferenced vertex, a non-manifold edge and a flipped face, in one mesh.
        let positions = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.5, 0.0, 0.0],
            [0.5, 1e-9, 0.3],
            [9.0, 9.0, 9.0],
            [0.5, 0.5, 1.0],
        ];
        let faces = vec![[0, 1, 2], [2, 1, 3], [0, 4, 1], [4, 5, 1], [1, 2, 7], [2, 3, 7]];
        let mesh = TriMesh::new(positions, faces).unwrap();
        let operators = SurfaceOperators::new(&mesh, 8).unwrap();
        for dense in [&operators.eigenvectors, &operators.gradient_x_basis, &operators.gradient_y_basis] {
            assert!(dense.iter().all(|v| v.is_finite()));
            assert!(dense[6 * 8..7 * 8].iter().all(|v| *v == 0.0), "an unreferenced vertex takes no part");
        }
        assert_eq!(operators.mass[6], 0.0);
        assert!(operators.eigenvalues.iter().all(|v| v.is_finite() && *v >= 0.0));
    }
}
