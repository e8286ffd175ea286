//! One DiffusionNet block: diffusion, gradient features, MLP, residual.

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use super::{ComplexMixing, SpectralDiffusion};
use crate::initializer::{Initializer, fan_in_bound};
use crate::linear::Linear;
use crate::ops::{
    Activation, DiffusionMlpArguments, activate, activate_residual, diffusion_mlp, gradient_features,
    lies_on_host, product, product_add,
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

    /// All steps at the vertices as one operation of the host, or each as its own.
    pub(super) fn forward_in_form(
        &self,
        features: Tensor<2>,
        garment: &GarmentTensors,
        fused: bool,
    ) -> Tensor<2> {
        let coefficients = product(garment.projection.clone(), features.clone());
        let coefficients = self.diffusion.diffuse(coefficients, garment.decay.clone());

        let real = product(coefficients.clone(), self.mixing.real.val());
        let imaginary = product(coefficients.clone(), self.mixing.imaginary.val());
        let diffused = product(coefficients.clone(), self.mlp.diffused.val());
        let mixed = [coefficients, real, imaginary];
        match fused {
            true => self.fused(features, mixed, diffused, garment),
            false => self.step_by_step(features, mixed, diffused, garment),
        }
    }

    /// All that happens at the vertices as one operation of the host.
    fn fused(
        &self,
        features: Tensor<2>,
        coefficients: [Tensor<2>; 3],
        diffused: Tensor<2>,
        garment: &GarmentTensors,
    ) -> Tensor<2> {
        let mlp = &self.mlp;
        let layer = |layer: &Linear| [layer.weight.val(), layer.bias_row()];
        let arguments = DiffusionMlpArguments {
            features,
            gradient_basis: garment.gradient_basis.clone(),
            basis: garment.basis.clone(),
            coefficients,
            diffused,
            gradient_weight: mlp.gradient.val(),
            input_weight: mlp.input.val(),
            bias: mlp.bias.val().unsqueeze(),
            hidden: layer(&mlp.hidden),
            output: layer(&mlp.output),
        };
        diffusion_mlp(arguments)
    }

    /// Every step as an operation of its own: what GPUs run, and the oracle of the fused form.
    fn step_by_step(
        &self,
        features: Tensor<2>,
        coefficients: [Tensor<2>; 3],
        diffused: Tensor<2>,
        garment: &GarmentTensors,
    ) -> Tensor<2> {
        // c and its two mixtures, expanded to both gradient axes of all vertices by one product.
        let mixed = Tensor::cat(coefficients.into(), 1);
        let gradient = gradient_features(product(garment.gradient_basis.clone(), mixed));

        // Three products into one matrix: the first layer on [x, x_diff, gradient features].
        let sum = product(gradient, self.mlp.gradient.val());
        let sum = product_add(garment.basis.clone(), diffused, sum);
        let sum = product_add(features.clone(), self.mlp.input.val(), sum);
        let hidden = activate(Activation::Relu, sum, self.mlp.bias.val().unsqueeze());
        let hidden = activate(Activation::Relu, self.mlp.hidden.product(hidden), self.mlp.hidden.bias_row());
        let output = &self.mlp.output;
        activate_residual(Activation::Identity, output.product(hidden), output.bias_row(), features)
    }
}
