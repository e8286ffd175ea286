//! Inner garments give way to outer ones that lie deep under them, before the layers are resolved one by one.

use rayon::prelude::*;

use super::contact::Contact;
use super::obstacle::{BodyObstacle, BodyView, LayerObstacle, Plane, facing};
use super::relax::{Cloth, neighbourhood, relax};
use super::{Layer, ResolveSettings};

/// Outer vertices less deep than this under an inner garment are lifted over it without moving it [m].
const DEEP: f64 = 0.003;
/// Rounds of detection and relaxation.
const ROUNDS: usize = 3;
/// Contacts closer than this are watched [m].
const WATCH: f64 = 0.01;
/// No contact asks for a longer step than this in a round [m].
const LONGEST_STEP: f64 = 0.03;

/// The garments of an outfit side by side; vertices are numbered through.
struct Outfit<'a> {
    layers: &'a [Layer<'a>],
    /// First vertex of every garment, and the end.
    starts: Vec<u32>,
    garment_of: Vec<u8>,
}

impl<'a> Outfit<'a> {
    fn new(layers: &'a [Layer<'a>]) -> Self {
        let mut starts = vec![0];
        let mut garment_of = Vec::new();
        for (i, layer) in layers.iter().enumerate() {
            garment_of.resize(garment_of.len() + layer.positions.len(), i.min(255) as u8);
            starts.push(garment_of.len() as u32);
        }
        Self { layers, starts, garment_of }
    }

    fn split<'b>(&self, packed: &'b [[f64; 3]]) -> Vec<&'b [[f64; 3]]> {
        self.starts.windows(2).map(|w| &packed[w[0] as usize..w[1] as usize]).collect()
    }
}

impl Cloth for Outfit<'_> {
    fn vertices(&self) -> usize {
        self.garment_of.len()
    }

    fn ring(&self, v: u32) -> impl ExactSizeIterator<Item = u32> {
        let g = usize::from(self.garment_of[v as usize]);
        let start = self.starts[g];
        self.layers[g].garment.topology.ring((v - start) as usize).iter().map(move |n| n + start)
    }
}

/// A vertex and the half-space of the inner garment it has to stay over.
struct Over {
    vertex: u32,
    inner: usize,
    plane: Plane,
}

/// New positions of all garments; `None` where no garment lies deep under an inner one.
pub(super) fn give_way(
    body: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
) -> Option<Vec<Vec<[f64; 3]>>> {
    if !(2..=255).contains(&layers.len()) {
        return None;
    }
    let outfit = Outfit::new(layers);
    let input: Vec<[f64; 3]> = layers.iter().flat_map(|l| l.positions).copied().collect();
    let mut positions = input.clone();
    let mut views = vec![None; positions.len()];
    let mut moved: Vec<u32> = (0..positions.len() as u32).collect();
    for round in 0..ROUNDS {
        look(body, &positions, &moved, &mut views);
        let over = all_over(&outfit, &positions, &views, settings);
        let limit = if round == 0 { -DEEP } else { -0.5 * DEEP };
        let deep: Vec<&Over> = over.iter().filter(|o| o.plane.distance < limit).collect();
        if deep.is_empty() {
            return (round > 0).then(|| outfit.split(&positions).into_iter().map(<[_]>::to_vec).collect());
        }
        let below = |o: &&Over| {
            let start = outfit.starts[o.inner];
            layers[o.inner].garment.faces[o.plane.face as usize].map(|v| v + start)
        };
        let seeds: Vec<u32> = deep.iter().flat_map(|o| [o.vertex].into_iter().chain(below(o))).collect();
        let region = neighbourhood(&outfit, &seeds, settings.rings);
        let mut is_in = vec![false; positions.len()];
        region.iter().for_each(|&v| is_in[v as usize] = true);
        let mut contacts: Vec<Contact> = Vec::new();
        for o in over.iter().filter(|o| is_in[o.vertex as usize]) {
            let gap = settings.gap.min(o.plane.distance + LONGEST_STEP);
            let lower = (below(&o), o.plane.barycentric);
            contacts.push(Contact::vertex_over(o.vertex, lower, o.plane.normal, gap));
        }
        // The body last, so that it has the last word.
        for &v in &region {
            let plane = views[v as usize].and_then(|view: BodyView| view.plane);
            if let Some(plane) = plane.filter(|p| p.distance < WATCH && !p.is_held) {
                let gap = settings.gap.min(plane.distance + LONGEST_STEP);
                contacts.push(Contact::vertex(v, &plane, gap));
            }
        }
        relax(&outfit, &mut positions, &input, &region, &contacts, settings.sweeps);
        moved = region;
    }
    Some(outfit.split(&positions).into_iter().map(<[_]>::to_vec).collect())
}

fn look(body: &BodyObstacle<'_>, positions: &[[f64; 3]], of: &[u32], views: &mut [Option<BodyView>]) {
    let found: Vec<_> = of.par_iter().with_min_len(128).map(|&v| body.look(positions[v as usize])).collect();
    for (&v, view) in of.iter().zip(found) {
        views[v as usize] = view;
    }
}

/// Every vertex that lies near, over or under an inner garment.
fn all_over(
    outfit: &Outfit<'_>,
    positions: &[[f64; 3]],
    views: &[Option<BodyView>],
    settings: &ResolveSettings,
) -> Vec<Over> {
    let parts = outfit.split(positions);
    let last = parts.len() - 1;
    (0..last)
        .flat_map(|inner| {
            let garment = outfit.layers[inner].garment;
            let start = outfit.starts[inner] as usize;
            let outward = |v: usize| {
                views[start + v].and_then(|view| view.plane).map_or([0.0; 3], |plane| plane.normal)
            };
            let obstacle = LayerObstacle::new(garment, parts[inner], facing(garment, parts[inner], outward));
            let outer = outfit.starts[inner + 1]..outfit.starts[last + 1];
            outer
                .into_par_iter()
                .with_min_len(128)
                .filter_map(|vertex| {
                    let plane = obstacle.look(positions[vertex as usize], settings.reach, settings.gap)?;
                    (plane.distance < WATCH).then_some(Over { vertex, inner, plane })
                })
                .collect::<Vec<_>>()
        })
        .collect()
}
