//! Normals of vertices.

use crate::real::Real;
use crate::vec3;

/// Area-weighted vertex normals, unit length; zero where undefined (unreferenced vertex, faces that cancel).
///
/// `positions` is `[V, 3]` in metres and `faces` `[F, 3]` with every index below `V`. The sum over the faces of a vertex
/// runs in face order, so the result is the same on every machine and for any thread count.
pub fn vertex_normals<T: Real>(positions: &[[T; 3]], faces: &[[u32; 3]]) -> Vec<[T; 3]> {
    let mut normals = vec![vec3::zero(); positions.len()];
    for &[a, b, c] in faces {
        let origin = positions[a as usize];
        let doubled =
            vec3::cross(vec3::sub(positions[b as usize], origin), vec3::sub(positions[c as usize], origin));
        for vertex in [a, b, c] {
            vec3::accumulate(&mut normals[vertex as usize], doubled);
        }
    }
    for normal in &mut normals {
        *normal = vec3::normalized(*normal);
    }
    normals
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn sphere_normals_are_radial() {
        let sphere = shapes::icosphere(1.0, 3);
        let normals = vertex_normals(sphere.positions(), sphere.faces());
        for (normal, position) in normals.iter().zip(sphere.positions()) {
            assert!(vec3::dot(*normal, *position) > 0.999);
            assert!((vec3::norm(*normal) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn undefined_normals_are_zero() {
        let positions = [[0.0f64; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0, 5.0, 5.0]];
        // The same triangle seen from both sides: the sum cancels; vertex 3 has no face.
        let normals = vertex_normals(&positions, &[[0, 1, 2], [0, 2, 1]]);
        assert!(normals.iter().all(|n| *n == [0.0; 3]));
    }
}
