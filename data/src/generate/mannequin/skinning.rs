//! Skin weights of the mannequin: each vertex starts on its nearest bone, then the weights diffuse over the surface.

use super::anatomy;
use crate::asset::{BODY_JOINT_COUNT, BODY_JOINT_PARENTS, SparseSkinWeights};
use clothcombo_physics::vec3::{add, dot, norm, norm_squared, scale, sub};

/// A bone of `joint` with the limb's usual radius, by which distances are measured.
struct SkinBone {
    joint: usize,
    from: [f64; 3],
    to: [f64; 3],
    radius: f64,
}

fn bones() -> Vec<SkinBone> {
    let joint = anatomy::REST_JOINTS;
    let mut bones = Vec::new();
    for child in 1..BODY_JOINT_COUNT {
        let Some(parent) = BODY_JOINT_PARENTS[child] else { continue };
        let (mut from, mut to) = (joint[parent], joint[child]);
        let mut radius = match parent {
            0 | 3 | 6 | 9 => 0.11,
            1 | 2 => 0.07,
            4 | 5 => 0.05,
            12 => 0.075,
            13 | 14 => 0.07,
            16 | 17 => 0.045,
            _ => 0.035,
        };
        match child {
            // The pelvis owns only a part of the bone to the hips: the groin bends there.
            1 | 2 => {
                to = add(from, scale(sub(to, from), 0.55));
                radius = 0.10;
            }
            // The chest ends below the neck, which would otherwise own no skin.
            12 => to = add(from, scale(sub(to, from), 0.55)),
            // The collars carry the shoulder, the chest the bones to the collars.
            13 | 14 => from = add(from, scale(sub(to, from), 0.2)),
            _ => {}
        }
        bones.push(SkinBone { joint: parent, from, to, radius });
    }
    for (tip_joint, tip) in anatomy::tips() {
        let radius = if tip_joint == 15 { 0.085 } else { 0.045 };
        bones.push(SkinBone { joint: tip_joint, from: joint[tip_joint], to: tip, radius });
    }
    bones
}

fn distance_to_segment(p: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
    let axis = sub(b, a);
    let t = (dot(sub(p, a), axis) / norm_squared(axis)).clamp(0.0, 1.0);
    norm(sub(p, add(a, scale(axis, t))))
}

/// Rounds of diffusion; the width of a joint's blend grows with its square root, about 4 cm either side here.
const DIFFUSION_ROUNDS: usize = 14;

/// At most four joints per vertex, summing to one.
pub(super) fn skin_weights(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> SparseSkinWeights {
    let bones = bones();
    let mut ring = vec![Vec::new(); positions.len()];
    for face in faces {
        for corner in 0..3 {
            // On a closed, consistently oriented surface every neighbour is met exactly once.
            ring[face[corner] as usize].push(face[(corner + 1) % 3] as usize);
        }
    }
    let mut weights: Vec<[f64; BODY_JOINT_COUNT]> = positions
        .iter()
        .map(|p| {
            let mut row = [0.0; BODY_JOINT_COUNT];
            let distance: Vec<f64> =
                bones.iter().map(|b| distance_to_segment(*p, b.from, b.to) / b.radius).collect();
            let nearest = distance.iter().copied().fold(f64::MAX, f64::min);
            // A soft choice: bones nearly as close share the vertex, so that the assignment has no ragged border.
            for (bone, d) in bones.iter().zip(&distance) {
                row[bone.joint] += (-((d - nearest) / 0.10).powi(2)).exp();
            }
            normalise(&mut row);
            row
        })
        .collect();
    for _ in 0..DIFFUSION_ROUNDS {
        weights = (0..positions.len())
            .map(|v| {
                let share = 0.5 / ring[v].len().max(1) as f64;
                std::array::from_fn(|j| {
                    0.5 * weights[v][j] + share * ring[v].iter().map(|u| weights[*u][j]).sum::<f64>()
                })
            })
            .collect();
    }
    SparseSkinWeights::from_rows(weights.into_iter().map(|row| {
        let mut list: Vec<(u16, f32)> =
            row.iter().enumerate().filter(|(_, w)| **w > 1e-3).map(|(j, w)| (j as u16, *w as f32)).collect();
        list.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        list.truncate(4);
        list.sort_by_key(|entry| entry.0);
        list
    }))
}

fn normalise(row: &mut [f64; BODY_JOINT_COUNT]) {
    let sum: f64 = row.iter().sum();
    row.iter_mut().for_each(|w| *w /= sum);
}
