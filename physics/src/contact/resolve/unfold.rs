//! Cloth that a drape folds into itself is laid out, before anything else.
//!
//! What a network adds to a skinned garment is smooth, but where it folds cloth: on a body unlike those it was trained on, or
//! where garments press on each other. No sheet over such a fold can tell its outside from its inside. Around it what is added
//! is replaced by what is smoothest between its surroundings, a harmonic function on the edges: the fold goes, the distance to
//! the body and to other garments stays about what it is next to it.

mod places;

use rayon::prelude::*;

use super::body::with_drawn;
use super::garment::at;
use super::obstacle::BodyObstacle;
use super::outfit::Outfit;
use super::{Layer, PathSample};
use crate::contact::self_triangle_pairs;
use crate::query::Surface;
use places::{folded, smoothed};

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
    pub fn laid_out_at(&self, mut stage: PathSample, layers: &[Layer<'_>]) -> PathSample {
        if !self.is_empty() {
            stage.draped = self.laid_out(&at(layers, &stage.draped), &stage.skinned);
        }
        stage
    }
}

#[cfg(test)]
pub(super) mod tests;
