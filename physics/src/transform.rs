//! Affine maps of points, as skinning blends them.

use crate::vec3::{cross, dot, scale, sub};

/// An affine map `x ↦ A x + t` as the rows of `[A t]`.
pub type Transform = [[f64; 4]; 3];

/// The map that changes nothing.
pub const IDENTITY: Transform = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// `A p + t`.
#[inline]
pub fn apply(transform: &Transform, p: [f64; 3]) -> [f64; 3] {
    transform.map(|[a, b, c, d]| a * p[0] + b * p[1] + c * p[2] + d)
}

/// `A v`.
#[inline]
pub fn apply_linear(transform: &Transform, v: [f64; 3]) -> [f64; 3] {
    transform.map(|[a, b, c, _]| a * v[0] + b * v[1] + c * v[2])
}

/// The inverse map.
///
/// # Errors
/// The determinant of `A` where its magnitude is below `smallest`.
pub fn inverse(transform: &Transform, smallest: f64) -> Result<Transform, f64> {
    let [r0, r1, r2] = transform.map(|[a, b, c, _]| [a, b, c]);
    let columns = [cross(r1, r2), cross(r2, r0), cross(r0, r1)];
    let determinant = dot(r0, columns[0]);
    if !(determinant.abs() >= smallest && determinant.is_finite()) {
        return Err(determinant);
    }
    let columns = columns.map(|c| scale(c, 1.0 / determinant));
    let rows: [[f64; 3]; 3] = std::array::from_fn(|r| [columns[0][r], columns[1][r], columns[2][r]]);
    let shift = transform.map(|row| row[3]);
    let back = sub([0.0; 3], rows.map(|row| dot(row, shift)));
    Ok(std::array::from_fn(|r| [rows[r][0], rows[r][1], rows[r][2], back[r]]))
}

/// Skinning transforms of offsets with a smaller determinant are not undone: there, offsets stay as they stand.
const SMALLEST_DETERMINANT: f64 = 1e-3;

/// An offset in the frame of a vertex's skinning transform: `A⁻¹ v`, or `v` where A is next to singular.
pub fn into_frame(transform: &Transform, v: [f64; 3]) -> [f64; 3] {
    inverse(transform, SMALLEST_DETERMINANT).map_or(v, |inverse| apply_linear(&inverse, v))
}

/// An offset out of that frame: what [`into_frame`] undoes.
pub fn out_of_frame(transform: &Transform, v: [f64; 3]) -> [f64; 3] {
    match inverse(transform, SMALLEST_DETERMINANT) {
        Ok(_) => apply_linear(transform, v),
        Err(_) => v,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SKEW: Transform = [[0.9, 0.1, -0.2, 3.0], [0.0, 1.1, 0.3, 1.0], [0.2, 0.0, 0.8, -2.0]];
    const FLAT: Transform = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0; 4]];

    fn assert_near(a: [f64; 3], b: [f64; 3]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-14), "{a:?} {b:?}");
    }

    #[test]
    fn inverses_and_frames_undo() {
        let v = [0.3, -0.2, 0.7];
        assert_near(apply(&inverse(&SKEW, 1e-6).unwrap(), apply(&SKEW, v)), v);
        assert_near(into_frame(&SKEW, out_of_frame(&SKEW, v)), v);
        assert_eq!(out_of_frame(&FLAT, into_frame(&FLAT, v)), v);
        assert_eq!(inverse(&FLAT, 1e-6), Err(0.0));
    }
}
