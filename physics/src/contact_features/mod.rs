//! Contact features of every vertex of an outfit: where it lies against the garments under and over it and against the body,
//! and the elastic forces of its own cloth. They are the input of the networks that correct how garments lie.
//!
//! ```text
//! height    smoothed signed height of a point over a garment near it
//! forces    elastic forces, as displacements
//! rings     neighbours of every vertex, and means over them
//! mod       features and directions of all vertices
//! ```
//!
//! The features are invariant under rigid motions of the whole scene; the directions turn with it. They are not
//! differentiable functions here: a network takes them as given.

mod forces;
mod height;
mod rings;

use rayon::prelude::*;

use crate::energy::{SceneEnergy, SceneGarment};
use crate::query::{Distance, Surface};
use crate::vec3::{add_scaled, dot, norm, scale, to_f64, zero};
use height::{Height, PosedGarment, height};

pub use rings::Rings;

/// Features of one vertex, before they are averaged over its surroundings.
const LOCAL_FEATURES: usize = 2 * LAYER_FEATURES + 2;
/// Of them, those of the garments on one side of the vertex.
const LAYER_FEATURES: usize = 7;
/// Averaging passes between one scale and the next.
const PASSES: [usize; 2] = [4, 16];
/// Features per vertex: its own, the means over two sizes of its surroundings, and length and normal part of the elastic
/// forces at each of their scales.
pub const FEATURES: usize = LOCAL_FEATURES * (1 + PASSES.len()) + 2 * forces::SCALES;
/// Directions per vertex: out of the garments under it, out of those over it, out of its own garment, out of the body, and the
/// displacements that forces stand for.
pub const DIRECTIONS: usize = OUTWARD_DIRECTIONS + forces::SCALES;
const OUTWARD_DIRECTIONS: usize = 4;

/// Heights below this over an inner garment, or under an outer one, are too small (m).
const WANTED_HEIGHT: f64 = 0.004;
/// Unit of the lengths among the features (m), and how many of it they come to at most.
const UNIT: f64 = 0.01;
const MOST: f64 = 5.0;
/// Weight in the mean direction of a garment that is near, but where it should be, against a centimetre too little.
const AT_REST: f64 = 0.05;

/// Contact features of all vertices of an outfit.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactFeatures {
    /// Dimensionless features `[ΣV, FEATURES]`, row by row.
    pub features: Vec<f32>,
    /// Directions of about length 1 `[DIRECTIONS][ΣV, 3]`; zero where nothing is near.
    pub directions: [Vec<[f32; 3]>; DIRECTIONS],
}

/// The garments on one side of a vertex: those under it, or those over it.
struct LayerSide {
    /// Sum over the garments of how much is missing to [`WANTED_HEIGHT`], and the most (cm).
    missing: [f64; 2],
    /// How many garments are near, each counted by how near.
    near: f64,
    /// Least height in the right order (cm); [`MOST`] without any garment.
    least: f64,
    /// How far beyond the hem of the garment with the largest weight (cm).
    beside: f64,
    /// Mean direction out of the garments.
    direction: [f64; 3],
}

impl ContactFeatures {
    /// Those of the garments of `scene` at `posed` `[ΣV, 3]` (m); `rings` are their neighbourhoods, and `interactions` the
    /// pairs (inner, outer) that are features of each other.
    ///
    /// Positions that are not finite make features that are not finite, at least at their own vertices.
    ///
    /// # Panics
    /// If the lengths are not those of the scene.
    pub fn new<'a>(
        scene: &SceneEnergy<f32>,
        rings: &[&'a Rings],
        posed: &[[f32; 3]],
        interactions: &[(usize, usize)],
    ) -> Self {
        let parts: Vec<&[[f32; 3]]> = scene.ranges().into_iter().map(|range| &posed[range]).collect();
        let posed_garment = |((part, rings), garment): ((&&[[f32; 3]], &&'a Rings), &SceneGarment<f32>)| {
            let mesh = garment.energies.as_inner();
            let surface = Surface::new(part.to_vec(), mesh.faces().clone());
            PosedGarment::new(surface, rings, mesh.median_edge())
        };
        let garments: Vec<PosedGarment<'_>> =
            parts.iter().zip(rings).zip(&scene.garments).map(posed_garment).collect();
        let mut all = Self {
            features: Vec::with_capacity(FEATURES * posed.len()),
            directions: std::array::from_fn(|_| Vec::with_capacity(posed.len())),
        };
        for (i, (garment, own)) in scene.garments.iter().zip(&garments).enumerate() {
            let below: Vec<&PosedGarment<'_>> =
                interactions.iter().filter(|c| c.1 == i).map(|c| &garments[c.0]).collect();
            let above: Vec<&PosedGarment<'_>> =
                interactions.iter().filter(|c| c.0 == i).map(|c| &garments[c.1]).collect();
            let local: Vec<Local> = (0..own.surface.positions.len())
                .into_par_iter()
                .with_min_len(64)
                .map(|v| Local::new(&scene.body, &own.surface, v, [&below, &above]))
                .collect();
            let scales = scales(local.iter().map(|local| local.features).collect(), own.rings);
            let forces = forces::relaxing(garment, &scene.settings, own.rings, parts[i]);
            for (v, Local { directions, .. }) in local.iter().enumerate() {
                let of_force = |f: &Vec<[f64; 3]>| [norm(f[v]), dot(f[v], to_f64(own.surface.normals[v]))];
                let features =
                    scales.iter().flat_map(|scale| scale[v]).chain(forces.iter().flat_map(of_force));
                all.features.extend(features.map(|x| x as f32));
                let directions = directions.iter().copied().chain(forces.iter().map(|f| f[v]));
                for (column, direction) in all.directions.iter_mut().zip(directions) {
                    column.push(direction.map(|x| x as f32));
                }
            }
        }
        all
    }
}

/// One vertex, before averages and forces.
struct Local {
    features: [f64; LOCAL_FEATURES],
    directions: [[f64; 3]; OUTWARD_DIRECTIONS],
}

impl Local {
    /// Vertex `v` of the garment `own`, of which some others lie below and above.
    fn new(body: &Surface<f32>, own: &Surface<f32>, v: usize, others: [&[&PosedGarment<'_>]; 2]) -> Self {
        let (position, normal) = (own.positions[v], to_f64(own.normals[v]));
        let side = |garments: &[&PosedGarment<'_>], outwards: f64| {
            LayerSide::new(garments.iter().filter_map(|g| height(g, to_f64(position), normal)), outwards)
        };
        let [below, above] = others;
        let [under, over] = [side(below, 1.0), side(above, -1.0)];
        let body = body.gap(position, Distance::NearestVertex);
        let gap = f64::from(body.gap) / UNIT;
        let mut features = [0.0; LOCAL_FEATURES];
        features[..LAYER_FEATURES].copy_from_slice(&under.features(normal));
        features[LAYER_FEATURES..2 * LAYER_FEATURES].copy_from_slice(&over.features(normal));
        features[2 * LAYER_FEATURES..].copy_from_slice(&[gap.clamp(-MOST, MOST), (-gap.max(0.0)).exp()]);
        Self { features, directions: [under.direction, over.direction, normal, to_f64(body.gradient)] }
    }
}

/// The values themselves and their means over ever larger surroundings.
fn scales(values: Vec<[f64; LOCAL_FEATURES]>, rings: &Rings) -> Vec<Vec<[f64; LOCAL_FEATURES]>> {
    let mut scales = vec![values];
    for passes in PASSES {
        let mut means = scales[scales.len() - 1].clone();
        (0..passes).for_each(|_| means = rings.averaged(&means));
        scales.push(means);
    }
    scales
}

impl LayerSide {
    /// From the heights over (`outwards` 1) or under (−1) some garments.
    fn new(heights: impl Iterator<Item = Height>, outwards: f64) -> Self {
        let mut side = Self { missing: [0.0; 2], near: 0.0, least: MOST, beside: 0.0, direction: zero() };
        let (mut largest_weight, mut total) = (f64::NEG_INFINITY, 0.0);
        for Height { height, normal, beside, presence } in heights {
            let right = outwards * height / UNIT;
            let missing = presence * (WANTED_HEIGHT / UNIT - right).clamp(0.0, MOST);
            side.missing[0] += missing;
            side.missing[1] = side.missing[1].max(missing);
            side.near += presence;
            side.least = side.least.min(right).max(-MOST);
            let weight = missing + AT_REST * presence;
            side.direction = add_scaled(side.direction, weight, normal);
            total += weight;
            if weight > largest_weight {
                (largest_weight, side.beside) = (weight, (beside / UNIT).min(MOST));
            }
        }
        if total > 0.0 {
            side.direction = scale(side.direction, 1.0 / total);
        }
        side
    }

    fn features(&self, own_normal: [f64; 3]) -> [f64; LAYER_FEATURES] {
        let Self { missing: [sum, most], near, least, beside, direction } = *self;
        [sum, most, near, least, (-least.max(0.0)).exp() * near.min(1.0), beside, dot(direction, own_normal)]
    }
}

#[cfg(test)]
mod tests;
