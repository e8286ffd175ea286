//! All garments of a run, in memory or streamed from the cache.
//!
//! Without a cache everything is computed at the start and kept, if the machine has the memory. With one, what is expensive
//! is computed once, a few garments at a time, and stored; a run keeps the garments it used last, within `data.memory_mib`,
//! and reads the others again when a scene samples them: a dataset may be many times larger than memory, and the results are
//! the same to the bit.

use super::active_joints::ActiveJoints;
use super::error::DatasetError;
use super::garment_source::{GarmentLoader, GarmentSource};
use super::prepared_garment::PreparedGarment;
use super::preprocessor::Preprocessor;
use super::sizes::DataSizes;
use crate::config::Config;
use crate::system::allocator::return_freed_memory;
use crate::system::lru_cache::{LruCache, MemoryBudget, Residence};
use crate::system::memory::{available, gibibytes};
use clothcombo_data::asset::{Binding, Body, Category, Garment, GarmentMaterial, Provenance};
use clothcombo_data::cache::{ArrayCache, Key, mesh_key};
use clothcombo_physics::operators::SurfaceOperators;
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// What is known of every garment without reading it.
#[derive(Clone, Debug)]
pub struct GarmentInfo {
    /// Name, unique within a source.
    pub name: String,
    /// Category.
    pub category: Category,
    /// Whether the holding loss keeps its upper rim in place.
    pub holding: bool,
    /// What it is made of, where that is not the configuration's.
    pub material: GarmentMaterial,
    /// Where it comes from.
    pub source: Provenance,
    /// Number of vertices.
    pub vertices: usize,
    /// Key of the rest mesh.
    pub mesh: Key,
}

/// All garments of a run.
pub struct GarmentStore {
    infos: Vec<GarmentInfo>,
    joints: ActiveJoints,
    /// Of each garment, what stays in memory: everything without a cache, nothing of what a cache has.
    kept: Vec<Option<Kept>>,
    /// The others, read from the cache: those used last.
    recent: LruCache<PreparedGarment>,
    sources: Vec<GarmentSource>,
    preprocessor: Preprocessor,
}

struct Kept {
    garment: Arc<PreparedGarment>,
    operators: Arc<SurfaceOperators>,
}

/// What the first pass over a garment leaves.
struct IndexEntry {
    info: GarmentInfo,
    largest_weights: Vec<f32>,
    /// What is in no cache.
    kept: Option<(Garment, Binding, SurfaceOperators)>,
}

impl GarmentStore {
    /// Reads or makes all garments `config` names, and computes what the cache does not hold. Those of a streamed dataset are
    /// kept within `memory`. The networks see the joints that carry the garments or, if given, those of the names `joints`.
    /// `progress(done, total, name)` is called per garment. A cache that cannot be used costs time and memory only.
    ///
    /// # Errors
    /// [`DatasetError`] names the file or garment at fault; or says so if the machine cannot hold garments that
    /// are not streamed, before any of them is prepared.
    pub fn load(
        config: &Config,
        body: Arc<Body>,
        joints: Option<&[String]>,
        memory: &Arc<MemoryBudget>,
        progress: &(dyn Fn(usize, usize, &str) + Sync),
    ) -> Result<Self, DatasetError> {
        let sources = GarmentSource::list(&config.data.garments)?;
        let mut preprocessor = Preprocessor::new(config, body);
        if let Some(folder) = &config.data.cache.folder {
            preprocessor = preprocessor.with_cache_in(folder, config.data.cache_limit());
        }
        let check_memory = || {
            let Some(available) = available() else { return Ok(()) };
            let needed = DataSizes::of_listed(&sources, &preprocessor.body)?.unstreamed_bytes(config);
            match needed > available {
                true => Err(DatasetError::new(
                    format!(
                        "the {} garments take about {} of memory, of which {} are available",
                        sources.len(),
                        gibibytes(needed),
                        gibibytes(available)
                    ),
                    "set data.cache.folder: what is computed from a garment is then kept on disk, and read when a scene needs it",
                )),
                false => Ok(()),
            }
        };
        if preprocessor.cache().is_none() {
            check_memory()?;
        }
        let index =
            index_garments(&sources, &preprocessor, config.data.max_vertices, &check_memory, progress)?;

        // Computing operators takes more than a step of small networks.
        return_freed_memory();
        let joints = match joints {
            Some(names) => ActiveJoints::named(&preprocessor.body, names).map_err(|missing| {
                let (body, missing) = (&preprocessor.body.name, missing.join(", "));
                DatasetError::new(
                    format!("body {body} has no joint {missing}, which the networks were trained with"),
                    "use the body of the checkpoint, or train a new model",
                )
            })?,
            None => ActiveJoints::new(
                &preprocessor.body,
                index.iter().map(|entry| entry.largest_weights.as_slice()),
            ),
        };
        let infos = index.iter().map(|entry| entry.info.clone()).collect();
        let finish = |entry: IndexEntry| {
            let Some((garment, binding, operators)) = entry.kept else { return Ok(None) };
            let garment = preprocessor.finish(garment, binding, &joints)?;
            Ok(Some(Kept { garment: Arc::new(garment), operators: Arc::new(operators) }))
        };
        let kept = index.into_par_iter().map(finish).collect::<Result<Vec<_>, DatasetError>>()?;
        let recent = LruCache::new(memory, Residence::Host);
        Ok(Self { infos, joints, kept, recent, sources, preprocessor })
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
        let folder = config.data.cache.folder.as_ref().ok_or_else(|| {
            DatasetError::new(
                "the configuration names no cache to prepare".to_owned(),
                "set data.cache.folder, in the file or with --set data.cache.folder=\"datasets/cache/prepared\"",
            )
        })?;
        let cache = ArrayCache::open(folder, config.data.cache_limit()).map_err(DatasetError::data)?;
        let sources: Vec<_> =
            GarmentSource::list(&config.data.garments)?.into_iter().skip(part).step_by(of.max(1)).collect();
        let preprocessor = Preprocessor::new(config, body).with_cache(cache);
        // What is not stored was prepared for nothing.
        let stop = || preprocessor.store_failure().map_or(Ok(()), |e| Err(DatasetError::data(e)));
        index_garments(&sources, &preprocessor, config.data.max_vertices, &stop, progress)?;
        Ok((sources.len(), preprocessor.cache().map_or(0, ArrayCache::used)))
    }

    /// Number of garments.
    pub fn len(&self) -> usize {
        self.infos.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.infos.is_empty()
    }

    /// What is known of garment `index` without reading it.
    pub fn info(&self, index: usize) -> &GarmentInfo {
        &self.infos[index]
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
        if let Some(kept) = &self.kept[index] {
            return Ok(kept.garment.clone());
        }
        if let Some(garment) = self.recent.get(index) {
            return Ok(garment);
        }
        let garment = self.read(index)?;
        let bytes = garment.bytes();
        Ok(self.recent.insert(index, garment, bytes))
    }

    /// DiffusionNet's operators of garment `index`.
    ///
    /// # Errors
    /// As [`garment`](Self::garment).
    pub fn operators(&self, index: usize) -> Result<Arc<SurfaceOperators>, DatasetError> {
        if let Some(kept) = &self.kept[index] {
            return Ok(kept.operators.clone());
        }
        let GarmentInfo { name, mesh, .. } = &self.infos[index];
        let operators = match self.preprocessor.stored_operators(*mesh) {
            Some(operators) => operators,
            None => self.preprocessor.operators(name, &self.again(index)?.rest, *mesh)?,
        };
        Ok(Arc::new(operators))
    }

    /// Garment `index`, from the cache.
    fn read(&self, index: usize) -> Result<PreparedGarment, DatasetError> {
        let GarmentInfo { name, category, holding, material, source, mesh, .. } = self.infos[index].clone();
        let (rest, binding) = match self.preprocessor.stored_binding(mesh, category) {
            Some(found) => found,
            None => {
                let garment = self.again(index)?;
                let binding = self.preprocessor.binding(&garment, mesh);
                (garment.rest, binding)
            }
        };
        let garment = Garment { name, category, rest, holding, material, source };
        self.preprocessor.finish(garment, binding, &self.joints)
    }

    /// Garment `index`, whose record was there at the start of the run and no longer is.
    fn again(&self, index: usize) -> Result<Garment, DatasetError> {
        let cache = self.preprocessor.cache().map_or(Path::new(""), ArrayCache::root);
        tracing::warn!(cache = %cache.display(), "a record vanished during the run, computed anew");
        let source = &self.sources[index];
        GarmentLoader::new(&self.preprocessor.body, std::slice::from_ref(source))?.load(source)
    }
}

/// Makes every garment once: what is missing is computed, and stored or kept. Only as many as there are threads are in work at
/// a time: one that waits for a part of its garment would begin another one. `may_keep` is asked before the first garment is
/// kept because it could not be stored.
fn index_garments(
    sources: &[GarmentSource],
    preprocessor: &Preprocessor,
    max_vertices: usize,
    may_keep: &(dyn Fn() -> Result<(), DatasetError> + Sync),
    progress: &(dyn Fn(usize, usize, &str) + Sync),
) -> Result<Vec<IndexEntry>, DatasetError> {
    let loader = GarmentLoader::new(&preprocessor.body, sources)?;
    let done = AtomicUsize::new(0);
    let asked = OnceLock::new();
    let has_failed = || preprocessor.cache().is_none() || preprocessor.store_failure().is_some();
    let stored = |garment: &Garment, info: &GarmentInfo| {
        if !has_failed() {
            let largest_weights = preprocessor.largest_weights(garment, info.mesh);
            preprocessor.store_operators(&garment.name, &garment.rest, info.mesh)?;
            if !has_failed() {
                return Ok(Some(IndexEntry { info: info.clone(), largest_weights, kept: None }));
            }
        }
        if preprocessor.store_failure().is_some() && asked.set(()).is_ok() {
            may_keep()?;
        }
        Ok(None)
    };
    let index = |source: &GarmentSource| {
        let garment = loader.load(source)?;
        let vertices = garment.rest.vertex_count();
        if vertices > max_vertices {
            let name = garment.name;
            return Err(DatasetError::new(
                format!(
                    "garment {name} has {vertices} vertices, more than data.max_vertices = {max_vertices}"
                ),
                "raise data.max_vertices (memory grows with it), or decimate the garment",
            ));
        }
        let info = GarmentInfo {
            name: garment.name.clone(),
            category: garment.category,
            holding: garment.holding,
            material: garment.material,
            source: garment.source.clone(),
            vertices,
            mesh: mesh_key(&garment.rest),
        };
        let entry = match stored(&garment, &info)? {
            Some(entry) => entry,
            None => {
                let binding = preprocessor.binding(&garment, info.mesh);
                let operators = preprocessor.operators(&garment.name, &garment.rest, info.mesh)?;
                let largest_weights = binding.largest_weights(preprocessor.body.joint_count());
                IndexEntry { info, largest_weights, kept: Some((garment, binding, operators)) }
            }
        };
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, sources.len(), &entry.info.name);
        Ok(entry)
    };
    let mut entries = Vec::with_capacity(sources.len());
    for at_once in sources.chunks(rayon::current_num_threads()) {
        entries.par_extend(at_once.par_iter().map(index).collect::<Result<Vec<_>, _>>()?);
    }
    Ok(entries)
}
