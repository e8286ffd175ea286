//! What the vertices of a scene feel, for the correction networks.

use crate::scene::{LibraryGarment, PreparedBody, PreparedScene};
use burn::tensor::Device;
use clothcombo_model::FeltTensors;
use clothcombo_physics::contact_features::{ContactFeatures, DIRECTIONS, FEATURES, Rings};
use std::sync::Arc;

/// Whether the garments of a scene feel each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Company {
    /// Every garment is draped by itself.
    Alone,
    /// All are worn together.
    Together,
}

impl Company {
    /// The pairs (inner, outer) of `scene` that feel each other.
    pub fn contacts(self, scene: &PreparedScene) -> &[(usize, usize)] {
        match self {
            Self::Alone => &[],
            Self::Together => &scene.contacts,
        }
    }
}

const _: () = assert!(FEATURES == FeltTensors::FEATURES && DIRECTIONS == FeltTensors::DIRECTIONS);

/// What the vertices of the garments of `scene` feel at `posed` `[ΣV, 3]` [m] on `body`, as tensors on `device`.
///
/// `contacts` are the pairs (inner, outer) that feel each other: those of the scene, or none for garments that are draped by
/// themselves.
pub fn felt(
    scene: &PreparedScene,
    body: &PreparedBody,
    contacts: &[(usize, usize)],
    posed: &[[f32; 3]],
    device: &Device,
) -> FeltTensors {
    let rings: Vec<&Rings> = scene.worn.iter().map(|worn| &worn.rings).collect();
    let ContactFeatures { features, directions } =
        ContactFeatures::new(&body.energy, &rings, posed, contacts);
    let directions = directions.map(|posed| unposed(scene, body, &posed));
    FeltTensors::new(features, directions.each_ref().map(Vec::as_slice), device)
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
    let of_garment = |(worn, part): (&Arc<LibraryGarment>, &[[f32; 3]])| {
        let rows = worn.skin_weights.chunks_exact(bones.len().max(1));
        part.iter().zip(rows).map(|(direction, weights)| turned_back(direction, weights)).collect::<Vec<_>>()
    };
    scene.worn.iter().zip(scene.parts(posed)).flat_map(of_garment).collect()
}
