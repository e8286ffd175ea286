//! Order of two layers: which vertices of the outer garment lie under the inner one.

use super::inner_surface::LayerTopology;
use crate::mesh::vertex_normals;
use crate::query::VertexIndex;
use crate::vec3::{dot, sub};
use rayon::prelude::*;

/// Outer vertices farther than this from the inner garment do not count (m).
pub const ORDER_RADIUS: f64 = 0.05;

/// How the order of a vertex against an inner garment is judged.
#[derive(Clone, Copy, Debug)]
pub enum LayerOrder<'a> {
    /// By the normal of the nearest inner vertex: the paper's form.
    NearestVertex,
    /// By the closest point of the inner surface, for vertices over or under it and not beside it; with the topology of every
    /// garment.
    ClosestPoint(&'a [&'a LayerTopology]),
}

/// Vertices of an outer garment that lie under an inner one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OrderViolations {
    /// Outer vertices within [`ORDER_RADIUS`] of the inner garment.
    pub counted: usize,
    /// Those of them under it.
    pub violations: usize,
}

impl OrderViolations {
    /// Share of the counted vertices, 0 when none was counted.
    pub fn share(&self) -> f64 {
        self.violations as f64 / self.counted.max(1) as f64
    }
}

impl std::iter::Sum for OrderViolations {
    fn sum<I: Iterator<Item = Self>>(iter: I) -> Self {
        iter.fold(Self::default(), |a, b| Self {
            counted: a.counted + b.counted,
            violations: a.violations + b.violations,
        })
    }
}

/// Heights (m) of the vertices of `outer` within [`ORDER_RADIUS`] of an inner garment (its positions and faces), each over its
/// nearest inner vertex and negative under it.
pub(super) fn nearest_vertex_heights(
    inner: &[[f64; 3]],
    inner_faces: &[[u32; 3]],
    outer: &[[f64; 3]],
) -> Vec<f64> {
    let normals = vertex_normals(inner, inner_faces);
    let index = VertexIndex::new(inner);
    let height = |&p: &[f64; 3]| {
        let (nearest, squared_distance) = index.nearest(p);
        // None is where no inner vertex is finite.
        let found = inner.get(nearest as usize).zip(normals.get(nearest as usize));
        let (q, normal) = found.filter(|_| squared_distance <= ORDER_RADIUS * ORDER_RADIUS)?;
        Some(dot(sub(p, *q), *normal))
    };
    outer.par_iter().with_min_len(256).filter_map(height).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::icosphere;

    #[test]
    fn a_sphere_inside_another_violates_the_order_with_all_its_vertices() {
        let (small, large) = (icosphere(0.98, 3), icosphere(1.0, 3));
        let right = nearest_vertex_heights(small.positions(), small.faces(), large.positions());
        assert!(right.len() == large.vertex_count() && right.iter().all(|h| *h > 0.0));
        let wrong = nearest_vertex_heights(large.positions(), large.faces(), small.positions());
        assert!(wrong.len() == small.vertex_count() && wrong.iter().all(|h| *h < 0.0));
        let lost = vec![[f64::NAN; 3]; small.vertex_count()];
        assert!(nearest_vertex_heights(&lost, small.faces(), large.positions()).is_empty());
        let far = icosphere(2.0, 3);
        assert!(nearest_vertex_heights(small.positions(), small.faces(), far.positions()).is_empty());
    }
}
