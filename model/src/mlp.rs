//! Perceptron with a residual connection over every two layers.

use burn::module::Module;
use burn::tensor::Tensor;

use crate::initializer::Initializer;
use crate::linear::Linear;
use crate::ops::{Activation, activate, activate_residual};

/// A GELU perceptron (exact erf form): a first hidden layer, further hidden layers in pairs bridged by a residual
/// connection (a last one without a partner has none), and a linear output.
///
/// Parameters: `first`, `hidden.{0…}`, `output`, each with `weight` and `bias`.
#[derive(Module, Debug)]
pub struct ResidualMlp {
    /// Input to width.
    pub first: Linear,
    /// Width to width, all but the first hidden layer.
    pub hidden: Vec<Linear>,
    /// Width to output.
    pub output: Linear,
}

impl ResidualMlp {
    /// `hidden_layers` counts the first one too.
    pub fn new(
        inputs: usize,
        width: usize,
        hidden_layers: usize,
        outputs: usize,
        start: &mut Initializer,
    ) -> Self {
        Self {
            first: Linear::new(inputs, width, start),
            hidden: (1..hidden_layers).map(|_| Linear::new(width, width, start)).collect(),
            output: Linear::new(width, outputs, start),
        }
    }

    /// `[N,in]` → `[N,out]`.
    pub fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        let hidden = activate(Activation::Gelu, self.first.product(input), self.first.bias_row());
        self.output.forward(residual_pairs(&self.hidden, hidden))
    }
}

/// Passes `[N,width]` through hidden layers, two at a time around a residual connection.
pub(crate) fn residual_pairs(layers: &[Linear], mut features: Tensor<2>) -> Tensor<2> {
    for pair in layers.chunks(2) {
        let inner = activate(Activation::Gelu, pair[0].product(features.clone()), pair[0].bias_row());
        features = match pair.get(1) {
            Some(second) => {
                activate_residual(Activation::Gelu, second.product(inner), second.bias_row(), features)
            }
            None => inner,
        };
    }
    features
}
