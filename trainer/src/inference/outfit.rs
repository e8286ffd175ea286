//! Garments that are draped together, with everything that does not depend on the body.

use super::checks::check_sizes;
use super::draper::Draper;
use super::names::UniqueNames;
use super::phase_times::PhaseTimes;
use super::source::GivenGarment;
use crate::dataset::{Arrangement, PreparedGarment};
use clothcombo_model::{Embeddings, Mode, OutfitTensors};
use clothcombo_physics::contact::resolve::{Layer, ResolveError, RestGarment};
use miette::{IntoDiagnostic, Report, miette};
use std::sync::Arc;

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
    /// What preparing and embedding it cost this time.
    pub milliseconds: PhaseTimes,
}

/// Garments that are draped together, innermost first, with everything that does not depend on the body.
pub struct Outfit {
    /// The garments.
    pub garments: Vec<OutfitGarment>,
    pub(super) arrangement: Arrangement,
    pub(super) tensors: OutfitTensors,
    pub(super) embeddings: Embeddings,
}

impl Draper {
    /// Prepares and embeds garments, innermost first. A garment this draper has met before, by content, costs nothing.
    ///
    /// # Errors
    /// For more garments than an outfit may have, or one that cannot be prepared.
    pub fn outfit(&self, garments: Vec<GivenGarment>) -> Result<Outfit, Report> {
        check_sizes(&garments)?;
        let (mut made, mut prepared, mut tensors, mut embeddings) = (vec![], vec![], vec![], vec![]);
        let mut names = UniqueNames::default();
        for source in garments {
            let embedded = self.embed(&source)?;
            prepared.push(embedded.prepared.clone());
            tensors.push(embedded.tensors);
            embeddings.push(embedded.embedding);
            made.push(OutfitGarment {
                name: names.take(&source.garment.name),
                source: Arc::new(source),
                prepared: embedded.prepared,
                rest: embedded.rest,
                embedding_known: embedded.was_known,
                milliseconds: embedded.milliseconds,
            });
        }
        let arrangement = self.scene_builder().arrange(prepared, &[]);
        let tensors = OutfitTensors::new(&tensors.iter().collect::<Vec<_>>(), &arrangement.contacts)
            .and_then(|tensors| tensors.with_thickness_below(&arrangement.thickness_below))
            .into_diagnostic()?;
        let embeddings = self.model.pack(&tensors, &embeddings, Mode::Layered).into_diagnostic()?;
        Ok(Outfit { garments: made, arrangement, tensors, embeddings })
    }
}

impl Outfit {
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

    /// An error of the post-process, with the garment's name where that knows only its number.
    pub(super) fn named(&self, error: ResolveError) -> Report {
        let name = |garment: usize| self.garments.get(garment).map_or("", |g| g.name.as_str());
        match error {
            ResolveError::Position { garment, vertex, position: [x, y, z] } => miette!(
                help = "positions are finite, in metres, within a kilometre of the origin: check the garment's coordinates, \
                        `clothcombo fit` finds unit and axes",
                "post-process: garment '{}', vertex {vertex} (from 0) is at [{x}, {y}, {z}]",
                name(garment)
            ),
            ResolveError::DoubledFace { garment, face, first } => miette!(
                help =
                    "let the mesh be repaired: `clothcombo fit` does it, and drape where --fit is not never",
                "post-process: garment '{}', face {face} (from 0) has the vertices of face {first}",
                name(garment)
            ),
            other => miette!("post-process: {other}"),
        }
    }

    pub(super) fn check_finite(&self, packed: &[[f64; 3]]) -> Result<(), Report> {
        for (piece, part) in self.garments.iter().zip(self.split(packed)) {
            if part.as_flattened().iter().any(|x| !x.is_finite()) {
                return Err(miette!(
                    help = "either the garment lies far from the body (metres, y up, about the origin: `clothcombo fit` finds \
                            unit and axes), or the model is damaged or was trained to divergence: try an earlier checkpoint",
                    "the networks moved garment '{}' to a place that is not finite",
                    piece.name
                ));
            }
        }
        Ok(())
    }
}
