//! Points that follow a sheet: the inner side of thick cloth, a button.

use clothcombo_physics::mesh::vertex_normals;
use clothcombo_physics::query::ClosestPoint;
use clothcombo_physics::vec3::{add, add_scaled, cross, dot, normalized, scale, sub};
use rayon::prelude::*;

/// Where a point is, seen from the nearest point of a sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment {
    /// Vertices of the face the nearest point lies on.
    pub corners: [u32; 3],
    /// Its barycentric coordinates there.
    pub weights: [f64; 3],
    /// From it to the point, along the sheet's normal there, along the face's first edge, and across both (in the unit of the
    /// positions).
    pub offset: [f64; 3],
}

impl Attachment {
    /// A vertex of the sheet itself.
    pub fn to_vertex(vertex: u32) -> Self {
        Self { corners: [vertex; 3], weights: [1.0, 0.0, 0.0], offset: [0.0; 3] }
    }

    /// The same in a unit of which one is `factor` of the old ones.
    pub fn scaled(self, factor: f64) -> Self {
        Self { offset: scale(self.offset, factor), ..self }
    }

    /// Where the point is on a sheet at `positions` with these unit vertex `normals`.
    pub fn position(&self, positions: &[[f64; 3]], normals: &[[f64; 3]]) -> [f64; 3] {
        if self.weights[0] == 1.0 && self.offset == [0.0; 3] {
            return positions[self.corners[0] as usize];
        }
        let foot = blend(self.corners, self.weights, positions);
        if self.offset == [0.0; 3] {
            return foot;
        }
        let axes = frame(self.corners, self.weights, positions, normals);
        axes.iter().zip(self.offset).fold(foot, |p, (axis, length)| add_scaled(p, length, *axis))
    }
}

/// Attaches points to the sheet of `faces`; `None` if it has no face, or a point is not finite.
pub fn attach(points: &[[f64; 3]], positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Option<Vec<Attachment>> {
    let surface = ClosestPoint::new(positions.to_vec(), faces);
    let normals = vertex_normals(positions, faces);
    let attached = points.par_iter().map(|p| {
        let foot = surface.project(*p)?;
        let (corners, weights) = (faces[foot.face as usize], foot.barycentric);
        let from = sub(*p, foot.position);
        let offset = frame(corners, weights, positions, &normals).map(|axis| dot(from, axis));
        Some(Attachment { corners, weights, offset })
    });
    attached.collect()
}

fn blend(corners: [u32; 3], weights: [f64; 3], values: &[[f64; 3]]) -> [f64; 3] {
    let [a, b, c] = corners.map(|v| values[v as usize]);
    add(add(scale(a, weights[0]), scale(b, weights[1])), scale(c, weights[2]))
}

/// Orthonormal axes: the blended normal, the first edge, and across both.
fn frame(
    corners: [u32; 3],
    weights: [f64; 3],
    positions: &[[f64; 3]],
    normals: &[[f64; 3]],
) -> [[f64; 3]; 3] {
    let [a, b, c] = corners.map(|v| positions[v as usize]);
    let blended = normalized(blend(corners, weights, normals));
    // Normals that cancel each other leave the face's own.
    let normal = if blended == [0.0; 3] { normalized(cross(sub(b, a), sub(c, a))) } else { blended };
    let edge = sub(b, a);
    let tangent = normalized(add_scaled(edge, -dot(edge, normal), normal));
    [normal, tangent, cross(normal, tangent)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::rotation;
    use clothcombo_physics::mesh::shapes::tube;
    use clothcombo_physics::vec3::norm;

    #[test]
    fn attached_points_turn_with_the_sheet() {
        let mesh = tube(0.2, 0.3, 24, 6);
        let points: Vec<[f64; 3]> =
            mesh.positions().iter().map(|[x, y, z]| [0.97 * x, y + 0.003, 0.98 * z]).collect();
        let attached = attach(&points, mesh.positions(), mesh.faces()).unwrap();
        let turn = rotation::matrix_from_axis_angle([0.3, -0.5, 0.8]);
        for place in [rotation::IDENTITY, turn] {
            let moved: Vec<[f64; 3]> = mesh.positions().iter().map(|p| rotation::apply(&place, *p)).collect();
            let normals = vertex_normals(&moved, mesh.faces());
            for (p, a) in points.iter().zip(&attached) {
                let error = norm(sub(a.position(&moved, &normals), rotation::apply(&place, *p)));
                assert!(error < 1e-12, "{error}");
            }
        }
        assert_eq!(Attachment::to_vertex(5).position(mesh.positions(), &[]), mesh.positions()[5]);
    }
}
