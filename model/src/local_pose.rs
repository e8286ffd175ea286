//! The pose around a vertex: a code per joint, blended by the skin weights.
//!
//! In the paper every vertex reads the pose from z_s, one row per garment, in which the angles of all joints compete for
//! room. What a sleeve does depends on the shoulder and the elbow alone: a network that is told so learns it from fewer poses, and
//! combinations of limbs that no clip shows are nothing new to it.

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use crate::config::{Dimensions, ModelConfig};
use crate::initializer::{Initializer, fan_in_bound};
use crate::mlp::ResidualMlp;
use crate::ops::{product, product_add};
use crate::tensors::{BodyTensors, JOINT_FEATURES, OutfitTensors};

/// (β, features of joint j, j) → k_j; a vertex reads Σ_j W_j k_j.
///
/// Parameters: `code` (see [`ResidualMlp`]), `draping` `[c, L·width]` and `skinning` `[c, w]` (parts of the weights of D_s and of
/// the first layer of S that act on the code).
#[derive(Module, Debug)]
pub struct LocalPose {
    /// Features of a joint to its code.
    pub code: ResidualMlp,
    /// Part of the gates of D_s.
    pub draping: Param<Tensor<2>>,
    /// Part of the first layer of S.
    pub skinning: Param<Tensor<2>>,
}

/// Hidden layers of the network that makes codes.
const HIDDEN_LAYERS: usize = 2;

impl LocalPose {
    pub(crate) fn new(config: &ModelConfig, dimensions: &Dimensions, start: &mut Initializer) -> Self {
        let inputs = JOINT_FEATURES + dimensions.joints + dimensions.shape;
        let width = config.local_pose;
        let columns = config.siren_layers * config.siren_width;
        let latent = config.width + config.embedding + width;
        Self {
            code: ResidualMlp::new(inputs, width, HIDDEN_LAYERS, width, start),
            draping: start.uniform([width, columns], fan_in_bound(config.siren_width + latent)),
            skinning: start.uniform([width, config.skinning_width], fan_in_bound(3 + latent)),
        }
    }

    /// Codes of all joints `[J,c]`.
    pub fn codes(&self, body: &BodyTensors) -> Tensor<2> {
        let features = body.joint_features.clone();
        let [joints, _] = features.dims();
        let which = Tensor::<2>::eye(joints, &features.device());
        let mut inputs = vec![features, which];
        let [_, shape] = body.shape.dims();
        if shape > 0 {
            inputs.push(body.shape.clone().expand([joints, shape]));
        }
        self.code.forward(Tensor::cat(inputs, 1))
    }

    /// The products of the vertices with D_s and S, with what they read of `codes` added: as the codes are blended linearly, the
    /// weights act on the joints instead of the vertices.
    pub fn add_to(
        &self,
        codes: &Tensor<2>,
        outfit: &OutfitTensors,
        [draping, skinning]: [Tensor<2>; 2],
    ) -> [Tensor<2>; 2] {
        let add = |weight: &Param<Tensor<2>>, to| {
            product_add(outfit.skin_weights.clone(), product(codes.clone(), weight.val()), to)
        };
        [add(&self.draping, draping), add(&self.skinning, skinning)]
    }
}
