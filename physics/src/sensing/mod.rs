//! What every vertex of an outfit feels of the garments under and over it, of the body, and of its own cloth: the input of
//! networks that correct how garments lie.
//!
//! ```text
//! height    smoothed signed height of a point over a garment near it
//! forces    elastic forces, as displacements
//! rings     neighbours of every vertex, and means over them
//! mod       all of it put together into features and directions
//! ```
//!
//! Everything is invariant under rigid motions of the whole scene (directions turn with it), and is no differentiable
//! function here: a network takes it as given.

mod forces;
mod height;
mod rings;

use rayon::prelude::*;

use crate::energy::{SceneEnergy, SceneGarment};
use crate::query::{Distance, Surface};
use crate::vec3::{add_scaled, dot, norm, scale, to_f64, zero};
use height::{Height, Sheet, height};

pub use rings::Rings;

/// Numbers felt at one vertex, before they are averaged over its surroundings.
const FELT: usize = 16;
/// Averaging passes between one scale and the next.
const PASSES: [usize; 2] = [4, 16];
/// Numbers per vertex: what it feels itself, the means over two sizes of its surroundings, and length and normal part of the
/// forces at each of their scales.
pub const FEATURES: usize = FELT * (1 + PASSES.len()) + 2 * forces::SCALES;
/// Directions per vertex: out of the garments under it, out of those over it, out of its own garment, out of the body, and the
/// displacements that forces stand for.
pub const DIRECTIONS: usize = OUTWARDS + forces::SCALES;
const OUTWARDS: usize = 4;

/// Heights are wanted to be at least this on the right side [m].
const WANTED: f64 = 0.004;
/// Lengths are felt in this unit [m] and not beyond [`MOST`] of it.
const UNIT: f64 = 0.01;
const MOST: f64 = 5.0;
/// Weight in the mean direction of a garment that is near, but where it should be, against a centimetre too little.
const AT_REST: f64 = 0.05;

/// What the vertices of an outfit feel.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensed {
    /// Dimensionless features `[ΣV, FEATURES]`, row by row.
    pub features: Vec<f32>,
    /// Directions of about length 1 `[DIRECTIONS][ΣV, 3]`; zero where nothing is near.
    pub directions: [Vec<[f32; 3]>; DIRECTIONS],
}

/// What one side of a vertex feels.
struct Side {
    /// Sum over the garments of how much is missing to the height wanted, and the most [cm].
    missing: [f64; 2],
    /// How many garments are near, each counted by how near.
    near: f64,
    /// Least height on the right side [cm]; [`MOST`] without any garment.
    least: f64,
    /// How far beside the most pressing garment [cm].
    beside: f64,
    /// Mean direction out of the garments.
    direction: [f64; 3],
}

/// What the garments of `scene` feel at `posed` `[ΣV, 3]` [m]; `rings` are their neighbourhoods, and `contacts` the pairs
/// (inner, outer) that feel each other.
///
/// Positions that are not finite make features that are not finite, at least at their own vertices.
///
/// # Panics
/// If the lengths are not those of the scene.
pub fn sense<'a>(
    scene: &SceneEnergy<f32>,
    rings: &[&'a Rings],
    posed: &[[f32; 3]],
    contacts: &[(usize, usize)],
) -> Sensed {
    let parts: Vec<&[[f32; 3]]> = scene.ranges().into_iter().map(|range| &posed[range]).collect();
    let sheet = |((part, rings), garment): ((&&[[f32; 3]], &&'a Rings), &SceneGarment<f32>)| {
        let mesh = garment.energies.as_inner();
        let surface = Surface::new(part.to_vec(), mesh.faces().clone());
        Sheet { surface, rings, median_edge: mesh.median_edge() }
    };
    let sheets: Vec<Sheet<'_>> = parts.iter().zip(rings).zip(&scene.garments).map(sheet).collect();
    let boxes: Vec<[[f64; 3]; 2]> = parts.iter().map(|part| height::felt_within(part)).collect();
    let mut sensed = Sensed {
        features: Vec::with_capacity(FEATURES * posed.len()),
        directions: std::array::from_fn(|_| Vec::with_capacity(posed.len())),
    };
    for (i, (garment, Sheet { surface: own, rings, .. })) in scene.garments.iter().zip(&sheets).enumerate() {
        let below: Vec<usize> = contacts.iter().filter(|c| c.1 == i).map(|c| c.0).collect();
        let above: Vec<usize> = contacts.iter().filter(|c| c.0 == i).map(|c| c.1).collect();
        let felt: Vec<([f64; FELT], [[f64; 3]; OUTWARDS])> = (0..own.positions.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|v| {
                let (position, normal) = (own.positions[v], to_f64(own.normals[v]));
                let side = |others: &[usize], outwards: f64| {
                    let p = to_f64(position);
                    let near = |j: &&usize| {
                        let [low, high] = boxes[**j];
                        (0..3).all(|k| (low[k]..=high[k]).contains(&p[k]))
                    };
                    let over = |&j: &usize| height(&sheets[j], p, normal);
                    Side::new(others.iter().filter(near).filter_map(over), outwards)
                };
                let [under, over] = [side(&below, 1.0), side(&above, -1.0)];
                let body = scene.body.gap(position, Distance::NearestVertex);
                let gap = f64::from(body.gap) / UNIT;
                let mut values = [0.0; FELT];
                values[..7].copy_from_slice(&under.values(normal));
                values[7..14].copy_from_slice(&over.values(normal));
                values[14] = gap.clamp(-MOST, MOST);
                values[15] = (-gap.max(0.0)).exp();
                (values, [under.direction, over.direction, normal, to_f64(body.gradient)])
            })
            .collect();
        let scales = scales(felt.iter().map(|(values, _)| *values).collect(), rings);
        let forces = forces::relaxing(garment, &scene.settings, rings, parts[i]);
        for (v, (_, outwards)) in felt.iter().enumerate() {
            let normal = outwards[2];
            let of_force = |f: &Vec<[f64; 3]>| [norm(f[v]), dot(f[v], normal)];
            let features = scales.iter().flat_map(|scale| scale[v]).chain(forces.iter().flat_map(of_force));
            sensed.features.extend(features.map(|x| x as f32));
            let directions = outwards.iter().copied().chain(forces.iter().map(|f| f[v]));
            for (all, direction) in sensed.directions.iter_mut().zip(directions) {
                all.push(direction.map(|x| x as f32));
            }
        }
    }
    sensed
}

/// The values themselves and their means over ever larger surroundings.
fn scales(values: Vec<[f64; FELT]>, rings: &Rings) -> Vec<Vec<[f64; FELT]>> {
    let mut scales = vec![values];
    for passes in PASSES {
        let mut means = scales[scales.len() - 1].clone();
        (0..passes).for_each(|_| means = rings.averaged(&means));
        scales.push(means);
    }
    scales
}

impl Side {
    /// From the heights over (`outwards` 1) or under (−1) some garments.
    fn new(heights: impl Iterator<Item = Height>, outwards: f64) -> Self {
        let mut side = Self { missing: [0.0; 2], near: 0.0, least: MOST, beside: 0.0, direction: zero() };
        let (mut most_pressing, mut total) = (f64::NEG_INFINITY, 0.0);
        for Height { height, normal, beside, presence } in heights {
            let right = outwards * height / UNIT;
            let missing = presence * (WANTED / UNIT - right).clamp(0.0, MOST);
            side.missing[0] += missing;
            side.missing[1] = side.missing[1].max(missing);
            side.near += presence;
            side.least = side.least.min(right).max(-MOST);
            let weight = missing + AT_REST * presence;
            side.direction = add_scaled(side.direction, weight, normal);
            total += weight;
            if weight > most_pressing {
                (most_pressing, side.beside) = (weight, (beside / UNIT).min(MOST));
            }
        }
        if total > 0.0 {
            side.direction = scale(side.direction, 1.0 / total);
        }
        side
    }

    fn values(&self, own_normal: [f64; 3]) -> [f64; 7] {
        let Self { missing: [sum, most], near, least, beside, direction } = *self;
        [sum, most, near, least, (-least.max(0.0)).exp() * near.min(1.0), beside, dot(direction, own_normal)]
    }
}

#[cfg(test)]
mod tests;
