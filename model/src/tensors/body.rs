//! One posed body as tensors.

use burn::tensor::{Device, Tensor};

use super::matrix;
use crate::config::Dimensions;
use crate::error::{ModelError, check_array};

/// Shape, pose and bone transforms of one body.
#[derive(Clone, Debug)]
pub struct BodyTensors {
    /// Shape coefficients β `[1,S]`.
    pub shape: Tensor<2>,
    /// Pose feature θ `[1,P]` of the active joints.
    pub pose: Tensor<2>,
    /// World transform of every active joint relative to the T-pose `[J,12]`: the rows of a 3×4 matrix one after another.
    pub bones: Tensor<2>,
    /// What each active joint knows of the pose around it `[J,30]` ([`JOINT_FEATURES`]).
    pub joint_features: Tensor<2>,
}

/// Numbers that say how the body is posed around a joint.
pub const JOINT_FEATURES: usize = 30;

impl BodyTensors {
    /// Uploads a body to `device` (the inner device, if it is an autodiff one).
    ///
    /// # Errors
    /// A length that disagrees with `dimensions`, or a number that is not finite.
    pub fn new(
        shape: &[f32],
        pose: &[f32],
        bones: &[[[f64; 4]; 3]],
        joint_features: &[f32],
        dimensions: &Dimensions,
        device: &Device,
    ) -> Result<Self, ModelError> {
        let bones: Vec<f32> = bones.iter().flatten().flatten().map(|&value| value as f32).collect();
        check_array("shape", shape, dimensions.shape, "[S], shape coefficients")?;
        check_array("pose", pose, dimensions.pose, "[P], pose feature of the active joints")?;
        check_array("bones", &bones, dimensions.joints * 12, "[J,3,4], one transform per active joint")?;
        check_array(
            "joint features",
            joint_features,
            dimensions.joints * JOINT_FEATURES,
            "[J,30], the pose around each active joint",
        )?;
        let device = &device.clone().inner();
        Ok(Self {
            shape: matrix(shape.to_vec(), 1, dimensions.shape, device),
            pose: matrix(pose.to_vec(), 1, dimensions.pose, device),
            bones: matrix(bones, dimensions.joints, 12, device),
            joint_features: matrix(joint_features.to_vec(), dimensions.joints, JOINT_FEATURES, device),
        })
    }
}
