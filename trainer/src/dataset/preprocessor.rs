//! How a rest mesh becomes a [`PreparedGarment`]: the same for training and for draping.

use super::active_joints::ActiveJoints;
use super::error::DatasetError;
use super::prepared_garment::PreparedGarment;
use crate::config::Config;
use clothcombo_data::asset::{Binding, BindingSettings, Body, Category, Garment};
use clothcombo_data::cache::{
    ArrayCache, CacheError, Key, binding_key, body_key, get_binding, get_largest_weights, get_operators,
    operators_key, put_binding, put_operators,
};
use clothcombo_physics::energy::{EnergySettings, GarmentEnergies};
use clothcombo_physics::mesh::{Topology, TriMesh};
use clothcombo_physics::operators::SurfaceOperators;
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// Body and settings with which garments are prepared, and the cache of what that computes, if there is one.
pub struct Preprocessor {
    /// The body garments are bound to.
    pub body: Arc<Body>,
    /// How they are bound.
    pub binding: BindingSettings,
    /// Constants of the losses.
    pub energy: EnergySettings,
    /// Eigenpairs a garment is described with.
    pub eigen_count: usize,
    /// Bindings, operators and embeddings on disk, by the content of the rest mesh.
    cache: Option<ArrayCache>,
    body_key: Key,
    /// Why something could not be stored; nothing more is stored then.
    failure: OnceLock<CacheError>,
}

impl Preprocessor {
    /// That of a run with `config` on `body`, without a cache.
    pub fn new(config: &Config, body: Arc<Body>) -> Self {
        let start = &config.start;
        Self {
            body_key: body_key(&body),
            body,
            binding: BindingSettings {
                smoothing_iterations: start.smoothing_iterations,
                skirt_smoothing_iterations: start.skirt_smoothing_iterations,
                smooth: start.smooth_weights,
                shape_transfer: start.shape_transfer,
            },
            energy: config.losses.energy_settings(),
            eigen_count: config.model.eigen_count,
            cache: None,
            failure: OnceLock::new(),
        }
    }

    /// The same with a cache.
    pub fn with_cache(self, cache: ArrayCache) -> Self {
        Self { cache: Some(cache), ..self }
    }

    /// The same with the cache in `folder`, of at most `limit` bytes; without one, and with a warning, if it cannot be used.
    pub fn with_cache_in(self, folder: &Path, limit: u64) -> Self {
        match ArrayCache::open(folder, limit) {
            Ok(cache) => self.with_cache(cache),
            Err(error) => {
                tracing::warn!("{error}; going on without a cache");
                self
            }
        }
    }

    /// The cache.
    pub fn cache(&self) -> Option<&ArrayCache> {
        self.cache.as_ref()
    }

    /// Stores something, unless that failed before. A cache only saves time: what cannot be stored is a warning, the first time.
    pub fn store(&self, put: impl FnOnce(&ArrayCache) -> Result<(), CacheError>) {
        let Some(cache) = self.cache().filter(|_| self.failure.get().is_none()) else { return };
        if let Err(error) = put(cache) {
            let warning = format!("{error}; nothing more is stored");
            if self.failure.set(error).is_ok() {
                tracing::warn!("{warning}");
            }
        }
    }

    /// Why nothing more is stored, if so.
    pub fn store_failure(&self) -> Option<&CacheError> {
        self.failure.get()
    }

    /// The binding of a garment whose rest mesh has the key `mesh`: from the cache, or computed and stored there.
    pub fn binding(&self, garment: &Garment, mesh: Key) -> Binding {
        match self.stored_binding(mesh, garment.category) {
            Some((_, binding)) => binding,
            None => self.compute_binding(garment, mesh),
        }
    }

    /// The largest skin weight of every joint; the binding comes from the cache, or is computed and stored there.
    pub fn largest_weights(&self, garment: &Garment, mesh: Key) -> Vec<f32> {
        let joints = self.body.joint_count();
        let key = self.binding_key(mesh, garment.category);
        match self.cache().and_then(|cache| get_largest_weights(cache, key)) {
            Some(largest) if largest.len() == joints => largest,
            _ => self.compute_binding(garment, mesh).largest_weights(joints),
        }
    }

    fn compute_binding(&self, garment: &Garment, mesh: Key) -> Binding {
        let binding = Binding::new(garment, &self.body, &self.binding);
        let (key, joints) = (self.binding_key(mesh, garment.category), self.body.joint_count());
        self.store(|cache| put_binding(cache, key, &garment.rest, &binding, joints));
        binding
    }

    /// The rest mesh and the binding that the cache has of it.
    pub fn stored_binding(&self, mesh: Key, category: Category) -> Option<(TriMesh, Binding)> {
        get_binding(self.cache()?, self.binding_key(mesh, category), self.body.joint_count())
    }

    fn binding_key(&self, mesh: Key, category: Category) -> Key {
        binding_key(mesh, self.body_key, category, &self.binding)
    }

    /// DiffusionNet's operators of a rest mesh of key `mesh`: from the cache, or computed and stored there.
    ///
    /// # Errors
    /// When the mesh has none, by the garment's `name`.
    pub fn operators(&self, name: &str, rest: &TriMesh, mesh: Key) -> Result<SurfaceOperators, DatasetError> {
        match self.stored_operators(mesh) {
            Some(operators) => Ok(operators),
            None => self.compute_operators(name, rest, mesh),
        }
    }

    /// Computes the operators that [`operators`](Self::operators) would have to compute, and stores them.
    ///
    /// # Errors
    /// As [`operators`](Self::operators).
    pub fn store_operators(&self, name: &str, rest: &TriMesh, mesh: Key) -> Result<(), DatasetError> {
        let key = operators_key(mesh, self.eigen_count);
        match self.cache().is_some_and(|cache| cache.contains(key)) {
            true => Ok(()),
            false => self.compute_operators(name, rest, mesh).map(drop),
        }
    }

    fn compute_operators(
        &self,
        name: &str,
        rest: &TriMesh,
        mesh: Key,
    ) -> Result<SurfaceOperators, DatasetError> {
        let operators =
            SurfaceOperators::new(rest, self.eigen_count).map_err(|e| DatasetError::garment(name, e))?;
        self.store(|cache| put_operators(cache, operators_key(mesh, self.eigen_count), &operators));
        Ok(operators)
    }

    /// The operators that the cache has of the rest mesh of key `mesh`.
    pub fn stored_operators(&self, mesh: Key) -> Option<SurfaceOperators> {
        get_operators(self.cache()?, operators_key(mesh, self.eigen_count))
    }

    /// Puts a garment and its binding together for networks that see `joints`.
    ///
    /// # Errors
    /// When the garment has no energies.
    pub fn finish(
        &self,
        garment: Garment,
        binding: Binding,
        joints: &ActiveJoints,
    ) -> Result<PreparedGarment, DatasetError> {
        let topology = Topology::new(&garment.rest);
        let material = garment.material.over(&self.energy.material);
        let settings = EnergySettings { material, ..self.energy };
        let energies = GarmentEnergies::new(&garment.rest, &topology, &settings, garment.holding)
            .map_err(|e| DatasetError::garment(&garment.name, e))?;
        Ok(PreparedGarment {
            skin_weights: joints.restrict(&binding.skin_weights),
            shape_directions: binding.shape_directions,
            energies: Arc::new(energies),
            footprint: OnceLock::new(),
            garment,
        })
    }
}
