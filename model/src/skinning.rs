//! Skinning network S: a correction of the skin weights.

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use crate::config::{Dimensions, ModelConfig, SkinningJoints};
use crate::initializer::{Initializer, fan_in_bound};
use crate::linear::Linear;
use crate::mlp::residual_pairs;
use crate::ops::{Activation, activate_packed, product, product_add, skin_correction};
use crate::tensors::OutfitTensors;

/// S: (x, z_s, z_v) → ΔW.
///
/// Parameters: `coordinate` `[3,w]`, `garment` `[width,w]`, `vertex` `[d,w]` (parts of the first layer's weight that act on
/// x, z_s and z_v), `bias` `[w]`, `hidden.{0…}` and `output` (each `weight`, `bias`).
#[derive(Module, Debug)]
pub struct Skinning {
    /// First layer, part that acts on the rest position x.
    pub coordinate: Param<Tensor<2>>,
    /// First layer, part that acts on the draping embedding z_s.
    pub garment: Param<Tensor<2>>,
    /// First layer, part that acts on the vertex embedding z_v.
    pub vertex: Param<Tensor<2>>,
    /// Bias of the first layer.
    pub bias: Param<Tensor<1>>,
    /// Further hidden layers.
    pub hidden: Vec<Linear>,
    /// One value per joint.
    pub output: Linear,
    #[module(skip)]
    scale: f64,
    #[module(skip)]
    zero_sum: bool,
    #[module(skip)]
    joints: SkinningJoints,
}

impl Skinning {
    pub(crate) fn new(config: &ModelConfig, dimensions: &Dimensions, start: &mut Initializer) -> Self {
        let width = config.skinning_width;
        let bound = fan_in_bound(3 + config.width + config.embedding);
        Self {
            coordinate: start.uniform([3, width], bound),
            garment: start.uniform([config.width, width], bound),
            vertex: start.uniform([config.embedding, width], bound),
            bias: start.uniform([width], bound),
            hidden: (1..config.skinning_layers).map(|_| Linear::new(width, width, start)).collect(),
            output: Linear::new(width, dimensions.joints, start),
            scale: config.skinning_scale,
            zero_sum: config.zero_sum_skinning,
            joints: config.skinning_joints,
        }
    }

    /// The part of the first layer that depends on the vertices only `[ΣV,w]`.
    pub fn vertex_product(&self, rest: Tensor<2>, vertex: Tensor<2>) -> Tensor<2> {
        product_add(rest, self.coordinate.val(), product(vertex, self.vertex.val()))
    }

    /// Skin weights W + ΔW `[ΣV,J]`; ΔW is zero outside the joints of [`SkinningJoints`].
    pub fn weights(
        &self,
        outfit: &OutfitTensors,
        vertex_product: Tensor<2>,
        draping: Tensor<2>,
    ) -> Tensor<2> {
        let packing = &outfit.packing;
        let rows = product(draping, self.garment.val()) + self.bias.val().unsqueeze();
        let features = activate_packed(Activation::Gelu, vertex_product, rows, packing);
        let raw = self.output.forward(residual_pairs(&self.hidden, features));
        let mask = match self.joints {
            SkinningJoints::Bound => outfit.joint_mask.clone(),
            SkinningJoints::All => outfit.joint_mask.ones_like(),
        };
        skin_correction(outfit.skin_weights.clone(), raw, mask, packing, self.scale, self.zero_sum)
    }
}
