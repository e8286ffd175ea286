//! Normal and shape of one triangle.

use clothcombo_physics::vec3::{cross, norm, norm_squared, sub};

/// Unnormalised normal of a triangle.
pub fn triangle_normal([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    cross(sub(b, a), sub(c, a))
}

/// Sine-like measure of the smallest angle of a triangle: exact for acute smallest angles, which a smallest angle is.
pub fn smallest_sine([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let lengths = [norm_squared(sub(b, a)), norm_squared(sub(c, b)), norm_squared(sub(a, c))];
    let shortest = lengths.iter().copied().fold(f64::MAX, f64::min);
    let product: f64 = lengths.iter().product();
    let doubled_area = norm(triangle_normal([a, b, c]));
    // 2A = (product of the two longer sides) · sin(smallest angle).
    if product > 0.0 { doubled_area / (product / shortest).sqrt() } else { 0.0 }
}
