//! Height of a point over the garment next to it.

use super::rings::Rings;
use crate::query::Surface;
use crate::vec3::{accumulate, add_scaled, distance_squared, dot, norm, scale, sub, to_f64, zero};

/// Garments farther away than this count for nothing (m).
const REACH: f64 = 0.08;
/// Vertices count whose distance exceeds the least by less than this many median edges.
const SPREAD: f64 = 1.5;

/// A garment in its present position.
pub(super) struct PosedGarment<'a> {
    pub surface: Surface<f32>,
    pub rings: &'a Rings,
    /// Of the rest shape (m).
    median_edge: f64,
    /// Least and largest coordinates of points within reach.
    reach: [[f64; 3]; 2],
}

impl<'a> PosedGarment<'a> {
    pub fn new(surface: Surface<f32>, rings: &'a Rings, median_edge: f64) -> Self {
        let mut reach = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for p in &surface.positions {
            for (k, x) in to_f64(*p).into_iter().enumerate() {
                reach[0][k] = reach[0][k].min(x - REACH);
                reach[1][k] = reach[1][k].max(x + REACH);
            }
        }
        Self { surface, rings, median_edge, reach }
    }
}

/// Where a point lies seen from a garment.
pub(super) struct Height {
    /// Mean height over the tangent planes of the vertices near it, positive outside (m).
    pub height: f64,
    /// Mean of their normals: of length 1 where the garment is flat.
    pub normal: [f64; 3],
    /// Distance along the garment to the mean of those vertices: how far beyond a hem, within it next to nothing (m).
    pub beside: f64,
    /// 1 on the garment, falling to 0 at the reach.
    pub presence: f64,
}

/// The height of `p` over `garment`, if that is near; cloth that does not face `facing` counts for nothing, as the back of a
/// sleeve or the other leg.
///
/// A moving weighted mean over the tangent planes instead of the nearest one: it changes smoothly with `p` but for where
/// another part of the garment becomes the nearest.
pub(super) fn height(garment: &PosedGarment<'_>, p: [f64; 3], facing: [f64; 3]) -> Option<Height> {
    let PosedGarment { surface, rings, median_edge, reach: [low, high] } = garment;
    if !(0..3).all(|k| (low[k]..=high[k]).contains(&p[k])) {
        return None;
    }
    let nearest = surface.nearest_vertex(p.map(|x| x as f32));
    let least = distance_squared(to_f64(*surface.positions.get(nearest as usize)?), p).sqrt();
    // Also refuses what is not a number.
    if least.partial_cmp(&REACH) != Some(std::cmp::Ordering::Less) {
        return None;
    }
    let spread = SPREAD * median_edge;
    let (mut total, mut height, mut normal, mut centre) = (0.0, 0.0, zero(), zero());
    for &v in rings.patch(nearest) {
        let (q, n) = (to_f64(surface.positions[v as usize]), to_f64(surface.normals[v as usize]));
        let excess = (distance_squared(p, q).sqrt() - least) / spread;
        if excess >= 1.0 || dot(n, facing) <= 0.0 {
            continue;
        }
        let weight = (1.0 - excess).powi(2);
        total += weight;
        height += weight * dot(n, sub(p, q));
        normal = add_scaled(normal, weight, n);
        accumulate(&mut centre, scale(q, weight));
    }
    if total.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
        return None;
    }
    let normal = scale(normal, 1.0 / total);
    let offset = sub(p, scale(centre, 1.0 / total));
    let length = norm(normal);
    let along = if length > 0.0 { scale(normal, dot(offset, normal) / (length * length)) } else { zero() };
    Some(Height {
        height: height / total,
        normal,
        beside: norm(sub(offset, along)),
        presence: (1.0 - least / REACH).powi(2),
    })
}
