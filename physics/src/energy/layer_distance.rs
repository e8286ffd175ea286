//! Layer distance: over one body vertex, the inner garment is closer to the body than the outer one (paper, equation for
//! L_d).
//!
//! `Σ max(d(x_i) − d(x_j), 0)³` over pairs of an inner vertex `x_i` and an outer vertex `x_j` that have the same nearest body
//! vertex and are both closer to the body than a radius. Vertices are bucketed by body vertex: no pair outside a bucket is
//! looked at.

use rayon::prelude::*;

use super::Weighted;
use super::elements::GRAIN;
use crate::query::Gap;
use crate::real::Real;
use crate::rows::CompressedRows;
use crate::vec3::{scale, to_f64};

/// Signed distances (m) of the vertices closer to the body than a radius, by nearest body vertex, in vertex order.
pub(super) struct BodyBuckets(CompressedRows<f64>);

impl BodyBuckets {
    /// Sorts the vertices with signed distances `gaps` below `radius` (m) into one bucket per body vertex.
    pub fn new<T: Real>(gaps: &[Gap<T>], body_vertex_count: usize, radius: f64) -> Self {
        let near = gaps.iter().filter(|gap| counts(gap, body_vertex_count, radius));
        let keyed = near.map(|gap| (gap.vertex as usize, gap.gap.to_f64()));
        Self(CompressedRows::grouped(body_vertex_count, keyed))
    }
}

#[inline(always)]
fn counts<T: Real>(gap: &Gap<T>, body_vertex_count: usize, radius: f64) -> bool {
    gap.gap.to_f64() < radius && (gap.vertex as usize) < body_vertex_count
}

/// One garment of a pair: its vertices' distances to the body and their buckets.
#[derive(Clone, Copy)]
pub(super) struct LayerGaps<'a, T> {
    /// Signed distance per vertex `[V]`.
    pub gaps: &'a [Gap<T>],
    /// Made from `gaps`, the body and the radius.
    pub buckets: &'a BodyBuckets,
}

/// Penalty (m³) of an inner garment farther from the body than an outer one; `radius` (m) as in the buckets. Adds its
/// weighted gradient to `targets`, the inner garment's first.
pub(super) fn layer_distance<T: Real>(
    inner: LayerGaps<'_, T>,
    outer: LayerGaps<'_, T>,
    radius: f64,
    targets: Option<[Weighted<'_, T>; 2]>,
) -> f64 {
    // Inner vertices look for outer ones that are closer to the body, outer ones for inner ones that are farther.
    let from_inner = partners(inner, outer, radius, 1.0);
    if let Some([mut inner_target, mut outer_target]) = targets {
        for (v, (gap, (_, slope))) in inner.gaps.iter().zip(&from_inner).enumerate() {
            if *slope != 0.0 {
                inner_target.add(v, scale(to_f64(gap.gradient), *slope));
            }
        }
        let from_outer = partners(outer, inner, radius, -1.0);
        for (v, (gap, (_, slope))) in outer.gaps.iter().zip(&from_outer).enumerate() {
            if *slope != 0.0 {
                outer_target.add(v, scale(to_f64(gap.gradient), -*slope));
            }
        }
    }
    from_inner.iter().map(|(energy, _)| energy).sum()
}

/// For every vertex of `of`: `Σ max(sign·(d − d'), 0)³` and `Σ 3 max(…)²` over the vertices of `against` in its bucket.
fn partners<T: Real>(
    of: LayerGaps<'_, T>,
    against: LayerGaps<'_, T>,
    radius: f64,
    sign: f64,
) -> Vec<(f64, f64)> {
    let buckets = &against.buckets.0;
    of.gaps
        .par_iter()
        .with_min_len(GRAIN)
        .map(|gap| {
            if !counts(gap, buckets.len(), radius) {
                return (0.0, 0.0);
            }
            let here = gap.gap.to_f64();
            let (mut energy, mut slope) = (0.0, 0.0);
            for other in buckets.row(gap.vertex as usize) {
                let excess = (sign * (here - other)).max(0.0);
                energy += excess * excess * excess;
                slope += 3.0 * excess * excess;
            }
            (energy, slope)
        })
        .collect()
}
