//! The paper's form: `d = (x − x_g)·n_g` for the nearest inner vertex `x_g` and its area-weighted normal.
//!
//! The gradient reaches the outer vertex, the inner vertex and, through the normal, the one-ring of the inner vertex: it is the
//! exact derivative wherever the nearest vertex stays the same.
//!
//! **Without a normal.** An inner vertex whose faces have collapsed has no normal, and near that its normal turns
//! arbitrarily fast. With `N` the sum of its faces' normals (twice their areas), `n = N/√(|N|² + τ²)` with τ 1e-4 of `|N|`
//! at rest (at least 1e-6 squared median edges): within 1e-8 of a unit normal at rest, and a bounded derivative. Inner
//! vertices without a face take no part.
//!
//! [`LayerGate`] limits the sum to outer vertices that have inner cloth under them.

use std::sync::Arc;

use rayon::prelude::*;

use super::outer_points::OuterPoints;
use crate::energy::elements::GRAIN;
use crate::energy::{EnergySettings, Weighted};
use crate::mesh::TriMesh;
use crate::query::VertexIndex;
use crate::real::Real;
use crate::rows::{CompressedRows, corners_at_vertices};
use crate::vec3::{accumulate, add, axpy, cross, dot, norm, norm_squared, scale, sub, to_f64, zero};

/// τ in units of `|N|` at rest.
pub const NORMAL_COLLAPSE_RATIO: f64 = 1e-4;

/// Smallest τ in units of the squared median edge.
pub const NORMAL_COLLAPSE_FLOOR: f64 = 1e-6;

/// What stays the same of an inner garment.
#[derive(Debug, Clone)]
pub struct InnerVertices {
    pub(super) faces: Arc<[[u32; 3]]>,
    corners_at: CompressedRows<u32>,
    /// τ² per vertex (m⁴).
    collapse_squared: Vec<f64>,
    /// Of the rest shape (m).
    pub(super) median_edge: f64,
}

/// Posed normals and index of an inner garment.
#[derive(Debug)]
pub struct PosedVertices<T: Real> {
    index: VertexIndex<T>,
    /// `N`, the sum of the faces' cross products (m²).
    area_normals: Vec<[f64; 3]>,
}

/// One outer point against its inner vertex.
#[derive(Debug, Clone, Copy)]
struct VertexContact {
    inner: u32,
    energy: f64,
    /// `∂E/∂d`.
    slope: f64,
}

const NO_CONTACT: VertexContact = VertexContact { inner: 0, energy: 0.0, slope: 0.0 };

impl InnerVertices {
    pub(super) fn new(rest: &TriMesh) -> Self {
        let median_edge = rest.median_edge_length();
        let faces: Arc<[[u32; 3]]> = rest.faces().into();
        let corners_at = corners_at_vertices(rest.vertex_count(), &faces);
        let floor = NORMAL_COLLAPSE_FLOOR * median_edge * median_edge;
        let collapse_squared = area_normals(rest.positions(), &faces, &corners_at)
            .into_iter()
            .map(|n| (NORMAL_COLLAPSE_RATIO * norm(n)).max(floor).powi(2))
            .collect();
        Self { faces, corners_at, collapse_squared, median_edge }
    }

    pub(super) fn posed<T: Real>(&self, positions: &[[T; 3]]) -> PosedVertices<T> {
        PosedVertices {
            index: VertexIndex::new(positions),
            area_normals: area_normals(positions, &self.faces, &self.corners_at),
        }
    }

    /// The regularised normal `n` and `√(|N|² + τ²)`; `None` without faces.
    #[inline(always)]
    fn normal<T: Real>(&self, posed: &PosedVertices<T>, v: usize) -> Option<([f64; 3], f64)> {
        if self.corners_at.row(v).is_empty() {
            return None;
        }
        let sum = posed.area_normals[v];
        let length = (norm_squared(sum) + self.collapse_squared[v]).sqrt();
        Some((if length > 0.0 { scale(sum, 1.0 / length) } else { zero() }, length))
    }

    /// As [`InnerLayer::evaluate`](super::InnerLayer::evaluate).
    pub(super) fn evaluate<T: Real>(
        &self,
        inner: &[[T; 3]],
        posed: &PosedVertices<T>,
        outer: &OuterPoints<'_, T>,
        settings: &EnergySettings,
        targets: Option<[Weighted<'_, T>; 2]>,
    ) -> f64 {
        let (epsilon, gate) = (settings.layer_collision_epsilon, settings.layer_gate);
        let contact = |p: &[T; 3]| {
            let (v, _) = posed.index.nearest(*p);
            let offset = sub(to_f64(*p), to_f64(*inner.get(v as usize)?));
            let (normal, _) = self.normal(posed, v as usize)?;
            let gap = dot(offset, normal);
            if let Some(gate) = gate {
                let aside = gate.tangential_edges * self.median_edge;
                let tangential = crate::vec3::add_scaled(offset, -gap, normal);
                if gap.abs() > gate.depth || norm_squared(tangential) > aside * aside {
                    return None;
                }
            }
            let excess = epsilon - gap;
            if excess <= 0.0 {
                return None;
            }
            Some(VertexContact { inner: v, energy: excess.powi(3), slope: -3.0 * excess * excess })
        };
        let points = outer.at.par_iter().with_min_len(GRAIN / 2);
        let contacts: Vec<VertexContact> = points.map(|p| contact(p).unwrap_or(NO_CONTACT)).collect();
        if let Some([mut inner_target, mut outer_target]) = targets {
            // With f = x − x_g: ∂d/∂x = n, ∂d/∂x_g = −n, ∂d/∂N = (f − n (n·f))/√(|N|² + τ²).
            let mut by_normal = vec![zero(); inner.len()];
            for (j, contact) in contacts.iter().enumerate() {
                let v = contact.inner as usize;
                if contact.slope == 0.0 {
                    continue;
                }
                let Some((normal, length)) = self.normal(posed, v) else { continue };
                let offset = sub(to_f64(outer.at[j]), to_f64(inner[v]));
                let push = scale(normal, contact.slope);
                outer.points.add(&mut outer_target, j, push);
                inner_target.add(v, scale(push, -1.0));
                let across = crate::vec3::add_scaled(offset, -dot(normal, offset), normal);
                if length > 0.0 {
                    axpy(&mut by_normal[v], contact.slope / length, across);
                }
            }
            self.pull_back_normals(inner, &by_normal, inner_target);
        }
        contacts.iter().map(|c| c.energy).sum()
    }

    /// Adds the gradient through `N` to the corners of the faces: a face with corners `a b c` adds `a×b + b×c + c×a` to `N`
    /// of all three, so with `W` the sum of their `∂E/∂N`, corner `a` receives `(b − c) × W`.
    fn pull_back_normals<T: Real>(
        &self,
        positions: &[[T; 3]],
        by_normal: &[[f64; 3]],
        target: Weighted<'_, T>,
    ) {
        let weight = target.weight;
        target.gradient.par_iter_mut().with_min_len(GRAIN).enumerate().for_each(|(v, gradient)| {
            let mut sum = zero();
            for &slot in self.corners_at.row(v) {
                let (face, corner) = (self.faces[slot as usize / 3], slot as usize % 3);
                let [wa, wb, wc] = face.map(|v| by_normal[v as usize]);
                let w = add(wa, add(wb, wc));
                if w == [0.0; 3] {
                    continue;
                }
                let [next, previous] =
                    [face[(corner + 1) % 3], face[(corner + 2) % 3]].map(|v| to_f64(positions[v as usize]));
                accumulate(&mut sum, cross(sub(next, previous), w));
            }
            accumulate(gradient, crate::vec3::from_f64(scale(sum, weight)));
        });
    }
}

fn area_normals<T: Real>(
    positions: &[[T; 3]],
    faces: &[[u32; 3]],
    corners_at: &CompressedRows<u32>,
) -> Vec<[f64; 3]> {
    let crosses: Vec<[f64; 3]> = faces
        .par_iter()
        .with_min_len(4 * GRAIN)
        .map(|face| {
            let [a, b, c] = face.map(|v| to_f64(positions[v as usize]));
            cross(sub(b, a), sub(c, a))
        })
        .collect();
    (0..positions.len())
        .into_par_iter()
        .with_min_len(4 * GRAIN)
        .map(|v| {
            let mut sum = zero();
            for &slot in corners_at.row(v) {
                accumulate(&mut sum, crosses[slot as usize / 3]);
            }
            sum
        })
        .collect()
}
