//! One layer of a modulated SIREN after its matrix product.

use burn::backend::Cube;
use burn::tensor::Tensor;
use burn_cubecl::cubecl;
use cubecl::prelude::*;

use super::column_sums::{
    ROWS_PER_SUM, UNIT_ROW_STEP, blocks, column, end_row, first_row, total, write_block,
};
use super::math::sin_cos;
use super::matrix::{GpuTensor, Matrix, groups};
use crate::ops::operation::{Operation, Saves, TensorKernel, apply};
use crate::ops::tensors::Tensors;

/// See [`sine_modulation`](crate::ops::sine_modulation()).
///
/// The backward pass computes the phase again instead of keeping sine and cosine: both come from one polynomial, while two more
/// matrices would have to be written and read.
pub(in crate::ops) fn sine_modulation(arguments: [Tensor<2>; 3], omega: f64) -> Tensor<2> {
    apply(SineModulation { omega }, arguments)
}

/// Arguments: input, bias, gate.
#[derive(Clone, Copy, Debug)]
struct SineModulation {
    omega: f64,
}

impl TensorKernel for SineModulation {
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        [modulate(arguments.take(), self.omega)].into()
    }
}

impl Operation<3> for SineModulation {
    fn saves(&self, _: [bool; 3]) -> Saves<3> {
        Saves { arguments: [true; 3], result: false }
    }

    fn gradients_on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        gradients(arguments.take(), self.omega).into()
    }
}

#[cube(launch_unchecked)]
fn forward<N: Size>(
    input: &[Vector<f32, N>],
    bias: &[Vector<f32, N>],
    gate: &[Vector<f32, N>],
    output: &mut [Vector<f32, N>],
    count: usize,
    vectors: usize,
    omega: f32,
) {
    let i = ABSOLUTE_POS;
    if i < count {
        let phase = (input[i] + bias[i % vectors]) * Vector::<f32, N>::new(omega);
        let (sine, _cosine) = sin_cos::<N>(phase);
        output[i] = sine * gate[i];
    }
}

fn modulate([input, bias, gate]: [GpuTensor; 3], omega: f64) -> GpuTensor {
    let [input, bias, gate] = [input, bias, gate].map(Matrix::new);
    input.assert_like([&gate]);
    bias.assert_size(1, input.columns);
    let output = input.empty(input.rows, input.columns);
    let width = input.width();
    let vectors = input.columns / width;
    let (count, dim) = groups(input.client(), input.rows * vectors);
    // SAFETY: units beyond the last entry do nothing.
    unsafe {
        forward::launch_unchecked(
            input.client(),
            count,
            dim,
            width,
            input.argument(width),
            bias.argument(width),
            gate.argument(width),
            output.argument(width),
            input.rows * vectors,
            vectors,
            omega as f32,
        );
    }
    output.tensor
}

#[cube(launch_unchecked)]
fn backward<N: Size>(
    input: &[Vector<f32, N>],
    bias: &[Vector<f32, N>],
    gate: &[Vector<f32, N>],
    gradient: &[Vector<f32, N>],
    of_input: &mut [Vector<f32, N>],
    of_gate: &mut [Vector<f32, N>],
    partial: &mut [Vector<f32, N>],
    rows: usize,
    vectors: usize,
    omega: f32,
) {
    let omega = Vector::<f32, N>::new(omega);
    let mut sum = Vector::<f32, N>::new(0.0);
    if column() < vectors {
        let shift = bias[column()];
        let mut row = first_row(0);
        let end = end_row(0, rows);
        while row < end {
            let i = row * vectors + column();
            let (sine, cosine) = sin_cos::<N>((input[i] + shift) * omega);
            let inner = omega * cosine * gate[i] * gradient[i];
            of_gate[i] = sine * gradient[i];
            of_input[i] = inner;
            sum += inner;
            row += UNIT_ROW_STEP;
        }
    }
    write_block::<N>(sum, partial, vectors);
}

/// Gradients of input, bias and gate from these and the gradient of the result.
fn gradients(arguments: [GpuTensor; 4], omega: f64) -> [GpuTensor; 3] {
    let [input, bias, gate, gradient] = arguments.map(Matrix::new);
    input.assert_like([&gate, &gradient]);
    bias.assert_size(1, input.columns);
    let (rows, columns, width) = (input.rows, input.columns, input.width());
    let [of_input, of_gate] = [(); 2].map(|()| input.empty(rows, columns));
    let partial = input.empty(rows.div_ceil(ROWS_PER_SUM), columns);
    let (count, dim) = blocks(rows, columns / width);
    // SAFETY: units beyond the last column or row do nothing.
    unsafe {
        backward::launch_unchecked(
            input.client(),
            count,
            dim,
            width,
            input.argument(width),
            bias.argument(width),
            gate.argument(width),
            gradient.argument(width),
            of_input.argument(width),
            of_gate.argument(width),
            partial.argument(width),
            rows,
            columns / width,
            omega as f32,
        );
    }
    [of_input.tensor, total(partial).tensor, of_gate.tensor]
}
