//! Vectors of three scalars as plain arrays: no wrapper type stands between a mesh and a network's buffer.

use crate::real::Real;

/// The zero vector.
#[inline(always)]
pub fn zero<T: Real>() -> [T; 3] {
    [T::zero(); 3]
}

/// `a + b`.
#[inline(always)]
pub fn add<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a − b`.
#[inline(always)]
pub fn sub<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `−a`.
#[inline(always)]
pub fn neg<T: Real>(a: [T; 3]) -> [T; 3] {
    [-a[0], -a[1], -a[2]]
}

/// `s·a`.
#[inline(always)]
pub fn scale<T: Real>(a: [T; 3], s: T) -> [T; 3] {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// `a + s·b`.
#[inline(always)]
pub fn add_scaled<T: Real>(a: [T; 3], s: T, b: [T; 3]) -> [T; 3] {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// `y ← y + s·x`.
#[inline(always)]
pub fn axpy<T: Real>(y: &mut [T; 3], s: T, x: [T; 3]) {
    *y = add_scaled(*y, s, x);
}

/// `y ← y + x`.
#[inline(always)]
pub fn accumulate<T: Real>(y: &mut [T; 3], x: [T; 3]) {
    *y = add(*y, x);
}

/// `a·b`.
#[inline(always)]
pub fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a × b`.
#[inline(always)]
pub fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `|a|²`.
#[inline(always)]
pub fn norm_squared<T: Real>(a: [T; 3]) -> T {
    dot(a, a)
}

/// `|a|`.
#[inline(always)]
pub fn norm<T: Real>(a: [T; 3]) -> T {
    norm_squared(a).sqrt()
}

/// `|a − b|²`.
#[inline(always)]
pub fn distance_squared<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    norm_squared(sub(a, b))
}

/// `a / |a|`; the zero vector where `|a|²` is zero, subnormal or not finite, so that a direction that does not exist
/// never turns into NaN.
#[inline(always)]
pub fn normalized<T: Real>(a: [T; 3]) -> [T; 3] {
    let squared = norm_squared(a);
    if squared >= T::min_positive_value() && squared.is_finite() {
        scale(a, squared.sqrt().recip())
    } else {
        zero()
    }
}

/// Smallest and largest coordinates of points; `(∞, −∞)` for none.
#[inline(always)]
pub fn bounds(points: impl IntoIterator<Item = [f64; 3]>) -> ([f64; 3], [f64; 3]) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in points {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    (low, high)
}

/// Whether all three coordinates are finite.
#[inline(always)]
pub fn is_finite<T: Real>(a: [T; 3]) -> bool {
    a[0].is_finite() && a[1].is_finite() && a[2].is_finite()
}

/// Widens to `f64`.
#[inline(always)]
pub fn to_f64<T: Real>(a: [T; 3]) -> [f64; 3] {
    [a[0].to_f64(), a[1].to_f64(), a[2].to_f64()]
}

/// Rounds from `f64`.
#[inline(always)]
pub fn from_f64<T: Real>(a: [f64; 3]) -> [T; 3] {
    [T::from_f64(a[0]), T::from_f64(a[1]), T::from_f64(a[2])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cross_is_right_handed_and_orthogonal() {
        assert_eq!(cross([1.0f64, 0.0, 0.0], [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
        let (a, b) = ([0.3f64, -1.2, 2.5], [1.7, 0.4, -0.6]);
        let c = cross(a, b);
        assert!(dot(a, c).abs() < 1e-14 && dot(b, c).abs() < 1e-14);
        // Lagrange's identity.
        let expected = norm_squared(a) * norm_squared(b) - dot(a, b).powi(2);
        assert!((norm_squared(c) - expected).abs() < 1e-12);
    }

    #[test]
    fn normalized_is_unit_or_zero() {
        assert!((norm(normalized([3.0f32, -4.0, 12.0])) - 1.0).abs() < 1e-6);
        assert_eq!(normalized([0.0f64; 3]), [0.0; 3]);
        assert_eq!(normalized([1e-200f64, 0.0, 0.0]), [0.0; 3]);
        assert_eq!(normalized([f32::NAN, 0.0, 0.0]), [0.0; 3]);
        assert_eq!(normalized([1e30f32, 0.0, 0.0]), [0.0; 3]);
    }
}
