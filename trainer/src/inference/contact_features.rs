//! Contact features of a scene, for the correction networks.

use crate::dataset::{PreparedBody, PreparedGarment, PreparedScene};
use burn::tensor::Device;
use clothcombo_model::{ContactFeatureTensors, Mode};
use clothcombo_physics::contact_features::{ContactFeatures, DIRECTIONS, FEATURES, Rings};
use clothcombo_physics::energy::SceneEnergy;
use std::sync::Arc;

/// Whether the garments of a scene interact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerInteraction {
    /// Every garment is draped as a single garment.
    SingleGarments,
    /// All garments are draped together.
    Together,
}

impl LayerInteraction {
    /// How far the forward pass goes.
    pub fn mode(self) -> Mode {
        match self {
            Self::SingleGarments => Mode::Single,
            Self::Together => Mode::Layered,
        }
    }

    /// The pairs (inner, outer) of `scene` that interact.
    pub fn contacts(self, scene: &PreparedScene) -> &[(usize, usize)] {
        match self {
            Self::SingleGarments => &[],
            Self::Together => &scene.contacts,
        }
    }

    /// The energy of `scene` on its first body, with the layer losses of the pairs that interact.
    pub fn energy(self, scene: &PreparedScene) -> SceneEnergy<f32> {
        let energy = &scene.bodies[0].energy;
        match self {
            Self::SingleGarments => energy.without_layers(),
            Self::Together => (**energy).clone(),
        }
    }
}

const _: () =
    assert!(FEATURES == ContactFeatureTensors::FEATURES && DIRECTIONS == ContactFeatureTensors::DIRECTIONS);

/// Contact features of the garments of `scene` at `posed` `[ΣV, 3]` (m) on `body`, as tensors on `device`.
///
/// `contacts` are the pairs (inner, outer) that interact: those of the scene, or none for single garments.
pub fn contact_features(
    scene: &PreparedScene,
    body: &PreparedBody,
    contacts: &[(usize, usize)],
    posed: &[[f32; 3]],
    device: &Device,
) -> ContactFeatureTensors {
    let rings: Vec<&Rings> = scene.garments.iter().map(|garment| &garment.rings).collect();
    let ContactFeatures { features, directions } =
        ContactFeatures::new(&body.energy, &rings, posed, contacts);
    let directions = directions.map(|posed| unposed(scene, body, &posed));
    ContactFeatureTensors::new(features, directions.each_ref().map(Vec::as_slice), device)
        .expect("every vertex of the scene has its features")
}

/// Posed directions `[ΣV, 3]` turned back by the transforms that the initial skin weights give their vertices.
fn unposed(scene: &PreparedScene, body: &PreparedBody, posed: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let bones = &body.bones;
    let turned_back = |direction: &[f32; 3], weights: &[f32]| {
        let mut canonical = [0.0; 3];
        for (bone, &weight) in bones.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
            for (axis, sum) in canonical.iter_mut().enumerate() {
                let along: f64 = (0..3).map(|row| bone[row][axis] * f64::from(direction[row])).sum();
                *sum += f64::from(weight) * along;
            }
        }
        canonical.map(|x| x as f32)
    };
    let of_garment = |(garment, part): (&Arc<PreparedGarment>, &[[f32; 3]])| {
        let rows = garment.skin_weights.chunks_exact(bones.len().max(1));
        part.iter().zip(rows).map(|(direction, weights)| turned_back(direction, weights)).collect::<Vec<_>>()
    };
    scene.garments.iter().zip(scene.parts(posed)).flat_map(of_garment).collect()
}
