//! `activation(sum of matrices + one row per garment) + residual` in one pass.

#[cfg(feature = "gpu")]
use super::gpu;
use burn::backend::Backend;
#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Tensor;

use super::composed::{add_optional, broadcast_rows, concatenate, row_block};
use super::host::HostBackend;
use super::operation::{ArgumentGradients, FusedOps, Operation, Saved, Saves, TensorKernel, apply};
use super::tensors::Tensors;
use crate::packing::Packing;

mod host;

/// Pointwise activation of a fused layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Activation {
    /// The sum itself.
    Identity,
    /// max(x, 0), with derivative 0 at 0.
    Relu,
    /// x·Φ(x) with the exact normal distribution (erf), not its tanh approximation.
    Gelu,
}

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

impl<const N: usize> Operation<N> for ActivatedSum {
    /// Identity needs nothing. The result of ReLU is positive exactly where its argument was. Otherwise the argument of the
    /// activation is added up again.
    fn saves(&self, _: [bool; N]) -> Saves<N> {
        let result = self.activation == Activation::Relu && !self.has_residual;
        let sum = self.activation != Activation::Identity && !result;
        Saves { arguments: std::array::from_fn(|i| sum && !(self.has_residual && i + 1 == N)), result }
    }

    fn backward<B: FusedOps>(&self, saved: Saved<B, N>, gradient: FloatTensor<B>) -> ArgumentGradients<B, N> {
        let [of_matrix, of_row] =
            B::run(&ActivatedSumGradients(self.clone()), saved.with(gradient.clone())).take();
        let matrices = N - 1 - usize::from(self.has_residual);
        let of_arguments = std::iter::repeat_n(of_matrix, matrices).chain([of_row, gradient]);
        let mut of_arguments = of_arguments.take(N);
        std::array::from_fn(|_| of_arguments.next())
    }
}

impl TensorKernel for ActivatedSum {
    fn composed<B: Backend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let (matrices, rows, residual) = self.split(arguments);
        let sum = sum::<B>(matrices, rows, &self.packing);
        let value = match self.activation {
            Activation::Identity => sum,
            Activation::Relu => B::float_clamp_min(sum, 0.0.into()),
            Activation::Gelu => B::float_mul(sum.clone(), normal_distribution::<B>(sum)),
        };
        [add_optional::<B>(value, residual)].into()
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let (matrices, rows, residual) = self.split(arguments);
        [gpu::activated_sum(self.activation, &self.packing, matrices, rows, residual)].into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let (matrices, rows, residual) = self.split(arguments);
        host::forward::<B>(self, matrices, rows, residual)
    }
}

/// Gradients of every matrix (they are equal) and of the rows.
///
/// Arguments: what the activation was applied to, then the gradient of the result. The former is absent (identity), a
/// matrix of the same sign (the result of ReLU), or the matrices and the rows that it is the sum of.
#[derive(Clone, Debug)]
pub(super) struct ActivatedSumGradients(pub(super) ActivatedSum);

impl TensorKernel for ActivatedSumGradients {
    fn composed<B: Backend>(&self, Tensors(mut arguments): Tensors<B>) -> Tensors<B> {
        let ActivatedSum { activation, packing, .. } = &self.0;
        let gradient = arguments.pop().expect("a gradient");
        let rows = if arguments.len() > 1 { arguments.pop() } else { None };
        let sum = match rows {
            Some(rows) => Some(sum::<B>(arguments, rows, packing)),
            None => arguments.pop(),
        };
        let of_matrix = match (activation, sum) {
            (Activation::Identity, _) | (_, None) => gradient,
            // The sign of max(x, 0) is the derivative: one above zero, zero elsewhere.
            (Activation::Relu, Some(sum)) => {
                B::float_mul(B::float_sign(B::float_clamp_min(sum, 0.0.into())), gradient)
            }
            (Activation::Gelu, Some(sum)) => {
                let square = B::float_mul(sum.clone(), sum.clone());
                let density = B::float_exp(B::float_mul_scalar(square, (-0.5).into()));
                let density = B::float_mul_scalar(
                    density,
                    (0.5 * std::f64::consts::FRAC_2_SQRT_PI * std::f64::consts::FRAC_1_SQRT_2).into(),
                );
                let slope = B::float_add(normal_distribution::<B>(sum.clone()), B::float_mul(sum, density));
                B::float_mul(slope, gradient)
            }
        };
        let of_row = |rows| B::float_sum_dim(row_block::<B>(of_matrix.clone(), rows), 0);
        let of_rows = concatenate::<B>(packing.ranges().map(of_row).collect());
        [of_matrix, of_rows].into()
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let Tensors(mut arguments) = arguments;
        let gradient = arguments.pop().expect("a gradient");
        let (of_matrix, of_rows) =
            gpu::activated_sum_gradients(self.0.activation, &self.0.packing, arguments, gradient);
        [of_matrix, concatenate::<Cube>(of_rows)].into()
    }

    fn on_host<B: HostBackend>(&self, Tensors(mut arguments): Tensors<B>) -> Tensors<B> {
        let gradient = arguments.pop().expect("a gradient");
        host::backward::<B>(&self.0, arguments, gradient)
    }
}

fn sum<B: Backend>(matrices: Vec<FloatTensor<B>>, rows: FloatTensor<B>, packing: &Packing) -> FloatTensor<B> {
    let shared = broadcast_rows::<B>(rows, packing);
    matrices.into_iter().fold(shared, |sum, matrix| B::float_add(matrix, sum))
}

fn normal_distribution<B: Backend>(x: FloatTensor<B>) -> FloatTensor<B> {
    let erf = B::float_erf(B::float_mul_scalar(x, std::f64::consts::FRAC_1_SQRT_2.into()));
    B::float_add_scalar(B::float_mul_scalar(erf, 0.5.into()), 0.5.into())
}
