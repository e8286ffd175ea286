//! Order of two layers: how many vertices of the outer garment lie below the inner one.

use crate::mesh::vertex_normals;
use crate::query::VertexIndex;
use crate::vec3::{dot, sub};
use rayon::prelude::*;

/// Outer vertices farther than this from the inner garment do not count (m).
pub const ORDER_RADIUS: f64 = 0.05;

/// Wrong-side vertices of an outer garment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OrderViolations {
    /// Outer vertices within [`ORDER_RADIUS`] of the inner garment.
    pub counted: usize,
    /// Those of them on its inner side: gap < 0 along the normal of the nearest inner vertex.
    pub violations: usize,
}

impl OrderViolations {
    /// Share of the counted vertices, 0 when none was counted.
    pub fn share(&self) -> f64 {
        if self.counted == 0 { 0.0 } else { self.violations as f64 / self.counted as f64 }
    }
}

/// Counts the vertices of `outer` on the wrong side of the inner garment (its positions and faces).
pub fn order_violations(inner: &[[f64; 3]], inner_faces: &[[u32; 3]], outer: &[[f64; 3]]) -> OrderViolations {
    let normals = vertex_normals(inner, inner_faces);
    let index = VertexIndex::new(inner);
    let (counted, violations) = outer
        .par_iter()
        .with_min_len(256)
        .map(|&p| {
            let (nearest, squared_distance) = index.nearest(p);
            // None is where no inner vertex is finite.
            let found = inner.get(nearest as usize).zip(normals.get(nearest as usize));
            let Some((q, normal)) = found.filter(|_| squared_distance <= ORDER_RADIUS * ORDER_RADIUS) else {
                return (0, 0);
            };
            (1, usize::from(dot(sub(p, *q), *normal) < 0.0))
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    OrderViolations { counted, violations }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::icosphere;

    #[test]
    fn a_sphere_inside_another_is_wholly_on_the_wrong_side() {
        let (small, large) = (icosphere(0.98, 3), icosphere(1.0, 3));
        let right = order_violations(small.positions(), small.faces(), large.positions());
        assert_eq!((right.counted, right.violations), (large.vertex_count(), 0));
        let wrong = order_violations(large.positions(), large.faces(), small.positions());
        assert_eq!(wrong.violations, small.vertex_count());
        let lost = vec![[f64::NAN; 3]; small.vertex_count()];
        assert_eq!(order_violations(&lost, small.faces(), large.positions()).counted, 0);
        let far = icosphere(2.0, 3);
        assert_eq!(order_violations(small.positions(), small.faces(), far.positions()).counted, 0);
    }
}
