//! The places of one garment where folds are laid out: each is tried by itself and only kept where it helps.

use super::super::Layer;
use super::super::obstacle::BodyObstacle;
use super::super::outfit::Outfit;
use crate::contact::self_triangle_pairs;
use crate::vec3::{add, add_scaled, scale, sub};

/// Sweeps of the smoothing…
const SWEEPS: usize = 100;
/// …and its over-relaxation.
const OVER: f64 = 1.7;

/// How far around crossings cloth is laid out (m): farther where some are left.
const REACH: [f64; 3] = [0.03, 0.06, 0.12];
/// Crossings so near to those of the skinned garment, and to others where the body is pinched, are left (m): in a closed crease
/// skinning folds cloth as well, and is of no help.
const CREASE: f64 = 0.06;
/// A place is laid out if at most this share of its crossings is left.
const LEFT: f64 = 0.5;
/// Fewest and most rings of neighbours for these distances.
const RINGS: (usize, usize) = (2, 40);
/// What is laid out may raise the strain energy of a garment by this share: a fold that holds more is none to take
/// away. The cloth under a bust that a network folds up over it holds 15 to 30 % in a tight garment…
pub(super) const STRAINED: f64 = 0.5;
/// …but a place where the body is pinched only by this one: there is hardly any room to lay cloth out in.
const STRAINED_WHERE_PINCHED: f64 = 0.1;

/// The folds of one garment that crosses itself in `all` these pairs of faces: vertices, ascending.
pub(super) fn folded(
    body: &BodyObstacle<'_>,
    layer: Layer<'_>,
    skinned: &[[f64; 3]],
    all: &[(u32, u32)],
) -> Vec<u32> {
    if all.is_empty() {
        return Vec::new();
    }
    let outfit = Outfit::new(std::slice::from_ref(&layer));
    let mut cloth = Cloth::new(body, &outfit, skinned, all);
    for reach in REACH {
        if !cloth.left.is_empty() {
            cloth.lay_out(reach);
        }
    }
    // What is laid out in one place may be in the way of another one.
    match self_triangle_pairs(&cloth.positions, layer.garment.faces()).len() < all.len() {
        true => cloth.region,
        false => Vec::new(),
    }
}

/// A garment that is laid out place by place.
struct Cloth<'a> {
    /// The garment alone, as it is draped.
    outfit: &'a Outfit<'a>,
    skinned: &'a [[f64; 3]],
    /// Vertices in a closed crease: they are left, since skinning folds the garment there as well.
    is_in_crease: Vec<bool>,
    /// Strain energy of the drape (J).
    energy: f64,
    /// Crossings of the drape outside of creases…
    found: Vec<(u32, u32)>,
    /// …and those of them where the body is pinched.
    pinched: Vec<(u32, u32)>,
    /// Vertices that are laid out so far, ascending,…
    region: Vec<u32>,
    /// …where that puts the garment,…
    positions: Vec<[f64; 3]>,
    /// …crossings outside of creases that are left there,…
    left: Vec<(u32, u32)>,
    /// …and the corners of all that ever were.
    seeds: Vec<u32>,
}

impl<'a> Cloth<'a> {
    /// The lone garment of `outfit`, which crosses itself in `all` these pairs, with nothing laid out.
    fn new(
        body: &BodyObstacle<'_>,
        outfit: &'a Outfit<'a>,
        skinned: &'a [[f64; 3]],
        all: &[(u32, u32)],
    ) -> Self {
        let layer = outfit.layers[0];
        let faces = layer.garment.faces();
        let skinned_too = self_triangle_pairs(skinned, faces);
        let closed =
            [pinched(body, all, layer.positions, faces), pinched(body, &skinned_too, skinned, faces)]
                .concat();
        let [closed, skinned_too] =
            [closed, skinned_too].map(|pairs| near(outfit, &pairs, rings(outfit, CREASE)));
        let mut cloth = Self {
            outfit,
            skinned,
            is_in_crease: closed.iter().zip(&skinned_too).map(|(c, s)| *c && *s).collect(),
            energy: layer.garment.strain_energy(layer.positions),
            found: Vec::new(),
            pinched: Vec::new(),
            region: Vec::new(),
            positions: layer.positions.to_vec(),
            left: Vec::new(),
            seeds: Vec::new(),
        };
        cloth.left = cloth.crossings(layer.positions);
        cloth.found.clone_from(&cloth.left);
        cloth.pinched = pinched(body, &cloth.found, layer.positions, faces);
        cloth
    }

    fn faces(&self) -> &'a [[u32; 3]] {
        self.outfit.layers[0].garment.faces()
    }

    /// Crossings at `positions` outside of creases.
    fn crossings(&self, positions: &[[f64; 3]]) -> Vec<(u32, u32)> {
        let faces = self.faces();
        let is_outside = |f: u32| !faces[f as usize].iter().any(|&v| self.is_in_crease[v as usize]);
        let mut pairs = self_triangle_pairs(positions, faces);
        pairs.retain(|&(f, g)| is_outside(f) && is_outside(g));
        pairs
    }

    /// Lays out what is left within `reach` (m) of crossings.
    fn lay_out(&mut self, reach: f64) {
        self.seeds.extend(corners(&self.left, self.faces()));
        let around = self.outfit.neighbourhood(&self.seeds, rings(self.outfit, reach));
        let mut wider = self.region.clone();
        let crossed =
            places(self.outfit, &around).into_iter().filter(|place| self.count(&self.left, place) > 0);
        crossed.for_each(|place| wider.extend(place));
        wider.sort_unstable();
        wider.dedup();
        let (mut now, tried) = self.slack(&wider);
        let then = self.crossings(&now);
        for place in tried {
            let [before, last, then] =
                [&self.found, &self.left, &then].map(|pairs| self.count(pairs, &place));
            if then < last && then as f64 <= LEFT * before as f64 {
                self.region.extend(place);
            } else {
                take(&mut now, &place, &self.positions);
            }
        }
        self.region.sort_unstable();
        self.region.dedup();
        self.left = self.crossings(&now);
        self.positions = now;
    }

    /// The garment with those places of `wider` laid out that the strain energy allows, and these places.
    fn slack(&self, wider: &[u32]) -> (Vec<[f64; 3]>, Vec<Vec<u32>>) {
        // No edge joins two places: what is smoothest in one does not depend on the others.
        let smooth = smoothed(self.outfit, self.skinned, wider);
        let strain_energy = |positions: &[[f64; 3]]| self.outfit.layers[0].garment.strain_energy(positions);
        let mut now = self.positions.clone();
        let mut strained = strain_energy(&now);
        let mut slack = places(self.outfit, wider);
        slack.retain(|place| {
            take(&mut now, place, &smooth);
            let then = strain_energy(&now);
            let is_pinched = self.count(&self.pinched, place) > 0;
            let is_slack = then <= (1.0 + STRAINED) * self.energy
                && (!is_pinched || then <= strained + STRAINED_WHERE_PINCHED * self.energy);
            if is_slack {
                strained = then;
            } else {
                take(&mut now, place, &self.positions);
            }
            is_slack
        });
        (now, slack)
    }

    /// How many `pairs` of faces have a vertex in `place`.
    fn count(&self, pairs: &[(u32, u32)], place: &[u32]) -> usize {
        let faces = self.faces();
        let mut is_here = vec![false; self.outfit.vertex_count()];
        place.iter().for_each(|&v| is_here[v as usize] = true);
        let is_in = |f: u32| faces[f as usize].iter().any(|&v| is_here[v as usize]);
        pairs.iter().filter(|&&(f, g)| is_in(f) || is_in(g)).count()
    }
}

/// Moves the vertices of `place` to where they are `from`.
fn take(positions: &mut [[f64; 3]], place: &[u32], from: &[[f64; 3]]) {
    place.iter().for_each(|&v| positions[v as usize] = from[v as usize]);
}

/// Rings of neighbours that reach about so far (m) in the lone garment of `outfit`.
fn rings(outfit: &Outfit<'_>, reach: f64) -> usize {
    let lengths = &outfit.layers[0].garment.edge_lengths;
    let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
    ((reach / mean).ceil() as usize).clamp(RINGS.0, RINGS.1)
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
pub(super) fn smoothed(outfit: &Outfit<'_>, skinned: &[[f64; 3]], region: &[u32]) -> Vec<[f64; 3]> {
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
