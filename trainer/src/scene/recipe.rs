//! How a rest mesh becomes a [`LibraryGarment`]: the same for training and for draping.

use super::active_joints::ActiveJoints;
use super::error::LibraryError;
use super::garment::LibraryGarment;
use crate::config::Config;
use clothcombo_data::asset::{Binding, BindingSettings, Body, Garment};
use clothcombo_physics::contact_features::Rings;
use clothcombo_physics::energy::{EnergySettings, GarmentEnergies};
use clothcombo_physics::mesh::{Topology, TriMesh};
use clothcombo_physics::operators::SurfaceOperators;
use std::sync::Arc;

/// Body and settings with which garments are prepared.
#[derive(Clone)]
pub struct Recipe {
    /// The body garments are bound to.
    pub body: Arc<Body>,
    /// How they are bound.
    pub binding: BindingSettings,
    /// Constants of the losses.
    pub energy: EnergySettings,
    /// Eigenpairs a garment is described with.
    pub eigen_count: usize,
}

impl Recipe {
    /// That of a run with `config` on `body`.
    pub fn new(config: &Config, body: Arc<Body>) -> Self {
        let start = &config.start;
        Self {
            body,
            binding: BindingSettings {
                smoothing_iterations: start.smoothing_iterations,
                skirt_smoothing_iterations: start.skirt_smoothing_iterations,
                smooth: start.smooth_weights,
                shape_transfer: start.shape_transfer,
            },
            energy: config.losses.energy_settings(),
            eigen_count: config.model.eigen_count,
        }
    }

    /// DiffusionNet's operators of a rest mesh.
    ///
    /// # Errors
    /// When the mesh has none, by the garment's name.
    pub fn operators(&self, name: &str, rest: &TriMesh) -> Result<SurfaceOperators, LibraryError> {
        SurfaceOperators::new(rest, self.eigen_count)
            .map_err(|e| LibraryError::Garment { name: name.to_owned(), reason: e.to_string() })
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
    ) -> Result<LibraryGarment, LibraryError> {
        let topology = Topology::new(&garment.rest);
        let energies = GarmentEnergies::new(&garment.rest, &topology, &self.energy, garment.holding)
            .map_err(|e| LibraryError::Garment { name: garment.name.clone(), reason: e.to_string() })?;
        Ok(LibraryGarment {
            skin_weights: joints.restrict(&binding.skin_weights),
            shape_directions: binding.shape_directions,
            energies: Arc::new(energies),
            rings: Rings::new(&topology),
            garment,
        })
    }
}
