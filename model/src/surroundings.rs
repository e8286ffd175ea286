//! What a vertex knows of its surroundings: the pose of the joints that move it, and how thick the garments below it are.
//!
//! In the paper every vertex reads the pose from z_s, one row per garment, in which the angles of all joints compete for
//! room. What a sleeve does depends on the shoulder and the elbow alone: a network that is told so learns it from fewer poses, and
//! combinations of limbs that no clip shows are nothing new to it. And a garment over others lies on a body that has grown: told
//! by how much, the network drapes it there at once, which the paper leaves to the untangling alone.

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use crate::config::{Dimensions, ModelConfig};
use crate::initializer::{Initializer, fan_in_bound};
use crate::mlp::ResidualMlp;
use crate::ops::{product, product_add};
use crate::tensors::{BodyTensors, JOINT_FEATURES, OutfitTensors};

/// (β, features of joint j, j) → k_j; a vertex reads Σ_j W_j k_j and the thickness below it.
///
/// Parameters: `code` (see [`ResidualMlp`]); `draping` `[c, L·width]` and `skinning` `[c, w]`, parts of the weights of D_s and of
/// the first layer of S that act on the code; `draping_thickness` `[1, L·width]` and `skinning_thickness` `[1, w]`, those that act
/// on the thickness.
#[derive(Module, Debug)]
pub struct Surroundings {
    /// Features of a joint to its code.
    pub code: ResidualMlp,
    /// Part of the gates of D_s.
    pub draping: Param<Tensor<2>>,
    /// Part of the first layer of S.
    pub skinning: Param<Tensor<2>>,
    /// The same for the thickness, of D_s.
    pub draping_thickness: Param<Tensor<2>>,
    /// The same for the thickness, of S.
    pub skinning_thickness: Param<Tensor<2>>,
}

/// Hidden layers of the network that makes codes.
const HIDDEN_LAYERS: usize = 2;

impl Surroundings {
    pub(crate) fn new(config: &ModelConfig, dimensions: &Dimensions, start: &mut Initializer) -> Self {
        let inputs = JOINT_FEATURES + dimensions.joints + dimensions.shape;
        let width = config.surroundings;
        let (gates, hidden) = (config.siren_layers * config.siren_width, config.skinning_width);
        let latent = config.width + config.embedding + width;
        let (to_gates, to_hidden) = (fan_in_bound(config.siren_width + latent), fan_in_bound(3 + latent));
        Self {
            code: ResidualMlp::new(inputs, width, HIDDEN_LAYERS, width, start),
            draping: start.uniform([width, gates], to_gates),
            skinning: start.uniform([width, hidden], to_hidden),
            draping_thickness: start.uniform([1, gates], to_gates),
            skinning_thickness: start.uniform([1, hidden], to_hidden),
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

    /// The products of the vertices with D_s and S, with what the vertices read of `codes` and of the thickness below them added:
    /// as the codes are blended linearly, the weights act on the joints instead of the vertices.
    pub fn add_to(
        &self,
        codes: &Tensor<2>,
        outfit: &OutfitTensors,
        [draping, skinning]: [Tensor<2>; 2],
    ) -> [Tensor<2>; 2] {
        let add = |weight: &Param<Tensor<2>>, of_thickness: &Param<Tensor<2>>, to| {
            let (mut blend, mut read) = (outfit.skin_weights.clone(), product(codes.clone(), weight.val()));
            if let Some(thickness) = &outfit.thickness_below {
                blend = Tensor::cat(vec![blend, thickness.clone()], 1);
                read = Tensor::cat(vec![read, of_thickness.val()], 0);
            }
            product_add(blend, read, to)
        };
        [
            add(&self.draping, &self.draping_thickness, draping),
            add(&self.skinning, &self.skinning_thickness, skinning),
        ]
    }
}
