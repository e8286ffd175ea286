//! Initial linear blend skinning of every vertex, as one affine map.

use super::prepared_garment::PreparedGarment;
use clothcombo_physics::transform::Transform;
use std::sync::Arc;

/// The transforms, canonical → posed, that `bones` blend to by the initial skin weights of `garments`, `[ΣV]`.
pub fn skinning_transforms(garments: &[Arc<PreparedGarment>], bones: &[Transform]) -> Vec<Transform> {
    let rows = garments.iter().flat_map(|garment| garment.skin_weights.chunks_exact(bones.len()));
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
