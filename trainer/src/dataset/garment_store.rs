//! All garments of a run, in memory or streamed from the cache.
//!
//! Without a cache everything is computed at the start and kept, if the machine has the memory. With one, what is expensive
//! is computed once, a few garments at a time, and stored; a run keeps the garments it used last, within `data.memory_mib`,
//! and reads the others again when a scene draws them: a wardrobe may be many times larger than memory, and the results are
//! the same to the bit.

use super::active_joints::ActiveJoints;
use super::error::DatasetError;
use super::garment_source::{GarmentLoader, GarmentSource};
use super::prepared_garment::PreparedGarment;
use super::preprocessor::Preprocessor;
use crate::config::Config;
use crate::dataset::DataSizes;
use crate::system::allocator::return_freed_memory;
use crate::system::lru_cache::{LruCache, MemoryBudget, Residence};
use crate::system::memory::available;
use clothcombo_data::asset::{Binding, Body, Category, Garment, Provenance};
use clothcombo_data::cache::{
    ArrayCache, Key, binding_key, body_key, get_binding, get_largest_weights, get_operators, mesh_key,
    operators_key, put_binding, put_operators,
};
use clothcombo_physics::operators::SurfaceOperators;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What is known of every garment without reading it.
#[derive(Clone, Debug)]
pub struct GarmentInfo {
    /// Name, unique within a source.
    pub name: String,
    /// Category.
    pub category: Category,
    /// Whether the holding loss keeps its upper rim in place.
    pub holding: bool,
    /// Where it comes from.
    pub source: Provenance,
    /// Number of vertices.
    pub vertices: usize,
    /// Key of the rest mesh.
    pub mesh: Key,
}

/// All garments of a run.
pub struct GarmentStore {
    cards: Vec<GarmentInfo>,
    joints: ActiveJoints,
    store: Store,
}

enum Store {
    Kept { garments: Vec<Arc<PreparedGarment>>, operators: Vec<Arc<SurfaceOperators>> },
    Streamed(Box<Streamed>),
}

/// What a garment's records are stored under.
#[derive(Clone, Copy)]
struct Keys {
    binding: Key,
    operators: Key,
}

struct Streamed {
    cache: ArrayCache,
    keys: Vec<Keys>,
    recent: LruCache<PreparedGarment>,
    sources: Vec<GarmentSource>,
    preprocessor: Preprocessor,
}

/// What the first pass over a garment leaves.
struct IndexEntry {
    card: GarmentInfo,
    largest_weights: Vec<f32>,
    kept: Option<(Garment, Binding, SurfaceOperators)>,
    keys: Option<Keys>,
}

impl GarmentStore {
    /// Reads or makes all garments `config` names, and computes what the cache does not hold. Those of a streamed wardrobe are
    /// kept within `memory`. `progress(done, total, name)` is called per garment.
    ///
    /// # Errors
    /// [`DatasetError`] names the file or garment at fault; [`DatasetError::Memory`] if the machine cannot hold garments that
    /// are not streamed, before any of them is prepared.
    pub fn load(
        config: &Config,
        body: Arc<Body>,
        memory: &Arc<MemoryBudget>,
        progress: &(dyn Fn(usize, usize, &str) + Sync),
    ) -> Result<Self, DatasetError> {
        let sources = GarmentSource::list(&config.data.garments)?;
        let preprocessor = Preprocessor::new(config, body);
        let cache = config.data.open_cache().map_err(DatasetError::data)?;
        if cache.is_none()
            && let Some(available) = available()
        {
            let sizes = DataSizes::of_listed(&sources, &preprocessor.body)?;
            let (garments, needed) = (sources.len(), sizes.unstreamed_bytes(config));
            if needed > available {
                return Err(DatasetError::Memory { garments, needed, available });
            }
        }
        let looks =
            index_garments(&sources, &preprocessor, cache.as_ref(), config.data.max_vertices, progress)?;

        // Computing operators takes more than a step of small networks.
        return_freed_memory();
        let joints =
            ActiveJoints::new(&preprocessor.body, looks.iter().map(|l| l.largest_weights.as_slice()));
        let cards = looks.iter().map(|l| l.card.clone()).collect();
        let store = match cache {
            Some(cache) => Store::Streamed(Box::new(Streamed {
                cache,
                keys: looks.iter().filter_map(|l| l.keys).collect(),
                recent: LruCache::new(memory, Residence::Host),
                sources,
                preprocessor,
            })),
            None => {
                let parts =
                    looks.into_par_iter().filter_map(|l| l.kept).map(|(garment, binding, operators)| {
                        let garment = preprocessor.finish(garment, binding, &joints)?;
                        Ok((Arc::new(garment), Arc::new(operators)))
                    });
                let (garments, operators) =
                    parts.collect::<Result<Vec<_>, DatasetError>>()?.into_iter().unzip();
                Store::Kept { garments, operators }
            }
        };
        Ok(Self { cards, joints, store })
    }

    /// Computes and stores what the cache of `config` does not hold of every `of`-th garment from garment `part` on, so
    /// that several processes or machines may share the work. Doing it again costs only the reading of the garments.
    /// Returns the number of garments looked at and the bytes in the cache.
    ///
    /// # Errors
    /// [`DatasetError`] names the file or garment at fault, or the missing setting.
    pub fn prepare(
        config: &Config,
        body: Arc<Body>,
        [part, of]: [usize; 2],
        progress: &(dyn Fn(usize, usize, &str) + Sync),
    ) -> Result<(usize, u64), DatasetError> {
        let cache = config.data.open_cache().map_err(DatasetError::data)?.ok_or(DatasetError::NoCache)?;
        let sources: Vec<_> =
            GarmentSource::list(&config.data.garments)?.into_iter().skip(part).step_by(of.max(1)).collect();
        let preprocessor = Preprocessor::new(config, body);
        index_garments(&sources, &preprocessor, Some(&cache), config.data.max_vertices, progress)?;
        Ok((sources.len(), cache.used()))
    }

    /// Number of garments.
    pub fn len(&self) -> usize {
        self.cards.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.cards.is_empty()
    }

    /// What is known of garment `index` without reading it.
    pub fn info(&self, index: usize) -> &GarmentInfo {
        &self.cards[index]
    }

    /// Joints that carry any garment.
    pub fn joints(&self) -> &ActiveJoints {
        &self.joints
    }

    /// Garment `index`.
    ///
    /// # Errors
    /// [`DatasetError`] when its records vanished from the cache and it cannot be made again.
    pub fn garment(&self, index: usize) -> Result<Arc<PreparedGarment>, DatasetError> {
        let streamed = match &self.store {
            Store::Kept { garments, .. } => return Ok(garments[index].clone()),
            Store::Streamed(streamed) => streamed,
        };
        if let Some(garment) = streamed.recent.get(index) {
            return Ok(garment);
        }
        let garment = streamed.read(index, &self.cards[index], &self.joints)?;
        let bytes = garment.bytes();
        Ok(streamed.recent.insert(index, garment, bytes))
    }

    /// DiffusionNet's operators of garment `index`.
    ///
    /// # Errors
    /// As [`garment`](Self::garment).
    pub fn operators(&self, index: usize) -> Result<Arc<SurfaceOperators>, DatasetError> {
        match &self.store {
            Store::Kept { operators, .. } => Ok(operators[index].clone()),
            Store::Streamed(streamed) => {
                if let Some(operators) = get_operators(&streamed.cache, streamed.keys[index].operators) {
                    return Ok(Arc::new(operators));
                }
                streamed.restore(index)?;
                let again = get_operators(&streamed.cache, streamed.keys[index].operators);
                again.map(Arc::new).ok_or_else(|| streamed.lost(&self.cards[index]))
            }
        }
    }
}

impl Streamed {
    fn read(
        &self,
        index: usize,
        card: &GarmentInfo,
        joints: &ActiveJoints,
    ) -> Result<PreparedGarment, DatasetError> {
        let get = || get_binding(&self.cache, self.keys[index].binding, self.preprocessor.body.joint_count());
        let (rest, binding) = match get() {
            Some(found) => found,
            None => {
                self.restore(index)?;
                get().ok_or_else(|| self.lost(card))?
            }
        };
        let GarmentInfo { name, category, holding, source, .. } = card.clone();
        self.preprocessor.finish(Garment { name, category, rest, holding, source }, binding, joints)
    }

    /// Computes the records of a garment again that were there at the start of the run and no longer are.
    fn restore(&self, index: usize) -> Result<(), DatasetError> {
        tracing::warn!(cache = %self.cache.root().display(), "a record vanished during the run, computed anew");
        let origin = std::slice::from_ref(&self.sources[index]);
        index_garments(origin, &self.preprocessor, Some(&self.cache), usize::MAX, &|_, _, _| {}).map(|_| ())
    }

    fn lost(&self, card: &GarmentInfo) -> DatasetError {
        DatasetError::Vanished { name: card.name.clone(), cache: self.cache.root().into() }
    }
}

/// Makes every garment once: what is missing is computed, and stored or kept. Only as many as there are threads are in work at
/// a time: one that waits for a part of its garment would begin another one.
fn index_garments(
    sources: &[GarmentSource],
    preprocessor: &Preprocessor,
    cache: Option<&ArrayCache>,
    max_vertices: usize,
    progress: &(dyn Fn(usize, usize, &str) + Sync),
) -> Result<Vec<IndexEntry>, DatasetError> {
    let maker = GarmentLoader::new(&preprocessor.body, sources)?;
    let body = cache.map(|_| body_key(&preprocessor.body));
    let done = AtomicUsize::new(0);
    let look = |origin: &GarmentSource| {
        let garment = maker.make(origin)?;
        let vertices = garment.rest.vertex_count();
        if vertices > max_vertices {
            return Err(DatasetError::TooLarge { name: garment.name, vertices, limit: max_vertices });
        }
        let card = GarmentInfo {
            name: garment.name.clone(),
            category: garment.category,
            holding: garment.holding,
            source: garment.source.clone(),
            vertices,
            mesh: mesh_key(&garment.rest),
        };
        let look = match (cache, body) {
            (Some(cache), Some(body)) => stored(card, &garment, preprocessor, cache, body)?,
            _ => {
                let binding = Binding::new(&garment, &preprocessor.body, &preprocessor.binding);
                let operators = preprocessor.operators(&garment.name, &garment.rest)?;
                let largest_weights = binding.largest_weights(preprocessor.body.joint_count());
                IndexEntry { card, largest_weights, kept: Some((garment, binding, operators)), keys: None }
            }
        };
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, sources.len(), &look.card.name);
        Ok(look)
    };
    let mut looks = Vec::with_capacity(sources.len());
    for at_once in sources.chunks(rayon::current_num_threads()) {
        looks.par_extend(at_once.par_iter().map(look).collect::<Result<Vec<_>, _>>()?);
    }
    Ok(looks)
}

fn stored(
    card: GarmentInfo,
    garment: &Garment,
    preprocessor: &Preprocessor,
    cache: &ArrayCache,
    body: Key,
) -> Result<IndexEntry, DatasetError> {
    let joints = preprocessor.body.joint_count();
    let keys = Keys {
        binding: binding_key(card.mesh, body, garment.category, &preprocessor.binding),
        operators: operators_key(card.mesh, preprocessor.eigen_count),
    };
    let largest_weights = match get_largest_weights(cache, keys.binding) {
        Some(largest) if largest.len() == joints => largest,
        _ => {
            let binding = Binding::new(garment, &preprocessor.body, &preprocessor.binding);
            put_binding(cache, keys.binding, &garment.rest, &binding, joints).map_err(DatasetError::data)?;
            binding.largest_weights(joints)
        }
    };
    if !cache.contains(keys.operators) {
        let operators = preprocessor.operators(&garment.name, &garment.rest)?;
        put_operators(cache, keys.operators, &operators).map_err(DatasetError::data)?;
    }
    Ok(IndexEntry { card, largest_weights, kept: None, keys: Some(keys) })
}
