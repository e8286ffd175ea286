//! Garments that are draped together, with everything that does not depend on the body.

use super::Draper;
use super::embedded::{EmbeddedGarment, GarmentTimes};
use super::error::DraperError;
use super::names::UniqueNames;
use super::source::GivenGarment;
use crate::dataset::{Arrangement, PreparedGarment};
use clothcombo_model::{Embeddings, Mode, OutfitTensors};
use clothcombo_physics::contact::resolve::{Layer, ResolveError, RestGarment};
use std::sync::Arc;

/// Most garments of an outfit.
pub const MAX_GARMENTS: usize = 12;

/// Most vertices of a garment: at the paper's sizes the operators of one take 2 kB a vertex, its embedding as much.
pub const MAX_VERTICES: usize = 100_000;

/// A garment of an outfit.
#[derive(Clone)]
pub struct OutfitGarment {
    /// Name, unique within the outfit and fit to be a file name.
    pub name: String,
    /// As it was given.
    pub source: Arc<GivenGarment>,
    /// Ready for the networks.
    pub prepared: Arc<PreparedGarment>,
    /// As the post-process sees it.
    pub rest: Arc<RestGarment>,
    /// Whether the embedding was there already, in memory or in the cache.
    pub embedding_known: bool,
    /// What it cost this time.
    pub milliseconds: GarmentTimes,
}

/// Garments that are draped together, innermost first, with everything that does not depend on the body.
pub struct Outfit {
    /// The garments.
    pub garments: Vec<OutfitGarment>,
    pub(super) arrangement: Arrangement,
    pub(super) tensors: OutfitTensors,
    pub(super) embeddings: Embeddings,
}

impl Outfit {
    /// Packs embedded garments, innermost first.
    pub(super) fn new(
        draper: &Draper,
        sources: Vec<GivenGarment>,
        embedded: Vec<EmbeddedGarment>,
    ) -> Result<Self, DraperError> {
        let prepared = embedded.iter().map(|e| e.prepared.clone()).collect();
        let arrangement = draper.scene_builder().arrange(prepared, &[]);
        let tensors = embedded.iter().map(|e| &e.tensors).collect::<Vec<_>>();
        let tensors = OutfitTensors::new(&tensors, &arrangement.contacts)?
            .with_thickness_below(&arrangement.thickness_below)?;
        let embeddings = embedded.iter().map(|e| e.embedding.clone()).collect::<Vec<_>>();
        let embeddings = draper.model.pack(&tensors, &embeddings, Mode::Layered)?;
        let mut names = UniqueNames::default();
        let garment = |(source, embedded): (GivenGarment, EmbeddedGarment)| OutfitGarment {
            name: names.take(&source.garment.name),
            source: Arc::new(source),
            prepared: embedded.prepared,
            rest: embedded.rest,
            embedding_known: embedded.was_known,
            milliseconds: embedded.milliseconds,
        };
        let garments = sources.into_iter().zip(embedded).map(garment).collect();
        Ok(Self { garments, arrangement, tensors, embeddings })
    }

    /// Whether `garments` are few and small enough to be an outfit: what [`Draper::outfit`] would say, at once.
    ///
    /// # Errors
    /// When they are not.
    pub fn check(garments: &[GivenGarment]) -> Result<(), DraperError> {
        if garments.is_empty() || garments.len() > MAX_GARMENTS {
            return Err(DraperError::Count { count: garments.len(), most: MAX_GARMENTS });
        }
        let sizes = garments.iter().map(|source| (&source.garment.name, source.garment.rest.vertex_count()));
        match sizes.into_iter().find(|(_, vertices)| *vertices > MAX_VERTICES) {
            Some((name, vertices)) => Err(DraperError::TooLarge { name: name.clone(), vertices }),
            None => Ok(()),
        }
    }

    /// Names, innermost first.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.garments.iter().map(|p| p.name.as_str())
    }

    /// The part of each garment of a packed `[ΣV]` array.
    pub(super) fn split<'a, T>(&self, packed: &'a [T]) -> Vec<&'a [T]> {
        self.tensors.packing().parts(packed)
    }

    /// The same, each by itself.
    pub(super) fn to_parts<T: Copy>(&self, packed: &[T]) -> Vec<Vec<T>> {
        self.split(packed).into_iter().map(<[_]>::to_vec).collect()
    }

    /// Layers for the post-process, at the positions of each garment.
    pub(super) fn layers<'a>(&'a self, positions: &[&'a [[f64; 3]]]) -> Vec<Layer<'a>> {
        let pieces = self.garments.iter().zip(positions);
        pieces.map(|(piece, positions)| Layer { garment: &piece.rest, positions }).collect()
    }

    /// `error` with the garment's name where the post-process knows only its number.
    pub(super) fn named(&self, error: DraperError) -> DraperError {
        let name = |garment: usize| self.garments.get(garment).map_or_else(String::new, |g| g.name.clone());
        match error {
            DraperError::Resolve(ResolveError::Position { garment, vertex, position }) => {
                DraperError::Far { garment: name(garment), vertex, position }
            }
            DraperError::Resolve(ResolveError::DoubledFace { garment, face, first }) => {
                DraperError::DoubledFace { garment: name(garment), face, first }
            }
            other => other,
        }
    }

    pub(super) fn check_finite(&self, packed: &[[f64; 3]]) -> Result<(), DraperError> {
        for (piece, part) in self.garments.iter().zip(self.split(packed)) {
            if part.as_flattened().iter().any(|x| !x.is_finite()) {
                return Err(DraperError::Diverged { garment: piece.name.clone() });
            }
        }
        Ok(())
    }
}
