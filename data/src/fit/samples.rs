//! Sample points of a garment.

use clothcombo_physics::vec3::{add, cross, norm, scale, sub};

/// Sample points of a garment in the file's coordinates, evenly over its area.
pub(super) struct Samples(pub Vec<[f64; 3]>);

impl Samples {
    pub fn new(positions: &[[f64; 3]], faces: &[[u32; 3]], count: usize) -> Self {
        let corners = |f: &[u32; 3]| f.map(|v| positions[v as usize]);
        let mut sum = 0.0;
        let cumulative: Vec<f64> = faces
            .iter()
            .map(|f| {
                let [a, b, c] = corners(f);
                sum += norm(cross(sub(b, a), sub(c, a)));
                sum
            })
            .collect();
        let points = (0..count)
            .map(|k| {
                let wanted = (k as f64 + 0.5) / count as f64 * sum;
                let face = cumulative.partition_point(|s| *s < wanted).min(faces.len() - 1);
                let [a, b, c] = corners(&faces[face]);
                // A low-discrepancy sequence folded into the triangle.
                let (u, v) = ((k as f64 * 0.754_877_666).fract(), (k as f64 * 0.569_840_291).fract());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                add(a, add(scale(sub(b, a), u), scale(sub(c, a), v)))
            })
            .collect();
        Self(points)
    }
}
