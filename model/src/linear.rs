//! Affine layers and parameter initialisation.

use burn::module::{Module, Param};
use burn::tensor::{Device, Distribution, Tensor};

use crate::ops::{Activation, activate, product};

/// `y = x·weight + bias`.
///
/// Parameters: `weight` `[in,out]`, `bias` `[out]`.
#[derive(Module, Debug)]
pub struct Linear {
    /// Weight `[in,out]`.
    pub weight: Param<Tensor<2>>,
    /// Bias `[out]`.
    pub bias: Param<Tensor<1>>,
}

impl Linear {
    /// A layer drawn from U(±1/√in), weight before bias.
    pub fn new(inputs: usize, outputs: usize, device: &Device) -> Self {
        Self::uniform(inputs, outputs, fan_in_bound(inputs), device)
    }

    /// A layer drawn from U(±bound), weight before bias.
    pub fn uniform(inputs: usize, outputs: usize, bound: f64, device: &Device) -> Self {
        Self {
            weight: uniform_parameter([inputs, outputs], bound, device),
            bias: uniform_parameter([outputs], bound, device),
        }
    }

    /// The product without the bias.
    pub fn product(&self, input: Tensor<2>) -> Tensor<2> {
        product(input, self.weight.val())
    }

    /// The bias as a row `[1,out]`.
    pub fn bias_row(&self) -> Tensor<2> {
        self.bias.val().unsqueeze()
    }

    /// `x·weight + bias`.
    pub fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        activate(Activation::Identity, self.product(input), self.bias_row())
    }
}

/// Bound 1/√fan_in of the uniform distribution a linear layer starts from.
pub(crate) fn fan_in_bound(fan_in: usize) -> f64 {
    1.0 / (fan_in.max(1) as f64).sqrt()
}

/// A parameter drawn from U(±bound) at once: drawing lazily would make the weights depend on the order of first use.
pub(crate) fn uniform_parameter<const D: usize>(
    shape: [usize; D],
    bound: f64,
    device: &Device,
) -> Param<Tensor<D>> {
    parameter(Tensor::random(shape, Distribution::Uniform(-bound, bound), device))
}

/// A trainable parameter; it requires gradients where the device has autodiff.
pub(crate) fn parameter<const D: usize>(value: Tensor<D>) -> Param<Tensor<D>> {
    Param::from_tensor(value)
}
