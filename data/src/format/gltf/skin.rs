//! Skins: vertices follow joint nodes.

use super::affine::{from_columns, product};
use super::buffers::Buffers;
use super::document::Primitive;
use clothcombo_physics::transform::{IDENTITY, Transform, apply};
use std::collections::HashMap;

/// Transforms of a skin's joints from where its vertices are bound to where the nodes are.
pub(super) struct Joints(Vec<Transform>);

impl Joints {
    /// `worlds`: of all nodes.
    pub fn new(buffers: &mut Buffers, skin: usize, worlds: &[Transform]) -> Result<Self, String> {
        let skin = buffers.document.skins.get(skin).ok_or_else(|| format!("skin {skin} is not there"))?;
        let inverse: Vec<Transform> = match skin.inverse_bind_matrices {
            None => vec![IDENTITY; skin.joints.len()],
            Some(accessor) => {
                let matrices: Vec<[f64; 16]> = buffers.numbers(accessor)?;
                matrices.iter().map(from_columns).collect()
            }
        };
        if inverse.len() < skin.joints.len() {
            return Err(format!("a skin binds {} of {} joints", inverse.len(), skin.joints.len()));
        }
        let of_joint = |(joint, inverse): (&usize, &Transform)| {
            let world =
                worlds.get(*joint).ok_or_else(|| format!("node {joint} of {} is named", worlds.len()))?;
            Ok(product(world, inverse))
        };
        skin.joints.iter().zip(&inverse).map(of_joint).collect::<Result<_, String>>().map(Self)
    }

    /// Moves vertices with their joints; those without weights stay.
    pub fn skin(
        &self,
        primitive: &Primitive,
        buffers: &mut Buffers,
        positions: &mut [[f64; 3]],
    ) -> Result<(), String> {
        let attributes: &HashMap<String, usize> = &primitive.attributes;
        let mut sums = vec![([0.0; 3], 0.0); positions.len()];
        for set in 0.. {
            let [joints, weights] =
                ["JOINTS", "WEIGHTS"].map(|name| attributes.get(&format!("{name}_{set}")));
            let (Some(joints), Some(weights)) = (joints, weights) else { break };
            let joints: Vec<[f64; 4]> = buffers.numbers(*joints)?;
            let weights: Vec<[f64; 4]> = buffers.numbers(*weights)?;
            if joints.len() != positions.len() || weights.len() != positions.len() {
                return Err(format!(
                    "joints and weights {set} are not one for each of {} vertices",
                    positions.len()
                ));
            }
            for (v, (joints, weights)) in joints.iter().zip(&weights).enumerate() {
                for (joint, weight) in joints.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
                    let bone = self.0.get(*joint as usize);
                    let bone =
                        bone.ok_or_else(|| format!("vertex {v} follows joint {joint} of {}", self.0.len()))?;
                    let moved = apply(bone, positions[v]);
                    let (sum, total) = &mut sums[v];
                    (0..3).for_each(|k| sum[k] += weight * moved[k]);
                    *total += weight;
                }
            }
        }
        for (p, (sum, total)) in positions.iter_mut().zip(&sums).filter(|(_, (_, total))| *total > 0.0) {
            *p = sum.map(|x| x / total);
        }
        Ok(())
    }
}
