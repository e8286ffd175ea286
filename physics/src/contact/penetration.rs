//! Depth of garment vertices inside a body.

use crate::query::{Distance, Surface};
use rayon::prelude::*;

/// How deep the vertices of a garment lie inside a body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Penetration {
    /// Vertices looked at.
    pub vertices: usize,
    /// Vertices with a negative gap, and those that are nowhere (NaN or infinite).
    pub inside: usize,
    /// Vertices deeper than the given threshold.
    pub deep: usize,
    /// Largest depth (m), 0 when no vertex is inside, infinite when one is nowhere.
    pub max_depth: f64,
}

/// Counts the vertices of `positions` inside `body`, and those deeper than `deep_threshold` (m), by the closest point of its
/// surface.
pub fn penetration(body: &Surface<f64>, positions: &[[f64; 3]], deep_threshold: f64) -> Penetration {
    penetration_by(body, positions, deep_threshold, Distance::ClosestPoint)
}

/// The same by the given distance.
pub fn penetration_by(
    body: &Surface<f64>,
    positions: &[[f64; 3]],
    deep_threshold: f64,
    distance: Distance,
) -> Penetration {
    let depth = |&p: &[f64; 3]| match body.gap(p, distance).gap {
        gap if gap.is_nan() => f64::INFINITY,
        gap => -gap,
    };
    let depths: Vec<f64> = positions.par_iter().with_min_len(256).map(depth).collect();
    Penetration {
        vertices: positions.len(),
        inside: depths.iter().filter(|d| **d > 0.0).count(),
        deep: depths.iter().filter(|d| **d > deep_threshold).count(),
        max_depth: depths.iter().fold(0.0, |deepest, d| f64::max(deepest, *d)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::icosphere;
    use std::sync::Arc;

    #[test]
    fn points_inside_a_sphere_are_counted_with_their_depth() {
        let sphere = icosphere(1.0, 4);
        let body = Surface::new(sphere.positions().to_vec(), Arc::from(sphere.faces().to_vec()));
        let points = [[0.0, 0.0, 0.0], [0.0, 0.9, 0.0], [1.5, 0.0, 0.0], [0.0, 0.0, -0.995]];
        let p = penetration(&body, &points, 0.05);
        assert_eq!((p.vertices, p.inside, p.deep), (4, 3, 2));
        assert!((p.max_depth - 1.0).abs() < 0.01, "{p:?}");
    }
}
