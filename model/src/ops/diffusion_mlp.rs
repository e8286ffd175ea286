//! What a DiffusionNet block does at every vertex, as one operation in host memory: gradient features and the MLP.

use burn::backend::tensor::FloatTensor;
use burn::tensor::Tensor;

use super::host::HostBackend;
use super::operation::{
    ArgumentGradients, BackwardPass, FusedOps, Operation, Saved, Saves, TensorKernel, apply,
};
use super::tensors::Tensors;

mod backward;
mod forward;

/// A block of width C on V vertices with k eigenpairs: what it is applied to, and its parameters.
pub struct DiffusionMlpArguments {
    /// Features x `[V,C]`.
    pub features: Tensor<2>,
    /// Gradients of the eigenvectors along both axes, one below the other `[2V,k]`; a constant.
    pub gradient_basis: Tensor<2>,
    /// Eigenvectors Φ `[V,k]`; a constant.
    pub basis: Tensor<2>,
    /// Coefficients c after diffusion, and c times the real and imaginary part of the mixing matrix, `[k,C]` each.
    pub coefficients: [Tensor<2>; 3],
    /// Coefficients of the diffused features' part of the first layer `[k,C]`.
    pub diffused: Tensor<2>,
    /// First layer, part that acts on the gradient features `[C,C]`.
    pub gradient_weight: Tensor<2>,
    /// First layer, part that acts on the features `[C,C]`.
    pub input_weight: Tensor<2>,
    /// Bias of the first layer `[1,C]`.
    pub bias: Tensor<2>,
    /// Second hidden layer `[C,C]`, `[1,C]`.
    pub hidden: [Tensor<2>; 2],
    /// Output layer `[C,C]`, `[1,C]`.
    pub output: [Tensor<2>; 2],
}

/// `x + MLP(x, Φ·diffused, gradient features)` `[V,C]`, where the tensors [lie in host memory](super::lies_on_host).
///
/// With `x0 x1 x2` and `y0 y1 y2` for the three `coefficients` expanded to both axes, the gradient features are
/// `tanh(x0 (x1 − y2) + y0 (y1 + x2))`.
pub fn diffusion_mlp(arguments: DiffusionMlpArguments) -> Tensor<2> {
    let a = arguments;
    let [coefficients, real, imaginary] = a.coefficients;
    let [hidden_weight, hidden_bias] = a.hidden;
    let [output_weight, output_bias] = a.output;
    let arguments = [
        a.features,
        a.gradient_basis,
        a.basis,
        coefficients,
        real,
        imaginary,
        a.diffused,
        a.gradient_weight,
        a.input_weight,
        a.bias,
        hidden_weight,
        hidden_bias,
        output_weight,
        output_bias,
    ];
    apply(DiffusionMlp { recorded: false }, arguments)
}

/// Arguments in the order of [`DiffusionMlpArguments`].
#[derive(Clone, Debug)]
struct DiffusionMlp {
    /// Whether what the backward pass reads is a result too.
    recorded: bool,
}

impl TensorKernel for DiffusionMlp {
    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        forward::run::<B>(self.recorded, arguments.take())
    }
}

impl Operation<14> for DiffusionMlp {
    fn recorded(self) -> Self {
        Self { recorded: true }
    }

    /// Features, bases and the four weights.
    fn saves(&self, _: [bool; 14]) -> Saves<14> {
        let saved = |argument| matches!(argument, 0..=2 | 7 | 8 | 10 | 12);
        Saves { arguments: std::array::from_fn(saved), result: false }
    }

    /// Of all arguments but the bases.
    fn gradients_on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        backward::run::<B>(arguments.take())
    }

    fn backward<B: FusedOps>(
        &self,
        saved: Saved<B, 14>,
        gradient: FloatTensor<B>,
    ) -> ArgumentGradients<B, 14> {
        let mut gradients = B::run(&BackwardPass(self), saved.with(gradient)).0.into_iter();
        std::array::from_fn(|argument| if matches!(argument, 1 | 2) { None } else { gradients.next() })
    }
}
