//! The transforms of nodes.

use clothcombo_physics::transform::Transform;
use clothcombo_physics::vec3::{cross, dot};

/// The upper rows of a 4×4 matrix that is stored by columns.
pub(super) fn from_columns(m: &[f64; 16]) -> Transform {
    std::array::from_fn(|r| std::array::from_fn(|c| m[4 * c + r]))
}

/// First `b`, then `a`.
pub(super) fn product(a: &Transform, b: &Transform) -> Transform {
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let linear: f64 = (0..3).map(|k| a[r][k] * b[k][c]).sum();
            if c == 3 { linear + a[r][3] } else { linear }
        })
    })
}

/// Whether left and right change places.
pub(super) fn is_mirrored(m: &Transform) -> bool {
    let [a, b, c] = m.map(|[x, y, z, _]| [x, y, z]);
    dot(a, cross(b, c)) < 0.0
}
