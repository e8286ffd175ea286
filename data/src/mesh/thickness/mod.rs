//! Cloth with thickness: two sheets that face away from each other, with rims between them. The outer sheet is the garment.

mod facing;
mod labels;

use crate::mesh::clean::{diagonal, pieces};
use clothcombo_physics::query::ClosestPoint;
use clothcombo_physics::vec3::{norm, sub};
use facing::{Opposite, centre_and_normal, opposite};
use labels::{OUTER, label};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// Cloth is thinner than this share of the diagonal: 25 mm for a garment of a metre.
const MOST_SHARE: f64 = 0.025;
/// Faces of which the thickness is measured to find out whether there is any.
const SAMPLED_FACES: usize = 400;
/// Share of the area that faces another sheet, from which cloth is thick.
const THICK_SHARE: f64 = 0.7;
/// A surface is nearly closed if its border is shorter than this many times the root of its area.
const NEARLY_CLOSED: f64 = 0.2;
/// A piece with a larger share of the area is no button or pocket.
const LARGE_PIECE: f64 = 0.1;
/// Thickness varies up to this many times the median.
const VARIATION: f64 = 3.0;
/// Pieces of the outer sheet with a smaller share of its area are bits of rims.
const BIT_SHARE: f64 = 0.005;

/// The median thickness if `faces` are cloth with thickness (in the unit of the positions): most of the area has a sheet behind
/// it that faces the other way, and the surface is closed but for small holes, or the sheets are pieces of their own.
pub fn thickness(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Option<f64> {
    let limit = MOST_SHARE * diagonal(positions);
    if faces.is_empty() || !(limit > 0.0 && limit.is_finite()) {
        return None;
    }
    let surface = ClosestPoint::new(positions.to_vec(), faces);
    let mut pieces = pieces(faces, positions.len());
    let step = (faces.len() / SAMPLED_FACES).max(1);
    let sampled: Vec<u32> = (0..faces.len() as u32).step_by(step).collect();
    let found: Vec<Option<Opposite>> =
        sampled.par_iter().map(|f| opposite(&surface, positions, faces, *f, limit)).collect();
    let (mut all, mut thick, mut across) = (0.0, 0.0, 0.0);
    let mut distances = Vec::new();
    for (f, found) in sampled.iter().zip(found) {
        let area = norm(centre_and_normal(positions, faces[*f as usize]).1);
        all += area;
        if let Some(found) = found {
            thick += area;
            distances.push(found.distance);
            let [one, other] = [*f, found.face].map(|f| pieces.root(faces[f as usize][0]));
            across += if one == other { 0.0 } else { area };
        }
    }
    let is_thick = thick >= THICK_SHARE * all && thick > 0.0;
    let is_two_sheets = || border_share(positions, faces) < NEARLY_CLOSED || across >= THICK_SHARE * thick;
    if !is_thick || !is_two_sheets() {
        return None;
    }
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied()
}

/// The median distance if `faces` are several pieces that lie in each other, however their faces look (in the unit of the
/// positions): most of the area has another large piece next to it.
pub fn sheets(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Option<f64> {
    let limit = MOST_SHARE * diagonal(positions);
    let mut pieces = pieces(faces, positions.len());
    let area = |f: &[u32; 3]| norm(centre_and_normal(positions, *f).1);
    let mut of_piece: BTreeMap<u32, (f64, Vec<[u32; 3]>)> = BTreeMap::new();
    for f in faces {
        let (total, list) = of_piece.entry(pieces.root(f[0])).or_default();
        *total += area(f);
        list.push(*f);
    }
    let all: f64 = of_piece.values().map(|(area, _)| area).sum();
    let large: Vec<Vec<[u32; 3]>> =
        of_piece.into_values().filter(|(area, _)| *area > LARGE_PIECE * all).map(|(_, list)| list).collect();
    if large.len() < 2 || !(limit > 0.0 && limit.is_finite()) {
        return None;
    }
    let surfaces: Vec<ClosestPoint> =
        large.iter().map(|list| ClosestPoint::new(positions.to_vec(), list)).collect();
    let (mut near, mut sampled, mut distances) = (0.0, 0.0, Vec::new());
    for (own, list) in large.iter().enumerate() {
        for f in list.iter().step_by((faces.len() / SAMPLED_FACES).max(1)) {
            let centre = centre_and_normal(positions, *f).0;
            let others = surfaces.iter().enumerate().filter(|(other, _)| *other != own);
            let distance = others
                .filter_map(|(_, s)| s.project_within(centre, limit))
                .map(|p| p.distance_squared.sqrt())
                .fold(f64::MAX, f64::min);
            sampled += area(f);
            if distance < limit {
                near += area(f);
                distances.push(distance);
            }
        }
    }
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied().filter(|_| near >= THICK_SHARE * sampled)
}

/// Length of the border over the root of the area.
fn border_share(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> f64 {
    let mut uses: HashMap<[u32; 2], u32> = HashMap::with_capacity(2 * faces.len());
    for [a, b, c] in faces {
        for (a, b) in [(a, b), (b, c), (c, a)] {
            *uses.entry([*a.min(b), *a.max(b)]).or_default() += 1;
        }
    }
    let length = |[a, b]: &[u32; 2]| norm(sub(positions[*a as usize], positions[*b as usize]));
    let border: f64 = uses.iter().filter(|(_, n)| **n == 1).map(|(edge, _)| length(edge)).sum();
    let area: f64 = faces.iter().map(|f| 0.5 * norm(centre_and_normal(positions, *f).1)).sum();
    border / area.sqrt()
}

/// The faces of the outer sheet of cloth with thickness, ascending; none if no two sheets can be told apart.
pub fn outer_sheet(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<u32> {
    let limit = MOST_SHARE * diagonal(positions);
    let surface = ClosestPoint::new(positions.to_vec(), faces);
    let mut found: Vec<Option<Opposite>> = (0..faces.len() as u32)
        .into_par_iter()
        .map(|f| opposite(&surface, positions, faces, f, limit))
        .collect();
    let mut distances: Vec<f64> = found.iter().flatten().map(|o| o.distance).collect();
    if distances.is_empty() {
        return Vec::new();
    }
    distances.sort_by(f64::total_cmp);
    let most = VARIATION * distances[distances.len() / 2];
    found.iter_mut().for_each(|o| *o = o.filter(|o| o.distance <= most));
    let labels = label(positions, faces, &found);
    let outer: Vec<u32> = (0..faces.len() as u32).filter(|f| labels[*f as usize] == OUTER).collect();
    without_bits(positions, faces, outer)
}

fn without_bits(positions: &[[f64; 3]], faces: &[[u32; 3]], outer: Vec<u32>) -> Vec<u32> {
    let mut pieces = pieces(outer.iter().map(|f| &faces[*f as usize]), positions.len());
    let area = |f: u32| norm(centre_and_normal(positions, faces[f as usize]).1);
    let mut areas = vec![0.0; positions.len()];
    outer.iter().for_each(|f| areas[pieces.root(faces[*f as usize][0]) as usize] += area(*f));
    let least = BIT_SHARE * areas.iter().sum::<f64>();
    outer.into_iter().filter(|f| areas[pieces.root(faces[*f as usize][0]) as usize] >= least).collect()
}

#[cfg(test)]
pub(crate) mod tests;
