//! The order of layers: along the outward direction of the body an outer garment lies beyond an inner one.
//!
//! The closest point of a folded inner garment may lie on the back of a fold, or on the far side of a sleeve, and its normal
//! then points the wrong way. The outward direction is the same for all layers over a place, so every vertex looks along it: of
//! all sheets of the inner garment there, the outermost counts.

use std::ops::RangeInclusive;

use rayon::prelude::*;

use super::condition::{Condition, along_line, is_tiny, normal_of, overlap};
use super::packed_cloth::PackedCloth;
use crate::contact::{Triangle, TriangleTree};
use crate::mesh::vertex_normals;
use crate::vec3::{add, add_scaled, bounds, dot, neg, norm, normalized, scale, sub};

/// A sheet whose outward direction differs more than this from the vertex's (cosine) lies over another part of
/// the body: a sleeve is not over the side of the chest.
const SAME_PART: f64 = 0.5;
/// A sheet steeper than this (cosine between its normal and the direction away from the body) is left along that direction
/// instead of its normal.
pub(super) const STEEP: f64 = 0.5;

/// Two sheets look at each other where their directions away from the body have a cosine below this.
const FACING_SHEETS: f64 = -0.3;
/// Rings over which directions are smoothed.
const SMOOTHED_RINGS: usize = 4;

/// A vertex and the sheet of an inner garment it has to stay over.
#[derive(Debug, Clone, Copy)]
pub(super) struct LayerConstraint {
    pub vertex: u32,
    /// Packed corners of the inner garment's face, and the place in it.
    pub face: [u32; 3],
    pub barycentric: [f64; 3],
    pub normal: [f64; 3],
    /// Height over the sheet along `normal`, negative below (m).
    pub height: f64,
}

impl LayerConstraint {
    pub fn contact(&self, gap: f64) -> Condition {
        Condition::vertex_over(self.vertex, (self.face, self.barycentric), self.normal, gap)
    }
}

/// Every vertex with a sheet of an inner garment less than `reach` above it or less than `watch` below it.
/// `trees` are those of the garments, `outward` the direction away from the body, zero where there is none.
pub(super) fn layer_constraints(
    outfit: &PackedCloth<'_>,
    trees: &[TriangleTree<'_>],
    positions: &[[f64; 3]],
    outward: &[[f64; 3]],
    (reach, watch): (f64, f64),
) -> Vec<LayerConstraint> {
    let end = outfit.vertex_count() as u32;
    let look = |inner: usize, vertex: u32| {
        let (p, away) = (positions[vertex as usize], outward[vertex as usize]);
        if away == [0.0; 3] {
            return None;
        }
        let along = bounds([add_scaled(p, -watch, away), add_scaled(p, reach, away)]);
        let first = outfit.faces_of_garment(inner).start;
        let mut outermost = OutermostSheet { from: p, away, heights: -watch..=reach, found: None };
        for f in trees[inner].faces_in_box(along) {
            outermost.offer(first + f, outfit.faces[(first + f) as usize], positions, outward);
        }
        outermost.over(vertex, outfit, positions)
    };
    (0..outfit.len().saturating_sub(1))
        .flat_map(|inner| {
            let outer = (outfit.vertices(inner).end..end).into_par_iter().with_min_len(256);
            outer.filter_map(|vertex| look(inner, vertex)).collect::<Vec<_>>()
        })
        .collect()
}

/// Of the sheets of one garment that a vertex sees along its direction away from the body, the outermost.
pub(super) struct OutermostSheet {
    /// The vertex (m).
    pub from: [f64; 3],
    /// Its direction away from the body.
    pub away: [f64; 3],
    /// How far along that direction a sheet may be (m).
    pub heights: RangeInclusive<f64>,
    /// Height (m), number and place of the outermost face so far.
    pub found: Option<(f64, u32, [f64; 3])>,
}

impl OutermostSheet {
    /// Looks at face number `f`, unless it lies over another part of the body.
    pub fn offer(&mut self, f: u32, face: [u32; 3], positions: &[[f64; 3]], outward: &[[f64; 3]]) {
        let sheet = sum_over(face, outward);
        if dot(sheet, self.away) < SAME_PART * norm(sheet) {
            return;
        }
        let corners = face.map(|v| positions[v as usize]);
        let Some((above, at)) = along_line(self.from, self.away, &corners) else { return };
        let is_farther =
            self.found.is_none_or(|(most, known, _)| above > most || (above == most && f < known));
        if self.heights.contains(&above) && is_farther {
            self.found = Some((above, f, at));
        }
    }

    /// What `vertex` has to stay over.
    pub fn over(
        self,
        vertex: u32,
        outfit: &PackedCloth<'_>,
        positions: &[[f64; 3]],
    ) -> Option<LayerConstraint> {
        let (above, f, barycentric) = self.found?;
        let face = outfit.faces[f as usize];
        let normal = sheet_normal(&face.map(|v| positions[v as usize]), self.away);
        Some(LayerConstraint { vertex, face, barycentric, normal, height: -above * dot(normal, self.away) })
    }
}

/// Along which direction what lies over a sheet leaves it: its normal on the side of `away`, or that where the sheet is steep.
fn sheet_normal(sheet: &Triangle, away: [f64; 3]) -> [f64; 3] {
    let normal = normal_of(sheet);
    match dot(normal, away) {
        slope if slope > STEEP => normal,
        slope if slope < -STEEP => neg(normal),
        _ => away,
    }
}

/// The direction along which the first of two triangles has to lie over the second, by their directions away from the body; none
/// where nothing says so. Where they look at each other (a sleeve and the side of the chest) each has to stay on its own part's
/// side, whichever garments they belong to; otherwise the outer garment lies over the inner one, and two folds of one garment have
/// no order.
pub(super) fn order(
    first: [u32; 3],
    second: [u32; 3],
    is_outer: bool,
    outward: &[[f64; 3]],
) -> Option<[f64; 3]> {
    let [a, b] = [first, second].map(|face| normalized(sum_over(face, outward)));
    match dot(a, b) {
        _ if a == [0.0; 3] || b == [0.0; 3] => None,
        c if c < FACING_SHEETS => Some(normalized(sub(b, a))),
        _ if is_outer => Some(normalized(add(a, b))),
        _ => None,
    }
}

/// The sum of what the corners of a face have.
pub(super) fn sum_over(face: [u32; 3], values: &[[f64; 3]]) -> [f64; 3] {
    face.iter().fold([0.0; 3], |sum, &v| add(sum, values[v as usize]))
}

/// Conditions for two intersecting triangles: the first has to lie `gap` over the second along `away`, as far as they cover each
/// other.
pub(super) fn part_along(
    away: [f64; 3],
    first: [u32; 3],
    second: [u32; 3],
    positions: &[[f64; 3]],
    gap: f64,
    longest_step: f64,
    found: &mut Vec<Condition>,
) {
    let upper = first.map(|v| positions[v as usize]);
    let lower = second.map(|v| positions[v as usize]);
    if is_tiny(&lower) {
        return;
    }
    let steepness = |t: &Triangle| {
        let normal = normal_of(t);
        let slope = dot(normal, away);
        (slope.abs(), if slope < 0.0 { neg(normal) } else { normal })
    };
    // Along the flatter of the two normals, where one is flat: that is the shortest way apart.
    let (under, over) = (steepness(&lower), steepness(&upper));
    let flatter = if under.0 >= over.0 { under } else { over };
    let normal = if flatter.0 > STEEP { flatter.1 } else { away };
    for corner in overlap(&upper, &lower, normal).iter().filter(|c| c.height < gap) {
        let target = gap.min(corner.height + longest_step);
        found.push(Condition::face_points(
            (first, corner.at_upper),
            (second, corner.at_lower),
            normal,
            target,
        ));
    }
}

/// The part of a face that lies over triangle `ground` of the body has to come `gap` out of it, at most `longest_step` at once.
pub(super) fn part_from_body(
    face: [u32; 3],
    positions: &[[f64; 3]],
    ground: &Triangle,
    (gap, longest_step): (f64, f64),
    found: &mut Vec<Condition>,
) {
    let (upper, normal) = (face.map(|v| positions[v as usize]), normal_of(ground));
    // Of the ground under a corner, as a height along the normal.
    let level = dot(normal, ground[0]);
    for corner in overlap(&upper, ground, normal).iter().filter(|corner| corner.height < gap) {
        let target = level + gap.min(corner.height + longest_step);
        found.push(Condition::new(face, corner.at_upper, normal, target));
    }
}

/// Directions away from the body of all garments, by packed vertex: their normals on the side that most of `away` (from the
/// body's surface, zero where unknown) say for a component, smoothed over wrinkles. Unlike the direction from the nearest
/// point of the body they do not change where cloth has gone through other cloth towards another part of the body.
pub(super) fn outward(
    outfit: &PackedCloth<'_>,
    positions: &[[f64; 3]],
    away: impl Fn(u32) -> [f64; 3],
) -> Vec<[f64; 3]> {
    let mut all: Vec<[f64; 3]> = Vec::with_capacity(positions.len());
    for g in 0..outfit.len() {
        let (garment, start) = (outfit.layers[g].garment, outfit.vertices(g).start);
        let own = outfit.part(positions, g);
        let facing = garment.layer.facing(own, &garment.faces, |v| away(start + v as u32));
        let normals = vertex_normals(own, &garment.faces);
        all.extend(normals.iter().zip(&facing).map(|(normal, side)| scale(*normal, *side)));
    }
    for _ in 0..SMOOTHED_RINGS {
        all = (0..all.len() as u32)
            .into_par_iter()
            .with_min_len(512)
            .map(|v| normalized(outfit.ring(v).fold(all[v as usize], |sum, n| add(sum, all[n as usize]))))
            .collect();
    }
    all
}
