//! Garments with their embeddings, as many as memory is set apart for: those met last.

use super::phase_times::PhaseTimes;
use crate::dataset::PreparedGarment;
use crate::system::lru_cache::{KeptBytes, LruCache, MemoryBudget, Residence};
use clothcombo_data::cache::Key;
use clothcombo_model::{GarmentEmbedding, GarmentTensors};
use clothcombo_physics::contact::resolve::RestGarment;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Most vertices of a garment that is draped: at the paper's sizes the operators of one take 2 kB a vertex, its embedding as much.
pub const MAX_DRAPED_VERTICES: usize = 100_000;
/// Memory of a vertex of a garment at the paper's sizes (bytes): 2 kB are operators, as much the embedding.
const BYTES_PER_VERTEX: usize = 4096;

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
    pub milliseconds: PhaseTimes,
}

/// The garments a draper has met last, by content: as many as two of the largest.
pub(super) struct EmbeddedGarments {
    /// Of every garment it has met, the place in `kept`.
    met: Mutex<HashMap<Key, usize>>,
    kept: LruCache<EmbeddedGarment>,
}

impl Default for EmbeddedGarments {
    fn default() -> Self {
        let bytes = 2 * MAX_DRAPED_VERTICES * BYTES_PER_VERTEX;
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

    /// The garment of this key, at no cost, if it was met lately.
    pub fn get(&self, key: Key) -> Option<EmbeddedGarment> {
        let found = self.kept.get(self.place(key))?;
        Some(EmbeddedGarment { was_known: true, milliseconds: PhaseTimes::default(), ..(*found).clone() })
    }

    /// Keeps a garment.
    pub fn insert(&self, key: Key, garment: EmbeddedGarment) {
        let bytes = BYTES_PER_VERTEX * garment.prepared.vertex_count();
        self.kept.insert(self.place(key), garment, bytes);
    }
}
