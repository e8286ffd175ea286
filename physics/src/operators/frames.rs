//! Tangent frames at vertices.

use crate::mesh::{TriMesh, vertex_normals};
use crate::vec3;

/// A right-handed orthonormal frame at a vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TangentFrame {
    /// First tangent axis.
    pub x: [f64; 3],
    /// Second tangent axis, `normal × x`.
    pub y: [f64; 3],
    /// Area-weighted vertex normal.
    pub normal: [f64; 3],
}

impl TangentFrame {
    /// The frame about a unit normal, as DiffusionNet builds it: the coordinate axis `x`, or `y` where the normal is within
    /// about 25° of `x`, projected into the tangent plane.
    ///
    /// Where the normal is undefined (zero) the frame is that of `+z`.
    pub fn about(normal: [f64; 3]) -> Self {
        let normal = if normal == [0.0; 3] { [0.0, 0.0, 1.0] } else { normal };
        let guide = if normal[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let x = vec3::normalized(vec3::add_scaled(guide, -vec3::dot(guide, normal), normal));
        Self { x, y: vec3::cross(normal, x), normal }
    }
}

/// One frame per vertex `[V]`. The axes have no meaning of their own: DiffusionNet's gradient features do not depend on them.
pub fn tangent_frames(mesh: &TriMesh) -> Vec<TangentFrame> {
    vertex_normals(mesh.positions(), mesh.faces()).into_iter().map(TangentFrame::about).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for frame in tangent_frames(&shapes::icosphere(1.0, 3)) {
            for (a, b, expected) in [
                (frame.x, frame.x, 1.0),
                (frame.y, frame.y, 1.0),
                (frame.x, frame.y, 0.0),
                (frame.x, frame.normal, 0.0),
            ] {
                assert!((vec3::dot(a, b) - expected).abs() < 1e-12);
            }
            assert!(vec3::dot(vec3::cross(frame.x, frame.y), frame.normal) > 0.999);
        }
        assert_eq!(TangentFrame::about([0.0; 3]).normal, [0.0, 0.0, 1.0]);
    }
}
