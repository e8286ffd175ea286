//! One DiffusionNet block: diffusion, gradient features, MLP, residual.

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use super::{ComplexMixing, SpectralDiffusion};
use crate::initializer::{Initializer, fan_in_bound};
use crate::linear::Linear;
use crate::ops::{Activation, activate, activate_residual, gradient_features, product, product_add};
use crate::tensors::GarmentTensors;

/// The block's MLP on [x, x_diff, gradient features]: two hidden ReLU layers and a linear output, all as wide as the block.
///
/// Parameters: `input`, `diffused`, `gradient` (each `[C,C]`: the thirds of the first layer's weight), `bias` `[C]`, `hidden`
/// and `output` (each `weight`, `bias`).
#[derive(Module, Debug)]
pub struct BlockMlp {
    /// First layer, part that acts on the block's input x.
    pub input: Param<Tensor<2>>,
    /// First layer, part that acts on x_diff.
    pub diffused: Param<Tensor<2>>,
    /// First layer, part that acts on the gradient features.
    pub gradient: Param<Tensor<2>>,
    /// Bias of the first layer.
    pub bias: Param<Tensor<1>>,
    /// Second hidden layer.
    pub hidden: Linear,
    /// Output layer.
    pub output: Linear,
}

impl BlockMlp {
    fn new(width: usize, start: &mut Initializer) -> Self {
        let bound = fan_in_bound(3 * width);
        let mut square = || start.uniform([width, width], bound);
        Self {
            input: square(),
            diffused: square(),
            gradient: square(),
            bias: start.uniform([width], bound),
            hidden: Linear::new(width, width, start),
            output: Linear::new(width, width, start),
        }
    }
}

/// One block, C channels in and out.
///
/// Parameters: `diffusion.time`, `mixing` (see [`ComplexMixing`]), `mlp` (see [`BlockMlp`]).
#[derive(Module, Debug)]
pub struct DiffusionBlock {
    /// Diffusion times.
    pub diffusion: SpectralDiffusion,
    /// Mixing of the gradients.
    pub mixing: ComplexMixing,
    /// Pointwise network.
    pub mlp: BlockMlp,
}

impl DiffusionBlock {
    pub(crate) fn new(width: usize, start: &mut Initializer) -> Self {
        Self {
            diffusion: SpectralDiffusion::new(width, start),
            mixing: ComplexMixing::new(width, start),
            mlp: BlockMlp::new(width, start),
        }
    }

    /// `[V,C]` → `[V,C]`.
    pub fn forward(&self, features: Tensor<2>, garment: &GarmentTensors) -> Tensor<2> {
        let coefficients = product(garment.projection.clone(), features.clone());
        let coefficients = self.diffusion.diffuse(coefficients, garment.decay.clone());

        // c and its two mixtures, expanded to both gradient axes of all vertices by one product.
        let real = product(coefficients.clone(), self.mixing.real.val());
        let imaginary = product(coefficients.clone(), self.mixing.imaginary.val());
        let mixed = Tensor::cat(vec![coefficients.clone(), real, imaginary], 1);
        let gradient = gradient_features(product(garment.gradient_basis.clone(), mixed));

        // Three products into one matrix: the first layer on [x, x_diff, gradient features].
        let sum = product(gradient, self.mlp.gradient.val());
        let diffused = product(coefficients, self.mlp.diffused.val());
        let sum = product_add(garment.basis.clone(), diffused, sum);
        let sum = product_add(features.clone(), self.mlp.input.val(), sum);
        let hidden = activate(Activation::Relu, sum, self.mlp.bias.val().unsqueeze());
        let hidden = activate(Activation::Relu, self.mlp.hidden.product(hidden), self.mlp.hidden.bias_row());
        let output = &self.mlp.output;
        activate_residual(Activation::Identity, output.product(hidden), output.bias_row(), features)
    }
}
