//! Least-squares gradients at vertices, as DiffusionNet defines them.

use crate::mesh::{Topology, TriMesh};
use crate::operators::{SparseMatrix, tangent_frames};
use crate::vec3;

/// The smaller eigenvalue of a vertex's normal matrix is raised to this share of the larger one.
const CONDITION_FLOOR: f64 = 1e-6;

/// The gradient as two sparse matrices `[V, V]`: `x.apply(f)` is the derivative of `f` along the first tangent axis of each
/// vertex, `y.apply(f)` along the second (1/m).
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceGradient {
    /// Derivative along [`super::TangentFrame::x`].
    pub x: SparseMatrix,
    /// Derivative along [`super::TangentFrame::y`].
    pub y: SparseMatrix,
}

/// Builds the gradient: at each vertex, `(AᵀA + εI)⁻¹Aᵀ` applied to the differences to its neighbours, where the rows of
/// `A` are the edges to them projected into the tangent plane.
///
/// DiffusionNet uses the absolute `ε = 10⁻⁵`. With edges of a centimetre `AᵀA` is about `10⁻⁴`, so that would damp the
/// gradient by several per cent and tie it to the unit of length. Here `ε` is relative and zero unless it is needed:
/// just large enough that the smaller eigenvalue of `AᵀA + εI` is at least 10⁻⁶ of the larger. A linear function on a
/// flat mesh has its exact gradient, and a vertex whose edges are collinear still has a bounded one. Unreferenced
/// vertices have empty rows.
pub fn surface_gradient(mesh: &TriMesh, topology: &Topology) -> SurfaceGradient {
    let vertex_count = mesh.vertex_count();
    let frames = tangent_frames(mesh);
    let mut x_entries = Vec::with_capacity(2 * topology.edges.len() + vertex_count);
    let mut y_entries = Vec::with_capacity(2 * topology.edges.len() + vertex_count);
    let mut edges: Vec<[f64; 2]> = Vec::new();
    for v in 0..vertex_count {
        let ring = topology.ring(v);
        let frame = &frames[v];
        edges.clear();
        edges.extend(ring.iter().map(|&u| {
            let edge = vec3::sub(mesh.positions()[u as usize], mesh.positions()[v]);
            [vec3::dot(edge, frame.x), vec3::dot(edge, frame.y)]
        }));
        let Some(inverse) = regularised_inverse(&edges) else { continue };
        let (mut sum_x, mut sum_y) = (0.0, 0.0);
        for (&u, &[ex, ey]) in ring.iter().zip(&edges) {
            let gx = inverse[0] * ex + inverse[1] * ey;
            let gy = inverse[1] * ex + inverse[2] * ey;
            x_entries.push((v as u32, u, gx));
            y_entries.push((v as u32, u, gy));
            sum_x += gx;
            sum_y += gy;
        }
        x_entries.push((v as u32, v as u32, -sum_x));
        y_entries.push((v as u32, v as u32, -sum_y));
    }
    SurfaceGradient {
        x: SparseMatrix::from_triplets(vertex_count, vertex_count, x_entries),
        y: SparseMatrix::from_triplets(vertex_count, vertex_count, y_entries),
    }
}

/// `(AᵀA + εI)⁻¹` as `[xx, xy, yy]`; `None` where all edges vanish.
fn regularised_inverse(edges: &[[f64; 2]]) -> Option<[f64; 3]> {
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for &[x, y] in edges {
        xx += x * x;
        xy += x * y;
        yy += y * y;
    }
    let centre = 0.5 * (xx + yy);
    let radius = (0.5 * (xx - yy)).hypot(xy);
    let (low, high) = (centre - radius, centre + radius);
    // The inverse of a smaller number than this would not be finite.
    if high < 1e-200 || !high.is_finite() {
        return None;
    }
    let epsilon = (CONDITION_FLOOR * high - low).max(0.0);
    let (xx, yy) = (xx + epsilon, yy + epsilon);
    let determinant = (low + epsilon) * (high + epsilon);
    Some([yy / determinant, -xy / determinant, xx / determinant])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn gradient_of_a_linear_function_on_a_flat_mesh_is_exact() {
        // Centimetre edges, irregular, turned out of every coordinate plane.
        let flat = shapes::irregular_grid(0.2, 0.3, 20, 30, 0.3, 11);
        let (s, c) = (0.6, 0.8);
        let mesh =
            shapes::mapped(&flat, |[x, y, _]| [c * x, 0.28 * s * x + 0.96 * y, 0.96 * s * x - 0.28 * y]);
        let slope = [1.3, -0.4, 2.1];
        let f: Vec<f64> = mesh.positions().iter().map(|p| vec3::dot(*p, slope)).collect();
        let gradient = surface_gradient(&mesh, &Topology::new(&mesh));
        let (gx, gy) = (gradient.x.apply(&f), gradient.y.apply(&f));
        for (v, frame) in tangent_frames(&mesh).iter().enumerate() {
            assert!((gx[v] - vec3::dot(slope, frame.x)).abs() < 1e-9);
            assert!((gy[v] - vec3::dot(slope, frame.y)).abs() < 1e-9);
        }
    }

    #[test]
    fn gradient_on_a_sphere_is_the_tangential_part() {
        let sphere = shapes::icosphere(1.0, 4);
        let slope = [0.2, -1.0, 0.7];
        let f: Vec<f64> = sphere.positions().iter().map(|p| vec3::dot(*p, slope)).collect();
        let gradient = surface_gradient(&sphere, &Topology::new(&sphere));
        let (gx, gy) = (gradient.x.apply(&f), gradient.y.apply(&f));
        for (v, frame) in tangent_frames(&sphere).iter().enumerate() {
            assert!((gx[v] - vec3::dot(slope, frame.x)).abs() < 2e-2);
            assert!((gy[v] - vec3::dot(slope, frame.y)).abs() < 2e-2);
        }
    }

    #[test]
    fn gradient_scales_with_the_unit_of_length() {
        let metres = shapes::irregular_grid(1.0, 1.0, 6, 6, 0.3, 1);
        let millimetres = shapes::mapped(&metres, |p| vec3::scale(p, 1e-3));
        let f: Vec<f64> = (0..metres.vertex_count()).map(|v| (v as f64).sin()).collect();
        let of = |mesh: &TriMesh| surface_gradient(mesh, &Topology::new(mesh)).x.apply(&f);
        for (coarse, fine) in of(&metres).iter().zip(of(&millimetres)) {
            assert!((coarse * 1e3 - fine).abs() <= 1e-9 * fine.abs().max(1.0));
        }
    }

    #[test]
    fn collinear_and_coincident_rings_stay_bounded() {
        let line = TriMesh::new(
            vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [5.0; 3], [5.0; 3], [5.0; 3], [7.0; 3]],
            vec![[0, 1, 2], [3, 4, 5]],
        )
        .unwrap();
        let gradient = surface_gradient(&line, &Topology::new(&line));
        let along = gradient.x.apply(&[0.0, 1.0, 2.0, 1.0, 2.0, 3.0, 9.0]);
        assert!((along[1] - 1.0).abs() < 1e-5);
        assert_eq!(along[3..], [0.0; 4]);
        assert!(gradient.y.apply(&[0.0, 1.0, 5.0, 0.0, 0.0, 0.0, 0.0]).iter().all(|g| g.abs() < 1e3));
    }
}
