//! How much a mesh is stretched against its rest shape, for looking at.

use super::TriMesh;
use crate::vec3::{cross, dot, norm, scale, sub};

/// Largest stretch or compression `|σ − 1|` of the triangles around every vertex `[V]`, the mean over them weighted by their
/// rest area; σ are the principal stretches from the rest triangle to the deformed one. Triangles without rest area count
/// nothing, a vertex without others is 0.
///
/// `positions` `[V, 3]` (m) are the deformed vertices of `rest`.
pub fn vertex_stretch(rest: &TriMesh, positions: &[[f64; 3]]) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); rest.vertex_count()];
    for face in rest.faces() {
        let Some((area, stretch)) =
            triangle_stretch(face.map(|v| rest.positions()[v as usize]), face.map(|v| positions[v as usize]))
        else {
            continue;
        };
        for v in face {
            let (weight, sum) = &mut sums[*v as usize];
            *weight += area;
            *sum += area * stretch;
        }
    }
    sums.into_iter().map(|(weight, sum)| if weight > 0.0 { sum / weight } else { 0.0 }).collect()
}

/// Rest area and largest `|σ − 1|` of a triangle; `None` without area.
fn triangle_stretch(rest: [[f64; 3]; 3], now: [[f64; 3]; 3]) -> Option<(f64, f64)> {
    let (base, side) = (sub(rest[1], rest[0]), sub(rest[2], rest[0]));
    let length = norm(base);
    let doubled = norm(cross(base, side));
    if !(length > 0.0 && doubled > 1e-12 * length * length) {
        return None;
    }
    let (along, height) = (dot(side, base) / length, doubled / length);
    // Columns of the deformation gradient in the rest triangle's frame.
    let first = scale(sub(now[1], now[0]), 1.0 / length);
    let second = scale(sub(sub(now[2], now[0]), scale(first, along)), 1.0 / height);
    let (a, b, c) = (dot(first, first), dot(first, second), dot(second, second));
    let (mean, spread) = (0.5 * (a + c), (0.25 * (a - c).powi(2) + b * b).sqrt());
    let strains = [mean + spread, mean - spread].map(|squared| (squared.max(0.0).sqrt() - 1.0).abs());
    Some((0.5 * doubled, strains[0].max(strains[1])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::irregular_grid;

    #[test]
    fn a_known_affine_map_has_its_principal_stretches_everywhere_and_a_rotation_none() {
        let mesh = irregular_grid(0.3, 0.2, 6, 5, 0.3, 2);
        let mapped = |f: &dyn Fn([f64; 3]) -> [f64; 3]| -> Vec<f64> {
            vertex_stretch(&mesh, &mesh.positions().iter().map(|p| f(*p)).collect::<Vec<_>>())
        };
        let (sin, cos) = 0.7f64.sin_cos();
        let turn = |[x, y, z]: [f64; 3]| [cos * x - sin * z, y, sin * x + cos * z];
        assert!(mapped(&turn).iter().all(|s| *s < 1e-12));
        // The grid lies in one plane: find its two axes by what a stretch of each does.
        let flat = (0..3).find(|&a| mesh.positions().iter().all(|p| p[a] == mesh.positions()[0][a])).unwrap();
        let (u, v) = ((flat + 1) % 3, (flat + 2) % 3);
        let stretched = |p: [f64; 3]| {
            let mut q = p;
            q[u] = 1.3 * p[u];
            q[v] = 0.9 * p[v];
            turn(q)
        };
        assert!(mapped(&stretched).iter().all(|s| (s - 0.3).abs() < 1e-12));
        assert!(mapped(&|_| [0.0; 3]).iter().all(|s| (s - 1.0).abs() < 1e-12));
    }
}
