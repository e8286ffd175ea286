//! The scene that the static solver brings into equilibrium: what drapes are measured against.
//!
//! Its energy is that of the losses of the configuration with the weights they end with, in f64 and without their jumps, which no
//! force can balance: the distance to the outside of the body, whose parts may intersect when posed (`Distance::Union`); all pairs
//! in the repulsion, from which the constant of each pair is taken off (`EnergySettings::repulsion_continuous`); the distance to
//! the closest point of an inner garment (`LayerContact::ClosestPoint`); and no layer distance, whose pairs change with the nearest
//! body vertex. Training uses the cheaper forms. Where two sheets of an inner garment are equally near, one on each side, the
//! contact between garments still jumps.

use crate::config::LossesConfig;
use crate::scene::PreparedScene;
use clothcombo_physics::energy::{
    EnergyError, EnergySettings, GarmentEnergies, LayerContact, SceneEnergy, SceneGarment, SceneLayers, Term,
    TermMap,
};
use clothcombo_physics::mesh::Topology;
use clothcombo_physics::query::{Distance, Surface};
use clothcombo_physics::transform::{Transform, apply};
use std::sync::Arc;

/// A scene on its first body in f64, ready to be solved.
pub struct ReferenceScene {
    /// Names of the garments, inner → outer.
    pub garments: Vec<String>,
    /// Energy of posed positions.
    pub energy: SceneEnergy<f64>,
    /// Initial blended skinning transform of every vertex, `[ΣV]`.
    pub transforms: Vec<Transform>,
    /// Linear blend skinning of the rest garments, `[ΣV, 3]`.
    pub skinned_rest: Vec<[f64; 3]>,
    /// Linear blend skinning of the start state (with shape transfer), `[ΣV, 3]`.
    pub skinned_start: Vec<[f64; 3]>,
}

/// The settings the reference is measured with: those of training, with exact distances and all pairs.
pub fn reference_settings(losses: &LossesConfig) -> EnergySettings {
    EnergySettings {
        distance: Distance::Union,
        repulsion_subset: None,
        repulsion_continuous: true,
        layer_contact: LayerContact::ClosestPoint,
        ..losses.energy_settings()
    }
}

impl ReferenceScene {
    /// Takes over the body, the weights and the start of `scene`.
    ///
    /// # Errors
    /// When a garment has no energies: it has no area, or a setting is out of range.
    pub fn new(losses: &LossesConfig, scene: &PreparedScene) -> Result<Self, EnergyError> {
        let settings = reference_settings(losses);
        let body = &scene.bodies[0];
        let start = wide(&body.start);
        let mut rest = Vec::with_capacity(start.len());
        let transforms = skinning_transforms(scene);
        let mut garments = Vec::new();
        for (garment, narrow) in scene.worn.iter().zip(&body.energy.garments) {
            let mesh = &garment.garment.rest;
            let energies =
                GarmentEnergies::new(mesh, &Topology::new(mesh), &settings, garment.garment.holding)?;
            garments.push(SceneGarment {
                energies: Arc::new(energies),
                holding_reference: wide(&narrow.holding_reference),
                weights: narrow.weights,
            });
            rest.extend_from_slice(mesh.positions());
        }
        let layers = body.energy.layers.iter();
        let layers = layers
            .map(|l| SceneLayers { inner: l.inner, outer: l.outer, weights: continuous(l.weights) })
            .collect();
        let surface = &body.energy.body;
        let skinned = |positions: &[[f64; 3]]| -> Vec<[f64; 3]> {
            transforms.iter().zip(positions).map(|(t, p)| apply(t, *p)).collect()
        };
        Ok(Self {
            garments: scene.worn.iter().map(|g| g.garment.name.clone()).collect(),
            energy: SceneEnergy {
                body: Arc::new(Surface::new(wide(&surface.positions), surface.faces.clone())),
                garments,
                layers,
                settings,
            },
            skinned_rest: skinned(&rest),
            skinned_start: skinned(&start),
            transforms,
        })
    }
}

/// Without the layer distance.
fn continuous(weights: TermMap<f64>) -> TermMap<f64> {
    TermMap::from_fn(|term| if term == Term::LayerDistance { 0.0 } else { weights[term] })
}

/// In f64.
pub(crate) fn wide(positions: &[[f32; 3]]) -> Vec<[f64; 3]> {
    positions.iter().map(|p| p.map(f64::from)).collect()
}

/// Initial blended skinning transform of every vertex of `scene` on its first body, `[ΣV]`.
pub(crate) fn skinning_transforms(scene: &PreparedScene) -> Vec<Transform> {
    let bones = &scene.bodies[0].bones;
    let rows = scene.worn.iter().flat_map(|garment| garment.skin_weights.chunks_exact(bones.len()));
    rows.map(|weights| blended(weights, bones)).collect()
}

fn blended(weights: &[f32], bones: &[Transform]) -> Transform {
    let mut sum = [[0.0; 4]; 3];
    for (weight, bone) in weights.iter().zip(bones) {
        for (row, bone_row) in sum.iter_mut().zip(bone) {
            for (x, b) in row.iter_mut().zip(bone_row) {
                *x += f64::from(*weight) * b;
            }
        }
    }
    sum
}
