//! `activation(sum of matrices + one row per garment) + residual`.

use burn::backend::Cube;
use burn::backend::ops::FloatTensorOps;
use burn_cubecl::cubecl;
use cubecl::prelude::*;

use super::column_sums::{
    ROWS_PER_SUM, UNIT_ROW_STEP, blocks, column, end_row, first_row, total, total_of, write_block,
};
use super::math::{gelu_derivative, normal_distribution};
use super::matrix::{GpuTensor, Matrix, groups};
use crate::ops::activation::Activation;
use crate::packing::Packing;

/// What a kernel adds up, and what it does with the sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct ActivationForm {
    activation: Activation,
    /// Whether there is a second matrix.
    second: bool,
    /// Whether there is a residual, in the forward pass.
    residual: bool,
    /// Whether the rows of the garments are added, in the backward pass; the forward pass always does.
    rows: bool,
}

#[cube]
fn activated<N: Size>(sum: Vector<f32, N>, #[comptime] activation: Activation) -> Vector<f32, N> {
    let mut result = sum;
    #[unroll]
    for lane in 0..N::value() {
        let x = sum.extract(lane);
        if comptime!(activation == Activation::Relu) {
            // A NaN must stay visible.
            result.insert(lane, select(x < 0.0, 0.0_f32, x));
        }
        if comptime!(activation == Activation::Gelu) {
            result.insert(lane, x * normal_distribution(x));
        }
    }
    result
}

#[cube]
fn slope<N: Size>(sum: Vector<f32, N>, #[comptime] activation: Activation) -> Vector<f32, N> {
    let mut result = sum;
    #[unroll]
    for lane in 0..N::value() {
        let x = sum.extract(lane);
        if comptime!(activation == Activation::Relu) {
            result.insert(lane, select(x > 0.0, 1.0_f32, 0.0_f32));
        }
        if comptime!(activation == Activation::Gelu) {
            result.insert(lane, gelu_derivative(x));
        }
    }
    result
}

#[cube(launch_unchecked)]
fn forward<N: Size>(
    first: &[Vector<f32, N>],
    second: &[Vector<f32, N>],
    rows: &[Vector<f32, N>],
    residual: &[Vector<f32, N>],
    output: &mut [Vector<f32, N>],
    start: usize,
    end: usize,
    garment: usize,
    vectors: usize,
    #[comptime] form: ActivationForm,
) {
    let i = start + ABSOLUTE_POS;
    if i < end {
        let mut sum = first[i] + rows[garment * vectors + (i - start) % vectors];
        if form.second {
            sum += second[i];
        }
        let mut value = activated::<N>(sum, form.activation);
        if form.residual {
            value += residual[i];
        }
        output[i] = value;
    }
}

/// See [`activate_residual`](crate::ops::activate_residual) and its siblings; one or two matrices.
pub(in crate::ops) fn activated_sum(
    activation: Activation,
    packing: &Packing,
    matrices: Vec<GpuTensor>,
    rows: GpuTensor,
    residual: Option<GpuTensor>,
) -> GpuTensor {
    let matrices: Vec<Matrix> = matrices.into_iter().map(Matrix::new).collect();
    let (rows, residual) = (Matrix::new(rows), residual.map(Matrix::new));
    let (first, second) = (&matrices[0], matrices.get(1));
    first.assert_like(second.into_iter().chain(&residual));
    rows.assert_size(packing.count(), first.columns);
    assert_eq!(packing.rows(), first.rows, "packed rows");
    let output = first.empty(first.rows, first.columns);
    let width = first.width();
    let vectors = first.columns / width;
    let form =
        ActivationForm { activation, second: second.is_some(), residual: residual.is_some(), rows: true };
    for (garment, range) in packing.ranges().enumerate() {
        let (count, dim) = groups(first.client(), range.len() * vectors);
        // SAFETY: units beyond the last row of the garment do nothing.
        unsafe {
            forward::launch_unchecked(
                first.client(),
                count,
                dim,
                width,
                first.argument(width),
                second.unwrap_or(first).argument(width),
                rows.argument(width),
                residual.as_ref().unwrap_or(first).argument(width),
                output.argument(width),
                range.start * vectors,
                range.end * vectors,
                garment,
                vectors,
                form,
            );
        }
    }
    output.tensor
}

#[cube(launch_unchecked)]
fn backward<N: Size>(
    first: &[Vector<f32, N>],
    second: &[Vector<f32, N>],
    rows: &[Vector<f32, N>],
    gradient: &[Vector<f32, N>],
    output: &mut [Vector<f32, N>],
    partial: &mut [Vector<f32, N>],
    start: usize,
    end: usize,
    garment: usize,
    vectors: usize,
    #[comptime] form: ActivationForm,
) {
    let mut total = Vector::<f32, N>::new(0.0);
    if column() < vectors {
        let mut row = first_row(start);
        let end = end_row(start, end);
        while row < end {
            let i = row * vectors + column();
            let mut sum = first[i];
            if form.second {
                sum += second[i];
            }
            if form.rows {
                sum += rows[garment * vectors + column()];
            }
            let value = gradient[i] * slope::<N>(sum, form.activation);
            output[i] = value;
            total += value;
            row += UNIT_ROW_STEP;
        }
    }
    write_block::<N>(total, partial, vectors);
}

/// Gradients of every matrix (they are equal), and of the rows of the garments. `sum` is what the activation was applied to: nothing (identity),
/// one matrix of the same sign (the result of ReLU), or one or two matrices and the rows.
pub(in crate::ops) fn activated_sum_gradients(
    activation: Activation,
    packing: &Packing,
    mut sum: Vec<GpuTensor>,
    gradient: GpuTensor,
) -> [GpuTensor; 2] {
    let gradient = Matrix::new(gradient);
    let rows = if sum.len() > 1 { sum.pop() } else { None }.map(Matrix::new);
    let matrices: Vec<Matrix> = sum.into_iter().map(Matrix::new).collect();
    // The slope of identity is one wherever it is taken.
    let Some(first) = matrices.first().filter(|_| activation != Activation::Identity) else {
        let of_rows = packing.ranges().map(|rows| total_of(&gradient, rows).tensor).collect();
        return [gradient.tensor, joined(of_rows)];
    };
    gradient.assert_like(&matrices);
    rows.iter().for_each(|rows| rows.assert_size(packing.count(), gradient.columns));
    assert_eq!(packing.rows(), gradient.rows, "packed rows");
    let output = gradient.empty(gradient.rows, gradient.columns);
    let width = gradient.width();
    let vectors = gradient.columns / width;
    let form =
        ActivationForm { activation, second: matrices.len() > 1, residual: false, rows: rows.is_some() };
    let mut of_rows = Vec::with_capacity(packing.count());
    for (garment, range) in packing.ranges().enumerate() {
        let partial = gradient.empty(range.len().div_ceil(ROWS_PER_SUM), gradient.columns);
        let (count, dim) = blocks(range.len(), vectors);
        // SAFETY: units beyond the last column or row of the garment do nothing.
        unsafe {
            backward::launch_unchecked(
                gradient.client(),
                count,
                dim,
                width,
                first.argument(width),
                matrices.get(1).unwrap_or(first).argument(width),
                rows.as_ref().unwrap_or(first).argument(width),
                gradient.argument(width),
                output.argument(width),
                partial.argument(width),
                range.start,
                range.end,
                garment,
                vectors,
                form,
            );
        }
        of_rows.push(total(partial).tensor);
    }
    [output.tensor, joined(of_rows)]
}

/// Rows one below the other; a lone one is returned as it is.
fn joined(mut rows: Vec<GpuTensor>) -> GpuTensor {
    match rows.len() {
        1 => rows.remove(0),
        _ => Cube::float_cat(rows, 0),
    }
}
