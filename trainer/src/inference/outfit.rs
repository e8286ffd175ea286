//! Garments prepared and embedded, and outfits of them. Whatever depends on a garment alone is computed once: per process by
//! content, and per machine with a cache.

use super::Draper;
use super::error::DraperError;
use super::names::UniqueNames;
use super::source::SourceGarment;
use crate::dataset::{DatasetError, PreparedGarment, contacts};
use crate::inference::networks::garment_tensors;
use burn::tensor::{Tensor, TensorData};
use clothcombo_data::asset::Binding;
use clothcombo_data::cache::{
    ArrayCache, Key, KeyBuilder, StoredEmbedding, binding_key, embedding_key, get_binding, get_embedding,
    get_operators, mesh_key, operators_key, put_binding, put_embedding, put_operators,
};
use clothcombo_model::{Embeddings, GarmentEmbedding, GarmentTensors, OutfitTensors};
use clothcombo_physics::contact::resolve::{Layer, ResolveError, RestGarment};
use clothcombo_physics::operators::SurfaceOperators;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Most garments of an outfit.
pub const MAX_GARMENTS: usize = 12;

/// Most vertices of a garment: at the paper's sizes the operators of one take 2 kB a vertex, its embedding as much.
pub const MAX_VERTICES: usize = 100_000;

/// Wall time of what depends on the garment alone [ms].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PieceTimes {
    /// Binding to the body, constants of the energies, operators.
    pub preparation: f64,
    /// The embedding network, or reading what it made before.
    pub embedding: f64,
}

/// A garment of an outfit.
#[derive(Clone)]
pub struct Piece {
    /// Name, unique within the outfit and fit to be a file name.
    pub name: String,
    /// As it was given.
    pub source: Arc<SourceGarment>,
    /// Ready for the networks.
    pub prepared: Arc<PreparedGarment>,
    /// As the post-process sees it.
    pub rest: Arc<RestGarment>,
    /// Whether the embedding was there already, in memory or in the cache.
    pub embedding_known: bool,
    /// What it cost this time.
    pub milliseconds: PieceTimes,
}

/// Garments to be worn together, innermost first, with everything that does not depend on the body.
pub struct Outfit {
    /// The garments.
    pub pieces: Vec<Piece>,
    pub(super) tensors: OutfitTensors,
    pub(super) embeddings: Embeddings,
}

impl Outfit {
    /// Whether `garments` are few and small enough to be an outfit: what [`Draper::outfit`] would say, at once.
    ///
    /// # Errors
    /// When they are not.
    pub fn check(garments: &[SourceGarment]) -> Result<(), DraperError> {
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
        self.pieces.iter().map(|p| p.name.as_str())
    }

    pub(super) fn prepared(&self) -> Vec<Arc<PreparedGarment>> {
        self.pieces.iter().map(|p| p.prepared.clone()).collect()
    }

    /// The part of each garment of a packed `[ΣV]` array.
    pub(super) fn split<'a, T>(&self, packed: &'a [T]) -> Vec<&'a [T]> {
        let mut rest = packed;
        let mut parts = Vec::with_capacity(self.pieces.len());
        for piece in &self.pieces {
            let (part, tail) = rest.split_at(piece.prepared.vertex_count());
            parts.push(part);
            rest = tail;
        }
        parts
    }

    /// Layers for the post-process, at the positions of each garment.
    pub(super) fn layers<'a>(&'a self, positions: &[&'a [[f64; 3]]]) -> Vec<Layer<'a>> {
        let pieces = self.pieces.iter().zip(positions);
        pieces.map(|(piece, positions)| Layer { garment: &piece.rest, positions }).collect()
    }

    /// `error` with the garment's name where the post-process knows only its number.
    pub(super) fn named(&self, error: DraperError) -> DraperError {
        match error {
            DraperError::Resolve(ResolveError::Position { garment, vertex, position }) => {
                let garment = self.pieces.get(garment).map_or_else(String::new, |piece| piece.name.clone());
                DraperError::Far { garment, vertex, position }
            }
            other => other,
        }
    }

    pub(super) fn check_finite(&self, packed: &[[f64; 3]]) -> Result<(), DraperError> {
        for (piece, part) in self.pieces.iter().zip(self.split(packed)) {
            if part.as_flattened().iter().any(|x| !x.is_finite()) {
                return Err(DraperError::Diverged { garment: piece.name.clone() });
            }
        }
        Ok(())
    }
}

/// A garment with its tensors.
#[derive(Clone)]
struct Known {
    prepared: Arc<PreparedGarment>,
    rest: Arc<RestGarment>,
    tensors: GarmentTensors,
    embedding: GarmentEmbedding,
}

/// Every garment a draper has met.
pub(super) struct KnownGarments {
    cache: Option<(ArrayCache, Key)>,
    known: Mutex<HashMap<Key, Known>>,
}

impl KnownGarments {
    /// With an on-disk cache and the key of the body in it, or without.
    pub fn new(cache: Option<(ArrayCache, Key)>) -> Self {
        Self { cache, known: Mutex::new(HashMap::new()) }
    }

    pub fn outfit(&self, draper: &Draper, garments: Vec<SourceGarment>) -> Result<Outfit, DraperError> {
        Outfit::check(&garments)?;
        let mut names = UniqueNames::default();
        let (mut pieces, mut known) = (Vec::new(), Vec::<Known>::new());
        for source in garments {
            let name = names.take(&source.garment.name);
            let (found, milliseconds, embedding_known) = self.know(draper, &source)?;
            let (source, prepared, rest) = (Arc::new(source), found.prepared.clone(), found.rest.clone());
            pieces.push(Piece { name, source, prepared, rest, embedding_known, milliseconds });
            known.push(found);
        }
        let prepared: Vec<Arc<PreparedGarment>> = known.iter().map(|k| k.prepared.clone()).collect();
        let contacts = contacts(draper.trained.config.model.graph, &prepared);
        let tensors: Vec<&GarmentTensors> = known.iter().map(|k| &k.tensors).collect();
        let tensors = OutfitTensors::new(&tensors, &contacts)?;
        let embeddings: Vec<GarmentEmbedding> = known.iter().map(|k| k.embedding.clone()).collect();
        let embeddings = draper.model.pack(&tensors, &embeddings)?;
        let embeddings = draper.model.prepare_untangling(&tensors, embeddings);
        Ok(Outfit { pieces, tensors, embeddings })
    }

    fn know(
        &self,
        draper: &Draper,
        source: &SourceGarment,
    ) -> Result<(Known, PieceTimes, bool), DraperError> {
        let garment = &source.garment;
        let mesh = mesh_key(&garment.rest);
        let key = KeyBuilder::new("worn").key(mesh).text(garment.category.name());
        let key = key.number(u64::from(garment.holding)).finish();
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = known().get(&key) {
            return Ok((found.clone(), PieceTimes::default(), true));
        }
        let clock = Instant::now();
        let binding = self.binding(draper, source, mesh)?;
        let prepared = Arc::new(draper.preprocessor.finish(garment.clone(), binding, &draper.joints)?);
        let rest = Arc::new(RestGarment::new(&garment.rest));
        let operators = self.operators(draper, source, mesh)?;
        let tensors = garment_tensors(&prepared, &operators, &draper.dimensions(), &draper.device)?;
        let preparation = super::elapsed(clock);
        let clock = Instant::now();
        let (embedding, was_stored) = self.embedding(draper, &tensors, mesh)?;
        let embedding_ms = super::elapsed(clock);
        let found = Known { prepared, rest, tensors, embedding };
        known().insert(key, found.clone());
        Ok((found, PieceTimes { preparation, embedding: embedding_ms }, was_stored))
    }

    fn binding(&self, draper: &Draper, source: &SourceGarment, mesh: Key) -> Result<Binding, DatasetError> {
        let (garment, preprocessor) = (&source.garment, &draper.preprocessor);
        let joints = preprocessor.body.joint_count();
        let make = || Binding::new(garment, &preprocessor.body, &preprocessor.binding);
        let Some((cache, body)) = &self.cache else { return Ok(make()) };
        let key = binding_key(mesh, *body, garment.category, &preprocessor.binding);
        if let Some((_, binding)) = get_binding(cache, key, joints) {
            return Ok(binding);
        }
        let binding = make();
        kept(put_binding(cache, key, &garment.rest, &binding, joints));
        Ok(binding)
    }

    fn operators(
        &self,
        draper: &Draper,
        source: &SourceGarment,
        mesh: Key,
    ) -> Result<SurfaceOperators, DatasetError> {
        let make = || draper.preprocessor.operators(&source.garment.name, &source.garment.rest);
        let Some((cache, _)) = &self.cache else { return make() };
        let key = operators_key(mesh, draper.preprocessor.eigen_count);
        if let Some(operators) = get_operators(cache, key) {
            return Ok(operators);
        }
        let operators = make()?;
        kept(put_operators(cache, key, &operators));
        Ok(operators)
    }

    fn embedding(
        &self,
        draper: &Draper,
        tensors: &GarmentTensors,
        mesh: Key,
    ) -> Result<(GarmentEmbedding, bool), DraperError> {
        let Some((cache, _)) = &self.cache else { return Ok((draper.model.encode(tensors), false)) };
        let key = embedding_key(mesh, draper.trained.checksum(), draper.preprocessor.eigen_count);
        let (vertices, width) = (tensors.vertex_count(), draper.trained.config.model.embedding);
        if let Some(StoredEmbedding { vertex, garment }) = get_embedding(cache, key, vertices)
            && garment.len() == width
        {
            let upload = |values: Vec<f32>, rows: usize| {
                Tensor::from_data(TensorData::new(values, [rows, width]), &draper.device)
            };
            return Ok((
                GarmentEmbedding { vertex: upload(vertex, vertices), garment: upload(garment, 1) },
                true,
            ));
        }
        let embedding = draper.model.encode(tensors);
        let [vertex, garment] =
            [&embedding.vertex, &embedding.garment].map(|tensor| tensor.clone().into_data());
        if let (Ok(vertex), Ok(garment)) = (vertex.as_slice::<f32>(), garment.as_slice::<f32>()) {
            let stored = StoredEmbedding { vertex: vertex.to_vec(), garment: garment.to_vec() };
            kept(put_embedding(cache, key, &stored));
        }
        Ok((embedding, false))
    }
}

/// A cache that is full or read-only makes the next run slower, this one is not wrong.
fn kept(stored: Result<(), clothcombo_data::cache::CacheError>) {
    if let Err(error) = stored {
        tracing::warn!("{error}");
    }
}
