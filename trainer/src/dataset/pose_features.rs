//! A pose as the networks see it: as a whole, and around each joint.

use crate::config::PoseEncoding;
use clothcombo_data::asset::Pose;
use clothcombo_data::asset::rotation::{Matrix3, matrix_from_axis_angle, product, transpose};
use clothcombo_model::JOINT_FEATURES;
use clothcombo_physics::transform::Transform;

impl PoseEncoding {
    /// Numbers per joint.
    pub fn per_joint(self) -> usize {
        match self {
            PoseEncoding::RotationMatrix => 9,
            PoseEncoding::AxisAngle => 3,
        }
    }

    /// Network input of `pose`: the features of `joints`, in order.
    pub fn features(self, pose: &Pose, joints: &[usize]) -> Vec<f32> {
        let mut out = Vec::with_capacity(joints.len() * self.per_joint());
        for &j in joints {
            let rotation = pose.rotation(j);
            match self {
                PoseEncoding::AxisAngle => out.extend(rotation.map(|v| v as f32)),
                PoseEncoding::RotationMatrix => {
                    let matrix = matrix_from_axis_angle(rotation);
                    for (r, row) in matrix.iter().enumerate() {
                        for (c, v) in row.iter().enumerate() {
                            out.push((v - if r == c { 1.0 } else { 0.0 }) as f32);
                        }
                    }
                }
            }
        }
        out
    }
}

/// What each active joint knows of the pose around it, `[J, 30]`: its rotation, that of the joint above and the sum of those
/// below, each relative to the joint above it and less the identity; and where down is in its frame, less where it is in the
/// T-pose. `bones` are the world transforms of the joints, `parents` the active joint above each.
pub fn joint_features(bones: &[Transform], parents: &[Option<usize>]) -> Vec<f32> {
    let world: Vec<Matrix3> = bones.iter().map(|bone| bone.map(|row| [row[0], row[1], row[2]])).collect();
    let bend: Vec<[f64; 9]> = (0..world.len())
        .map(|j| {
            let relative = match parents[j] {
                Some(parent) => product(&transpose(&world[parent]), &world[j]),
                None => world[j],
            };
            std::array::from_fn(|i| relative[i / 3][i % 3] - if i % 4 == 0 { 1.0 } else { 0.0 })
        })
        .collect();
    let mut features = Vec::with_capacity(world.len() * JOINT_FEATURES);
    for j in 0..world.len() {
        let above = parents[j].map_or([0.0; 9], |parent| bend[parent]);
        let mut below = [0.0; 9];
        for (child, _) in parents.iter().enumerate().filter(|(_, parent)| **parent == Some(j)) {
            below.iter_mut().zip(&bend[child]).for_each(|(sum, x)| *sum += x);
        }
        let down = world[j][1].map(|x| -x);
        let down = [down[0], down[1] + 1.0, down[2]];
        features.extend(bend[j].iter().chain(&above).chain(&below).chain(&down).map(|x| *x as f32));
    }
    features
}
