//! The closest point of one triangle.

use crate::vec3;

/// Part of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Feature {
    /// Corner 0, 1 or 2.
    Vertex(usize),
    /// Edge `e` from corner `e` to corner `(e + 1) % 3`.
    Edge(usize),
    /// The inside of the triangle.
    Face,
}

/// What [`closest_on_triangle`] found.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TrianglePoint {
    pub position: [f64; 3],
    pub distance_squared: f64,
    pub barycentric: [f64; 3],
    pub feature: Feature,
}

/// Closest point of a triangle by Voronoi regions (Ericson, *Real-Time Collision Detection*, §5.1.5).
///
/// The region tests divide by the area; a triangle thinner than 1e-12 of its length is measured as its three edges instead,
/// which is exact for it.
pub(crate) fn closest_on_triangle(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> TrianglePoint {
    let (ab, ac, bc) = (vec3::sub(b, a), vec3::sub(c, a), vec3::sub(c, b));
    let longest = vec3::norm_squared(ab).max(vec3::norm_squared(ac)).max(vec3::norm_squared(bc));
    if vec3::norm_squared(vec3::cross(ab, ac)) <= 1e-24 * longest * longest {
        return closest_on_edges(p, [a, b, c]);
    }
    let at = |barycentric: [f64; 3], feature| {
        let position =
            std::array::from_fn(|k| a[k] * barycentric[0] + b[k] * barycentric[1] + c[k] * barycentric[2]);
        TrianglePoint {
            position,
            distance_squared: vec3::distance_squared(p, position),
            barycentric,
            feature,
        }
    };
    let ap = vec3::sub(p, a);
    let (d1, d2) = (vec3::dot(ab, ap), vec3::dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return at([1.0, 0.0, 0.0], Feature::Vertex(0));
    }
    let bp = vec3::sub(p, b);
    let (d3, d4) = (vec3::dot(ab, bp), vec3::dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return at([0.0, 1.0, 0.0], Feature::Vertex(1));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return at([1.0 - t, t, 0.0], Feature::Edge(0));
    }
    let cp = vec3::sub(p, c);
    let (d5, d6) = (vec3::dot(ab, cp), vec3::dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return at([0.0, 0.0, 1.0], Feature::Vertex(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return at([1.0 - t, 0.0, t], Feature::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return at([0.0, 1.0 - t, t], Feature::Edge(1));
    }
    let sum = va + vb + vc;
    let (v, w) = (vb / sum, vc / sum);
    at([1.0 - v - w, v, w], Feature::Face)
}

/// Closest point of the three edges; safe for edges of length zero.
fn closest_on_edges(p: [f64; 3], corners: [[f64; 3]; 3]) -> TrianglePoint {
    let on_edge = |edge: usize| {
        let next = (edge + 1) % 3;
        let along = vec3::sub(corners[next], corners[edge]);
        let length_squared = vec3::norm_squared(along);
        let t = if length_squared > 0.0 {
            (vec3::dot(vec3::sub(p, corners[edge]), along) / length_squared).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let position = vec3::add_scaled(corners[edge], t, along);
        let mut barycentric = [0.0; 3];
        barycentric[edge] = 1.0 - t;
        barycentric[next] = t;
        let feature = match t {
            0.0 => Feature::Vertex(edge),
            1.0 => Feature::Vertex(next),
            _ => Feature::Edge(edge),
        };
        let distance_squared = vec3::distance_squared(p, position);
        TrianglePoint { position, distance_squared, barycentric, feature }
    };
    let nearer =
        |a: TrianglePoint, b: TrianglePoint| if b.distance_squared < a.distance_squared { b } else { a };
    nearer(nearer(on_edge(0), on_edge(1)), on_edge(2))
}

/// How far a point is from a box, squared; 0 inside.
pub(crate) fn box_distance_squared(p: [f64; 3], low: [f64; 3], high: [f64; 3]) -> f64 {
    vec3::norm_squared(std::array::from_fn(|k| (low[k] - p[k]).max(p[k] - high[k]).max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::SplitMix;

    #[test]
    fn closest_point_on_a_triangle_beats_a_dense_sampling() {
        let mut random = SplitMix::new(21);
        let mut vector = || std::array::from_fn::<f64, 3, _>(|_| random.symmetric());
        for _ in 0..200 {
            let (p, triangle) = (vector(), [vector(), vector(), vector()]);
            let found = closest_on_triangle(p, triangle).distance_squared;
            let mut best = f64::INFINITY;
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let (u, v) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                    let sample = (0..3)
                        .fold([0.0; 3], |sum, k| vec3::add_scaled(sum, [1.0 - u - v, u, v][k], triangle[k]));
                    best = best.min(vec3::distance_squared(p, sample));
                }
            }
            assert!(found <= best + 1e-12 && found.sqrt() > best.sqrt() - 0.1);
        }
    }

    #[test]
    fn degenerate_triangles_are_measured_as_their_edges() {
        let p = [0.3, 0.4, 0.0];
        for (triangle, expected) in [
            ([[0.0; 3]; 3], 0.5),
            ([[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0]], 0.4),
            ([[0.0; 3], [1.0, 0.0, 0.0], [0.25, 0.0, 0.0]], 0.4),
            ([[1.0, 0.0, 0.0], [0.9, 0.0, 0.0], [0.0; 3]], 0.4),
            ([[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1e-14, 0.0]], 0.4),
        ] {
            let found = closest_on_triangle(p, triangle);
            assert!((found.distance_squared.sqrt() - expected).abs() < 1e-12);
            assert!((found.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
