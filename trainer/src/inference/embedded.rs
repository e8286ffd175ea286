//! Garments prepared and embedded. Whatever depends on a garment alone is computed once: per process by content, and per machine
//! with a cache.

use super::error::DraperError;
use super::source::GivenGarment;
use super::tensor_store::garment_tensors;
use super::{Draper, elapsed};
use crate::dataset::PreparedGarment;
use crate::system::lru_cache::{KeptBytes, LruCache, MemoryBudget, Residence};
use burn::tensor::{Tensor, TensorData};
use clothcombo_data::cache::{
    Key, KeyBuilder, StoredEmbedding, embedding_key, get_embedding, mesh_key, put_embedding,
};
use clothcombo_model::{GarmentEmbedding, GarmentTensors};
use clothcombo_physics::contact::resolve::RestGarment;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Wall time of what depends on the garment alone (ms).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GarmentTimes {
    /// Binding to the body, constants of the energies, operators.
    pub preparation: f64,
    /// The embedding network, or reading what it made before.
    pub embedding: f64,
}

/// A garment with its tensors.
#[derive(Clone)]
pub(super) struct EmbeddedGarment {
    pub prepared: Arc<PreparedGarment>,
    pub rest: Arc<RestGarment>,
    pub tensors: GarmentTensors,
    pub embedding: GarmentEmbedding,
    /// Whether the embedding was there already, in memory or in the cache.
    pub was_known: bool,
    /// What it cost this time.
    pub milliseconds: GarmentTimes,
}

/// Memory of a vertex of a garment at the paper's sizes (bytes): 2 kB are operators, as much the embedding.
const PER_VERTEX: usize = 4096;

/// The garments a draper has met last, by content: as many as two of the largest.
pub(super) struct EmbeddedGarments {
    /// Of every garment it has met, the place in `kept`.
    met: Mutex<HashMap<Key, usize>>,
    kept: LruCache<EmbeddedGarment>,
}

impl Default for EmbeddedGarments {
    fn default() -> Self {
        let bytes = 2 * super::MAX_VERTICES * PER_VERTEX;
        let memory = MemoryBudget::new(KeptBytes { total: bytes, device: bytes });
        Self { met: Mutex::default(), kept: LruCache::new(&memory, Residence::Device) }
    }
}

impl EmbeddedGarments {
    fn place(&self, key: Key) -> usize {
        let mut met = self.met.lock().unwrap_or_else(PoisonError::into_inner);
        let next = met.len();
        *met.entry(key).or_insert(next)
    }

    /// The garment as the networks need it, made if it was not met before.
    pub fn get(&self, draper: &Draper, source: &GivenGarment) -> Result<EmbeddedGarment, DraperError> {
        let garment = &source.garment;
        let mesh = mesh_key(&garment.rest);
        let key = KeyBuilder::new("embedded").key(mesh).text(garment.category.name());
        let key = key.number(u64::from(garment.holding)).text(&garment.material.to_string()).finish();
        let place = self.place(key);
        if let Some(found) = self.kept.get(place) {
            let milliseconds = GarmentTimes::default();
            return Ok(EmbeddedGarment { was_known: true, milliseconds, ..(*found).clone() });
        }
        let clock = Instant::now();
        let preprocessor = &draper.preprocessor;
        let binding = preprocessor.binding(garment, mesh);
        let prepared = Arc::new(preprocessor.finish(garment.clone(), binding, &draper.joints)?);
        let rest = Arc::new(RestGarment::of_material(&garment.rest, prepared.energies.material()));
        let operators = preprocessor.operators(&garment.name, &garment.rest, mesh)?;
        let tensors = garment_tensors(&prepared, &operators, &draper.dimensions(), &draper.settings.device)?;
        let preparation = elapsed(clock);
        let clock = Instant::now();
        let (embedding, was_known) = embedding(draper, &tensors, mesh)?;
        let milliseconds = GarmentTimes { preparation, embedding: elapsed(clock) };
        let found = EmbeddedGarment { prepared, rest, tensors, embedding, was_known, milliseconds };
        let bytes = PER_VERTEX * found.prepared.vertex_count();
        self.kept.insert(place, found.clone(), bytes);
        Ok(found)
    }
}

/// The embedding of a garment, and whether it came from the cache.
fn embedding(
    draper: &Draper,
    tensors: &GarmentTensors,
    mesh: Key,
) -> Result<(GarmentEmbedding, bool), DraperError> {
    let Some(cache) = draper.preprocessor.cache() else { return Ok((draper.model.encode(tensors), false)) };
    let model = &draper.trained.config.model;
    let key = embedding_key(mesh, draper.trained.checksum(), draper.preprocessor.eigen_count);
    let (vertices, width) = (tensors.vertex_count(), model.embedding);
    if let Some(StoredEmbedding { vertex, garment }) = get_embedding(cache, key, vertices)
        && garment.len() == width
    {
        let upload = |values: Vec<f32>, rows: usize| {
            Tensor::from_data(TensorData::new(values, [rows, width]), &draper.settings.device)
        };
        return Ok((
            GarmentEmbedding { vertex: upload(vertex, vertices), garment: upload(garment, 1) },
            true,
        ));
    }
    let embedding = draper.model.encode(tensors);
    let [vertex, garment] = [&embedding.vertex, &embedding.garment].map(|tensor| tensor.clone().into_data());
    if let (Ok(vertex), Ok(garment)) = (vertex.as_slice::<f32>(), garment.as_slice::<f32>()) {
        let stored = StoredEmbedding { vertex: vertex.to_vec(), garment: garment.to_vec() };
        draper.preprocessor.store(|cache| put_embedding(cache, key, &stored));
    }
    Ok((embedding, false))
}
