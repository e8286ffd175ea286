//! Cloth that a drape folds into itself is laid out, before anything else.
//!
//! What a network adds to a skinned garment is smooth, but where it folds cloth: on a body unlike those it was trained on, or
//! where garments press on each other. No sheet over such a fold can tell its outside from its inside. Around it what is added
//! is replaced by what is smoothest between its surroundings, a harmonic function on the edges: the fold goes, the distance to
//! the body and to other garments stays about what it is next to it.

use rayon::prelude::*;

use super::body::with_drawn;
use super::obstacle::BodyObstacle;
use super::outfit::Outfit;
use super::{Layer, Waypoint, at};
use crate::contact::self_triangle_pairs;
use crate::query::Surface;
use crate::vec3::{add, add_scaled, scale, sub};

/// How far around crossings cloth is laid out [m]: farther where some are left.
const REACH: [f64; 3] = [0.03, 0.06, 0.12];
/// Crossings so near to those of the skinned garment, and to others where the body is pinched, are left [m]: in a closed crease
/// skinning folds cloth as well, and is of no help.
const CREASE: f64 = 0.06;
/// A place is laid out if at most this share of its crossings is left.
const LEFT: f64 = 0.5;
/// Fewest and most rings of neighbours for these distances.
const RINGS: (usize, usize) = (2, 40);
/// What is laid out may raise the strain energy of a garment by this share: a fold that holds more is none to take away. The cloth
/// under a bust that a network folds up over it holds 15 to 30 % in a tight garment…
const STRAINED: f64 = 0.5;
/// …but a place where the body is pinched only by this one: there is hardly any room to lay cloth out in.
const STRAINED_WHERE_PINCHED: f64 = 0.1;
/// Sweeps of the smoothing…
const SWEEPS: usize = 100;
/// …and its over-relaxation.
const OVER: f64 = 1.7;

/// Where garments are to be laid out: vertices of each, ascending.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Folds(Vec<Vec<u32>>);

impl Folds {
    /// Around crossings of every garment with itself, where at most half of them are left when it is laid out on `body`.
    pub fn of(body: &Surface<f64>, layers: &[Layer<'_>], skinned: &[Vec<[f64; 3]>]) -> Self {
        let crossings = |layer: &Layer<'_>| self_triangle_pairs(layer.positions, layer.garment.faces());
        let crossings: Vec<Vec<(u32, u32)>> = layers.par_iter().map(crossings).collect();
        // Most drapes have none, and a body takes long to prepare.
        if crossings.iter().all(Vec::is_empty) {
            return Self(vec![Vec::new(); layers.len()]);
        }
        let folded = |body: BodyObstacle<'_>| {
            let garments = layers.par_iter().zip(skinned).zip(&crossings);
            garments.map(|((layer, skinned), all)| folded(&body, *layer, skinned, all)).collect()
        };
        Self(with_drawn(body, layers, folded))
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(Vec::is_empty)
    }

    /// Adds those of the same garments in another pose, so that what is laid out in one is in the other.
    pub fn add(&mut self, others: &Self) {
        for (folds, more) in self.0.iter_mut().zip(&others.0) {
            folds.extend(more);
            folds.sort_unstable();
            folds.dedup();
        }
    }

    /// The garments without them.
    pub fn laid_out(&self, layers: &[Layer<'_>], skinned: &[Vec<[f64; 3]>]) -> Vec<Vec<[f64; 3]>> {
        let garments = layers.par_iter().zip(skinned).zip(&self.0);
        let laid_out = garments.map(|((layer, skinned), region)| match region.as_slice() {
            [] => layer.positions.to_vec(),
            region => smoothed(&Outfit::new(std::slice::from_ref(layer)), skinned, region),
        });
        laid_out.collect()
    }

    /// The drape of `layers` at `stage` without them.
    pub fn laid_out_at(&self, mut stage: Waypoint, layers: &[Layer<'_>]) -> Waypoint {
        if !self.is_empty() {
            stage.draped = self.laid_out(&at(layers, &stage.draped), &stage.skinned);
        }
        stage
    }
}

/// The folds of one garment that crosses itself in `all` these pairs of faces.
fn folded(body: &BodyObstacle<'_>, layer: Layer<'_>, skinned: &[[f64; 3]], all: &[(u32, u32)]) -> Vec<u32> {
    if all.is_empty() {
        return Vec::new();
    }
    let garment = layer.garment;
    let faces = garment.faces();
    let outfit = Outfit::new(std::slice::from_ref(&layer));
    let length = garment.edge_lengths.iter().sum::<f64>() / garment.edge_lengths.len() as f64;
    let rings = |reach: f64| ((reach / length).ceil() as usize).clamp(RINGS.0, RINGS.1);
    // What lies in a closed crease is left: there skinning folds the garment as well.
    let skinned_too = self_triangle_pairs(skinned, faces);
    let closed =
        [pinched(body, all, layer.positions, faces), pinched(body, &skinned_too, skinned, faces)].concat();
    let [closed, skinned_too] = [closed, skinned_too].map(|pairs| near(&outfit, &pairs, rings(CREASE)));
    let is_outside =
        |f: u32| !faces[f as usize].iter().any(|&v| closed[v as usize] && skinned_too[v as usize]);
    let crossings = |positions: &[[f64; 3]]| {
        let mut pairs = self_triangle_pairs(positions, faces);
        pairs.retain(|&(f, g)| is_outside(f) && is_outside(g));
        pairs
    };
    let found = crossings(layer.positions);
    let pinched = pinched(body, &found, layer.positions, faces);
    let energy = garment.strain_energy(layer.positions);
    let count = |pairs: &[(u32, u32)], place: &[u32]| count_at(pairs, place, &outfit);
    let (mut seeds, mut region) = (Vec::new(), Vec::new());
    let (mut laid_out, mut left) = (layer.positions.to_vec(), found.clone());
    for reach in REACH {
        if left.is_empty() {
            break;
        }
        seeds.extend(corners(&left, faces));
        let around = places(&outfit, &outfit.neighbourhood(&seeds, rings(reach)));
        let mut wider = region.clone();
        around.into_iter().filter(|place| count(&left, place) > 0).for_each(|place| wider.extend(place));
        wider.sort_unstable();
        wider.dedup();
        // No edge joins two places: what is smoothest in one does not depend on the others.
        let smooth = smoothed(&outfit, skinned, &wider);
        let mut now = laid_out.clone();
        let mut take = |place: &[u32], from: &[[f64; 3]]| {
            place.iter().for_each(|&v| now[v as usize] = from[v as usize]);
            garment.strain_energy(&now)
        };
        let mut strained = garment.strain_energy(&laid_out);
        let is_slack = |place: &Vec<u32>| {
            let then = take(place, &smooth);
            let is_closed = count(&pinched, place) > 0;
            let is_slack = then <= (1.0 + STRAINED) * energy
                && (!is_closed || then <= strained + STRAINED_WHERE_PINCHED * energy);
            strained = if is_slack { then } else { take(place, &laid_out) };
            is_slack
        };
        let tried: Vec<Vec<u32>> = places(&outfit, &wider).into_iter().filter(is_slack).collect();
        let then = crossings(&now);
        for place in tried {
            let [before, last, then] = [&found, &left, &then].map(|pairs| count(pairs, &place));
            if then < last && then as f64 <= LEFT * before as f64 {
                region.extend(place);
            } else {
                place.iter().for_each(|&v| now[v as usize] = laid_out[v as usize]);
            }
        }
        region.sort_unstable();
        region.dedup();
        left = crossings(&now);
        laid_out = now;
    }
    // What is laid out in one place may be in the way of another one.
    if self_triangle_pairs(&laid_out, faces).len() < all.len() { region } else { Vec::new() }
}

/// Those of `pairs` of faces, at `positions`, of which one lies where `body` is pinched.
fn pinched(
    body: &BodyObstacle<'_>,
    pairs: &[(u32, u32)],
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
) -> Vec<(u32, u32)> {
    let is_pinched = |f: u32| body.is_pinch_at(&faces[f as usize].map(|v| positions[v as usize]));
    pairs.iter().copied().filter(|&(f, g)| is_pinched(f) || is_pinched(g)).collect()
}

/// The vertices of all `pairs` of faces.
fn corners(pairs: &[(u32, u32)], faces: &[[u32; 3]]) -> Vec<u32> {
    pairs.iter().flat_map(|&(f, g)| [f, g]).flat_map(|f| faces[f as usize]).collect()
}

/// Which vertices of the lone garment of `outfit` are within so many `rings` of `pairs` of its faces.
fn near(outfit: &Outfit<'_>, pairs: &[(u32, u32)], rings: usize) -> Vec<bool> {
    let mut is_near = vec![false; outfit.vertex_count()];
    let around = outfit.neighbourhood(&corners(pairs, outfit.layers[0].garment.faces()), rings);
    around.iter().for_each(|&v| is_near[v as usize] = true);
    is_near
}

/// How many `pairs` of faces of the lone garment of `outfit` have a vertex in `place`.
fn count_at(pairs: &[(u32, u32)], place: &[u32], outfit: &Outfit<'_>) -> usize {
    let faces = outfit.layers[0].garment.faces();
    let mut is_here = vec![false; outfit.vertex_count()];
    place.iter().for_each(|&v| is_here[v as usize] = true);
    let is_in = |f: u32| faces[f as usize].iter().any(|&v| is_here[v as usize]);
    pairs.iter().filter(|&&(f, g)| is_in(f) || is_in(g)).count()
}

/// The parts of a region of the lone garment of `outfit` that hang together.
fn places(outfit: &Outfit<'_>, region: &[u32]) -> Vec<Vec<u32>> {
    let mut is_left = vec![false; outfit.vertex_count()];
    region.iter().for_each(|&v| is_left[v as usize] = true);
    let mut places = Vec::new();
    for &start in region {
        if !std::mem::replace(&mut is_left[start as usize], false) {
            continue;
        }
        let (mut place, mut next) = (vec![start], 0);
        while let Some(&v) = place.get(next) {
            place.extend(outfit.ring(v).filter(|&n| std::mem::replace(&mut is_left[n as usize], false)));
            next += 1;
        }
        places.push(place);
    }
    places
}

/// The lone garment of `outfit` with what it adds to `skinned` harmonic in `region`: over-relaxed Gauss–Seidel in a fixed order.
fn smoothed(outfit: &Outfit<'_>, skinned: &[[f64; 3]], region: &[u32]) -> Vec<[f64; 3]> {
    let mut positions = outfit.layers[0].positions.to_vec();
    let mut added: Vec<[f64; 3]> = positions.iter().zip(skinned).map(|(p, s)| sub(*p, *s)).collect();
    for _ in 0..SWEEPS {
        for &v in region {
            let ring = outfit.ring(v);
            let share = 1.0 / ring.len().max(1) as f64;
            let mean = scale(ring.fold([0.0; 3], |sum, n| add(sum, added[n as usize])), share);
            let now = added[v as usize];
            added[v as usize] = add_scaled(now, OVER, sub(mean, now));
        }
    }
    for &v in region {
        positions[v as usize] = add(skinned[v as usize], added[v as usize]);
    }
    positions
}

#[cfg(test)]
pub(super) mod tests;
