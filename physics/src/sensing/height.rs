//! Height of a point over the sheet of cloth next to it.

use super::rings::Rings;
use crate::query::Surface;
use crate::vec3::{accumulate, add_scaled, distance_squared, dot, norm, scale, sub, to_f64, zero};

/// Sheets farther away than this are not felt [m].
const REACH: f64 = 0.08;
/// Vertices count whose distance exceeds the least by less than this many median edges.
const SPREAD: f64 = 1.5;

/// A garment in its present position, as a point near it feels it.
pub(super) struct Sheet<'a> {
    pub surface: Surface<f32>,
    pub rings: &'a Rings,
    /// Of the rest shape [m].
    pub median_edge: f64,
}

/// Where a point lies seen from a sheet.
pub(super) struct Height {
    /// Mean height over the tangent planes of the vertices near it, positive outside [m].
    pub height: f64,
    /// Mean of their normals: of length 1 where the sheet is flat.
    pub normal: [f64; 3],
    /// Distance along the sheet to the mean of those vertices: how far beyond a hem, within it next to nothing [m].
    pub beside: f64,
    /// 1 on the sheet, falling to 0 at the reach.
    pub presence: f64,
}

/// Least and largest coordinates of points that may feel a sheet with vertices at `positions`.
pub(super) fn felt_within(positions: &[[f32; 3]]) -> [[f64; 3]; 2] {
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for p in positions {
        for (k, x) in to_f64(*p).into_iter().enumerate() {
            bounds[0][k] = bounds[0][k].min(x - REACH);
            bounds[1][k] = bounds[1][k].max(x + REACH);
        }
    }
    bounds
}

/// The height of `p` over `sheet`, if that is near; cloth that faces the other way than `facing` is not felt, as the back of a
/// sleeve or the other leg.
///
/// A moving weighted mean over the tangent planes rather than the nearest one alone: it changes smoothly with `p` but for
/// where another part of the sheet becomes the nearest.
pub(super) fn height(sheet: &Sheet<'_>, p: [f64; 3], facing: [f64; 3]) -> Option<Height> {
    let Sheet { surface: sheet, rings, median_edge } = sheet;
    if sheet.positions.is_empty() {
        return None;
    }
    let nearest = sheet.nearest_vertex(p.map(|x| x as f32));
    let least = distance_squared(to_f64(*sheet.positions.get(nearest as usize)?), p).sqrt();
    // Also refuses what is not a number.
    if least.partial_cmp(&REACH) != Some(std::cmp::Ordering::Less) {
        return None;
    }
    let spread = SPREAD * median_edge;
    let (mut total, mut height, mut normal, mut centre) = (0.0, 0.0, zero(), zero());
    for &v in rings.patch(nearest) {
        let (q, n) = (to_f64(sheet.positions[v as usize]), to_f64(sheet.normals[v as usize]));
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
