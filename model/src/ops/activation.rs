//! `activation(sum of matrices + one row per garment) + residual` in one pass.

use burn::backend::Backend;
#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Tensor;

#[cfg(feature = "gpu")]
use super::gpu;
use super::host::HostBackend;
use super::operation::{
    ArgumentGradients, BackwardPass, FusedOps, Operation, Saved, Saves, TensorKernel, apply,
};
use super::tensors::Tensors;
use crate::packing::Packing;

mod function;
mod host;

pub use function::Activation;

/// `activation(input + bias)`: input `[N,C]`, bias `[1,C]`.
pub fn activate(activation: Activation, input: Tensor<2>, bias: Tensor<2>) -> Tensor<2> {
    let packing = Packing::new([input.dims()[0]]);
    activate_packed(activation, input, bias, &packing)
}

/// `activation(input + bias) + residual`: matrices `[N,C]`, bias `[1,C]`.
pub fn activate_residual(
    activation: Activation,
    input: Tensor<2>,
    bias: Tensor<2>,
    residual: Tensor<2>,
) -> Tensor<2> {
    let packing = Packing::new([input.dims()[0]]);
    apply(ActivatedSum { activation, packing, has_residual: true }, [input, bias, residual])
}

/// `activation(input + its garment's row)`: input `[ΣV,C]`, rows `[M,C]`.
pub fn activate_packed(
    activation: Activation,
    input: Tensor<2>,
    rows: Tensor<2>,
    packing: &Packing,
) -> Tensor<2> {
    apply(ActivatedSum { activation, packing: packing.clone(), has_residual: false }, [input, rows])
}

/// `activation(a + b + its garment's row)`: matrices `[ΣV,C]`, rows `[M,C]`.
pub fn activate_packed_sum(
    activation: Activation,
    [a, b]: [Tensor<2>; 2],
    rows: Tensor<2>,
    packing: &Packing,
) -> Tensor<2> {
    apply(ActivatedSum { activation, packing: packing.clone(), has_residual: false }, [a, b, rows])
}

/// Arguments: the matrices of the sum, the rows, and the residual if there is one.
#[derive(Clone, Debug)]
pub(super) struct ActivatedSum {
    pub(super) activation: Activation,
    pub(super) packing: Packing,
    pub(super) has_residual: bool,
}

impl ActivatedSum {
    /// Matrices, rows, residual.
    fn split<B: Backend>(
        &self,
        Tensors(mut matrices): Tensors<B>,
    ) -> (Vec<FloatTensor<B>>, FloatTensor<B>, Option<FloatTensor<B>>) {
        let residual = self.has_residual.then(|| matrices.pop()).flatten();
        let rows = matrices.pop().expect("rows for the garments");
        (matrices, rows, residual)
    }
}

impl TensorKernel for ActivatedSum {
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let (matrices, rows, residual) = self.split(arguments);
        [gpu::activated_sum(self.activation, &self.packing, matrices, rows, residual)].into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let (matrices, rows, residual) = self.split(arguments);
        host::forward::<B>(self.activation, &self.packing, matrices, rows, residual)
    }
}

/// The backward pass reads what the activation was applied to: nothing (identity), a matrix of the same sign (the result of
/// ReLU), or the matrices and the rows that it is the sum of.
impl<const N: usize> Operation<N> for ActivatedSum {
    fn saves(&self, _: [bool; N]) -> Saves<N> {
        let result = self.activation == Activation::Relu && !self.has_residual;
        let sum = self.activation != Activation::Identity && !result;
        Saves { arguments: std::array::from_fn(|i| sum && !(self.has_residual && i + 1 == N)), result }
    }

    /// Of every matrix (they are equal) and of the rows.
    #[cfg(feature = "gpu")]
    fn gradients_on_gpu(&self, Tensors(mut arguments): Tensors<Cube>) -> Tensors<Cube> {
        let gradient = arguments.pop().expect("a gradient");
        gpu::activated_sum_gradients(self.activation, &self.packing, arguments, gradient).into()
    }

    fn gradients_on_host<B: HostBackend>(&self, Tensors(mut arguments): Tensors<B>) -> Tensors<B> {
        let gradient = arguments.pop().expect("a gradient");
        host::backward::<B>(self.activation, &self.packing, arguments, gradient)
    }

    fn backward<B: FusedOps>(&self, saved: Saved<B, N>, gradient: FloatTensor<B>) -> ArgumentGradients<B, N> {
        let [of_matrix, of_row] = B::run(&BackwardPass::<_, N>(self), saved.with(gradient.clone())).take();
        let matrices = N - 1 - usize::from(self.has_residual);
        let of_arguments = std::iter::repeat_n(of_matrix, matrices).chain([of_row, gradient]);
        let mut of_arguments = of_arguments.take(N);
        std::array::from_fn(|_| of_arguments.next())
    }
}
