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

/// `x + MLP(x, Φ·diffused, gradient features)` `[V,C]` of a block of width C on V vertices with k eigenpairs, where the tensors
/// [lie in host memory](super::lies_on_host).
///
/// With `x0 x1 x2` and `y0 y1 y2` for three coefficients expanded to both axes, the gradient features are
/// `tanh(x0 (x1 − y2) + y0 (y1 + x2))`. Arguments:
///
/// - features x `[V,C]`;
/// - gradients of the eigenvectors along both axes, one below the other `[2V,k]`, and the eigenvectors Φ `[V,k]`: constants;
/// - coefficients c after diffusion, and c times the real and times the imaginary part of the mixing matrix, `[k,C]` each;
/// - coefficients of the diffused features' part of the first layer `[k,C]`;
/// - weights of the first layer that act on the gradient features and on the features, `[C,C]` each, and its bias `[1,C]`;
/// - weight `[C,C]` and bias `[1,C]` of the second hidden layer, and of the output layer.
pub fn diffusion_mlp(arguments: [Tensor<2>; 14]) -> Tensor<2> {
    apply(DiffusionMlp { recorded: false }, arguments)
}

/// Arguments of [`diffusion_mlp`].
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
