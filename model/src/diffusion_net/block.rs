//! One DiffusionNet block: diffusion, gradient features, MLP, residual.

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use super::{ComplexMixing, SpectralDiffusion};
use crate::initializer::{Initializer, fan_in_bound};
use crate::linear::Linear;
use crate::ops::{
    Activation, activate, activate_residual, diffusion_mlp, gradient_features, lies_on_host, product,
    product_add,
};
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
        let fused = lies_on_host(&features);
        self.forward_in_form(features, garment, fused)
    }

    /// All that happens at the vertices as one operation of the host, or every step as its own: what GPUs run, and the oracle of
    /// the fused form.
    pub(super) fn forward_in_form(
        &self,
        features: Tensor<2>,
        garment: &GarmentTensors,
        fused: bool,
    ) -> Tensor<2> {
        let coefficients = product(garment.projection.clone(), features.clone());
        let coefficients = self.diffusion.diffuse(coefficients, garment.decay.clone());

        let Self { mixing, mlp, .. } = self;
        let real = product(coefficients.clone(), mixing.real.val());
        let imaginary = product(coefficients.clone(), mixing.imaginary.val());
        let diffused = product(coefficients.clone(), mlp.diffused.val());
        let bias = mlp.bias.val().unsqueeze();
        let (gradient_basis, basis) = (garment.gradient_basis.clone(), garment.basis.clone());
        if fused {
            return diffusion_mlp([
                features,
                gradient_basis,
                basis,
                coefficients,
                real,
                imaginary,
                diffused,
                mlp.gradient.val(),
                mlp.input.val(),
                bias,
                mlp.hidden.weight.val(),
                mlp.hidden.bias_row(),
                mlp.output.weight.val(),
                mlp.output.bias_row(),
            ]);
        }

        // c and its two mixtures, expanded to both gradient axes of all vertices by one product.
        let mixed = Tensor::cat(vec![coefficients, real, imaginary], 1);
        let gradient = gradient_features(product(gradient_basis, mixed));

        // Three products into one matrix: the first layer on [x, x_diff, gradient features].
        let sum = product(gradient, mlp.gradient.val());
        let sum = product_add(basis, diffused, sum);
        let sum = product_add(features.clone(), mlp.input.val(), sum);
        let hidden = activate(Activation::Relu, sum, bias);
        let hidden = activate(Activation::Relu, mlp.hidden.product(hidden), mlp.hidden.bias_row());
        let output = &mlp.output;
        activate_residual(Activation::Identity, output.product(hidden), output.bias_row(), features)
    }
}
