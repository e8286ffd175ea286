//! Affine layers.

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use crate::initializer::{Initializer, fan_in_bound};
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
    pub fn new(inputs: usize, outputs: usize, start: &mut Initializer) -> Self {
        Self::uniform(inputs, outputs, fan_in_bound(inputs), start)
    }

    /// A layer drawn from U(±bound), weight before bias.
    pub fn uniform(inputs: usize, outputs: usize, bound: f64, start: &mut Initializer) -> Self {
        Self { weight: start.uniform([inputs, outputs], bound), bias: start.uniform([outputs], bound) }
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
