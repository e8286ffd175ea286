//! The lumped mass matrix.

use crate::mesh::TriMesh;

/// Lumped barycentric vertex areas `[V]` (m²): a third of each incident face. Their sum is the area of the mesh.
///
/// A vertex without a face, or with only zero-area faces, has mass zero. Sums weighted by it need no special case; the
/// eigenvalue problem alone puts a floor under it (see [`super::eigenbasis()`]).
pub fn lumped_mass(mesh: &TriMesh) -> Vec<f64> {
    let mut mass = vec![0.0; mesh.vertex_count()];
    for (face, corners) in mesh.faces().iter().enumerate() {
        let share = mesh.face_area(face) / 3.0;
        for &vertex in corners {
            mass[vertex as usize] += share;
        }
    }
    mass
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn masses_sum_to_the_area() {
        for mesh in [
            shapes::icosphere(0.7, 3),
            shapes::irregular_grid(0.5, 0.9, 13, 8, 0.35, 1),
            shapes::tube(0.2, 0.6, 17, 9),
        ] {
            let total: f64 = lumped_mass(&mesh).iter().sum();
            assert!((total / mesh.area() - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn unreferenced_vertices_weigh_nothing() {
        let mesh = TriMesh::new(vec![[7.0; 3], [0.0; 3], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0]], vec![[1, 2, 3]])
            .unwrap();
        assert_eq!(lumped_mass(&mesh), [0.0, 1.0, 1.0, 1.0]);
    }
}
