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
}

impl BodyTensors {
    /// Uploads a body to `device` (the inner device, if it is an autodiff one).
    ///
    /// # Errors
    /// A length that disagrees with `dimensions`, or a number that is not finite.
    pub fn new(
        shape: &[f32],
        pose: &[f32],
        bones: &[[[f64; 4]; 3]],
        dimensions: &Dimensions,
        device: &Device,
    ) -> Result<Self, ModelError> {
        let bones: Vec<f32> = bones.iter().flatten().flatten().map(|&value| value as f32).collect();
        check_array("shape", shape, dimensions.shape, "[S], shape coefficients")?;
        check_array("pose", pose, dimensions.pose, "[P], pose feature of the active joints")?;
        check_array("bones", &bones, dimensions.joints * 12, "[J,3,4], one transform per active joint")?;
        let device = &device.clone().inner();
        Ok(Self {
            shape: matrix(shape.to_vec(), 1, dimensions.shape, device),
            pose: matrix(pose.to_vec(), 1, dimensions.pose, device),
            bones: matrix(bones, dimensions.joints, 12, device),
        })
    }
}
