//! `sin(w0·(input + bias)) ⊙ gate`: one layer of a modulated SIREN after its matrix product.

#[cfg(feature = "gpu")]
use super::gpu;
use burn::backend::Backend;
#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Tensor;

use super::host::{Chunk, HostBackend, MatrixView, OutputMatrix, compute};
use super::math::sin_cos;
use super::operation::{ArgumentGradients, FusedOps, Operation, Saved, Saves, TensorKernel, apply};
use super::tensors::Tensors;
use crate::packing::Packing;

/// `sin(omega·(input + bias)) ⊙ gate`: input and gate `[N,C]`, bias `[1,C]`.
///
/// The backward pass computes the phase again instead of keeping sine and cosine: both come from one polynomial pass,
/// while two more matrices would have to be written and read.
pub fn sine_modulation(input: Tensor<2>, bias: Tensor<2>, gate: Tensor<2>, omega: f64) -> Tensor<2> {
    apply(SineModulation { omega }, [input, bias, gate])
}

/// Arguments: input, bias, gate.
#[derive(Clone, Copy, Debug)]
pub(super) struct SineModulation {
    pub(super) omega: f64,
}

impl Operation<3> for SineModulation {
    fn saves(&self, _: [bool; 3]) -> Saves<3> {
        Saves { arguments: [true; 3], result: false }
    }

    fn backward<B: FusedOps>(&self, saved: Saved<B, 3>, gradient: FloatTensor<B>) -> ArgumentGradients<B, 3> {
        B::run(&SineGradients(*self), saved.with(gradient)).take().map(Some)
    }
}

impl TensorKernel for SineModulation {
    fn composed<B: Backend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [input, bias, gate] = arguments.take();
        let phase = B::float_mul_scalar(B::float_add(input, bias), self.omega.into());
        [B::float_mul(B::float_sin(phase), gate)].into()
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        [gpu::sine_modulation(arguments.take(), self.omega)].into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let held = arguments.take().map(B::hold);
        let [input, bias, gate] = held.each_ref().map(B::view);
        let (bias, omega, columns) = (bias.row(0), self.omega as f32, input.columns());
        let packing = Packing::new([input.rows()]);
        compute(
            &packing,
            columns,
            [OutputMatrix::Rows(columns)],
            #[inline(always)]
            |chunk, [output]| modulate([input, gate], bias, omega, chunk, output),
        )
    }
}

#[inline(always)]
fn modulate([input, gate]: [MatrixView<'_>; 2], bias: &[f32], omega: f32, chunk: &Chunk, output: &mut [f32]) {
    let columns = bias.len();
    for (row, output) in chunk.rows.clone().zip(output.chunks_exact_mut(columns)) {
        let (input, gate) = (&input.row(row)[..columns], &gate.row(row)[..columns]);
        for column in 0..columns {
            output[column] = sin_cos(omega * (input[column] + bias[column])).0 * gate[column];
        }
    }
}

/// Gradients of input, bias and gate from these and the gradient of the result.
#[derive(Clone, Copy, Debug)]
pub(super) struct SineGradients(pub(super) SineModulation);

impl TensorKernel for SineGradients {
    fn composed<B: Backend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [input, bias, gate, gradient] = arguments.take();
        let omega = self.0.omega;
        let phase = B::float_mul_scalar(B::float_add(input, bias), omega.into());
        let of_gate = B::float_mul(B::float_sin(phase.clone()), gradient.clone());
        let slope = B::float_mul_scalar(B::float_cos(phase), omega.into());
        let of_input = B::float_mul(slope, B::float_mul(gate, gradient));
        [of_input.clone(), B::float_sum_dim(of_input, 0), of_gate].into()
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        gpu::sine_gradients(arguments.take(), self.0.omega).into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let held = arguments.take().map(B::hold);
        let [input, bias, gate, gradient] = held.each_ref().map(B::view);
        let (bias, omega, columns) = (bias.row(0), self.0.omega as f32, input.columns());
        let packing = Packing::new([input.rows()]);
        compute(
            &packing,
            columns,
            [OutputMatrix::Rows(columns), OutputMatrix::Sums(columns), OutputMatrix::Rows(columns)],
            #[inline(always)]
            |chunk, [of_input, of_bias, of_gate]| {
                gradients([input, gate, gradient], bias, omega, chunk, of_input, of_bias, of_gate);
            },
        )
    }
}

#[inline(always)]
fn gradients(
    [input, gate, gradient]: [MatrixView<'_>; 3],
    bias: &[f32],
    omega: f32,
    chunk: &Chunk,
    of_input: &mut [f32],
    of_bias: &mut [f32],
    of_gate: &mut [f32],
) {
    let columns = bias.len();
    let of_bias = &mut of_bias[..columns];
    let outputs = of_input.chunks_exact_mut(columns).zip(of_gate.chunks_exact_mut(columns));
    for (row, (of_input, of_gate)) in chunk.rows.clone().zip(outputs) {
        let (input, gate) = (&input.row(row)[..columns], &gate.row(row)[..columns]);
        let gradient = &gradient.row(row)[..columns];
        for column in 0..columns {
            let (sine, cosine) = sin_cos(omega * (input[column] + bias[column]));
            let inner = omega * cosine * gate[column] * gradient[column];
            of_input[column] = inner;
            of_gate[column] = sine * gradient[column];
            of_bias[column] += inner;
        }
    }
}
