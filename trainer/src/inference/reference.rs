//! The scene that the static solver brings into equilibrium: what drapes are measured against.
//!
//! Its energy is that of the losses of the configuration with the weights they end with, in f64 and in the form of
//! [`SceneEnergy::continuous`]; and garments are held by their posed positions, whatever the configuration says. Training uses
//! the cheaper forms. Of one garment this energy has no jumps. Where two sheets of an inner garment are equally near, one on each
//! side, the contact between garments jumps, by up to 0.4 J.

use crate::config::LossesConfig;
use crate::dataset::PreparedScene;
use clothcombo_physics::energy::{
    EnergyError, EnergySettings, GarmentEnergies, SceneEnergy, SceneGarment, SceneLayers,
};
use clothcombo_physics::mesh::Topology;
use std::sync::Arc;

/// A scene on its first body in f64, ready to be solved.
pub struct ReferenceScene {
    /// Energy of posed positions.
    pub energy: SceneEnergy<f64>,
    /// Linear blend skinning of the start state (with shape transfer), `[ΣV, 3]`.
    pub skinned_start: Vec<[f64; 3]>,
}

impl ReferenceScene {
    /// Takes over the body, the weights and the start of `scene`.
    ///
    /// # Errors
    /// When a garment has no energies: it has no area, or a setting is out of range.
    pub fn new(losses: &LossesConfig, scene: &PreparedScene) -> Result<Self, EnergyError> {
        let settings = losses.energy_settings().continuous();
        let body = &scene.bodies[0];
        let transforms = scene.skinning_transforms();
        let mut garments = Vec::new();
        for (garment, narrow) in scene.garments.iter().zip(&body.energy.garments) {
            let mesh = &garment.garment.rest;
            let settings = EnergySettings { material: *narrow.energies.material(), ..settings };
            let energies =
                GarmentEnergies::new(mesh, &Topology::new(mesh), &settings, garment.garment.holding)?;
            garments.push(SceneGarment {
                energies: Arc::new(energies),
                holding_reference: wide(&narrow.holding_reference),
                thickness_below: narrow.thickness_below.iter().map(|t| f64::from(*t)).collect(),
                pull_back: None,
                weights: narrow.weights,
            });
        }
        let layers = body.energy.layers.iter();
        let layers =
            layers.map(|l| SceneLayers { inner: l.inner, outer: l.outer, weights: l.weights }).collect();
        let body = Arc::new(scene.exact_body());
        Ok(Self {
            energy: SceneEnergy { body, garments, layers, settings }.continuous().pulled_back(&transforms),
            skinned_start: scene.skinned_start(&transforms),
        })
    }
}

/// In f64.
pub(crate) fn wide(positions: &[[f32; 3]]) -> Vec<[f64; 3]> {
    positions.iter().map(|p| p.map(f64::from)).collect()
}
