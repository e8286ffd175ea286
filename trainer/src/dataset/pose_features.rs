//! A pose as the networks see it.

use crate::config::PoseEncoding;
use clothcombo_data::asset::Pose;
use clothcombo_data::asset::rotation::matrix_from_axis_angle;

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
