//! The operation in host memory, in vectors as wide as the processor's.

use burn::backend::tensor::FloatTensor;

use super::function::Activation;
use crate::ops::host::{Chunk, HostBackend, OutputMatrix, chunks, compute, for_each, split_mut};
use crate::ops::instruction_set::vectorised;
use crate::ops::math;
use crate::ops::matrix_view::MatrixView;
use crate::ops::tensors::Tensors;
use crate::packing::Packing;

pub(super) fn forward<B: HostBackend>(
    activation: Activation,
    packing: &Packing,
    mut matrices: Vec<FloatTensor<B>>,
    rows: FloatTensor<B>,
    residual: Option<FloatTensor<B>>,
) -> Tensors<B> {
    let mut first = matrices.remove(0);
    let others: Vec<FloatTensor<B>> = matrices.into_iter().map(B::hold).collect();
    let (rows, residual) = (B::hold(rows), residual.map(B::hold));
    let others: Vec<MatrixView<'_>> = others.iter().map(B::view).collect();
    let (rows, residual) = (B::view(&rows), residual.as_ref().map(B::view));
    let columns = rows.columns();
    if let Some(values) = B::own_values_mut(&mut first) {
        let chunks = chunks(packing, columns);
        let lengths = chunks.iter().map(|chunk| chunk.rows.len() * columns);
        let tasks = chunks.iter().zip(split_mut(values, lengths)).collect();
        for_each(tasks, |(chunk, values): (&Chunk, &mut [f32])| {
            vectorised(
                #[inline(always)]
                || forward_chunk(&others, rows, residual, chunk, values, activation),
            );
        });
        return [first].into();
    }
    let first = B::hold(first);
    let first = B::view(&first);
    compute(
        packing,
        columns,
        [OutputMatrix::Rows(columns)],
        #[inline(always)]
        |chunk, [output]| {
            for (row, output) in chunk.rows.clone().zip(output.chunks_exact_mut(columns)) {
                output.copy_from_slice(first.row(row));
            }
            forward_chunk(&others, rows, residual, chunk, output, activation);
        },
    )
}

/// `output`, which holds the first matrix, becomes the result.
#[inline(always)]
fn forward_chunk(
    others: &[MatrixView<'_>],
    rows: MatrixView<'_>,
    residual: Option<MatrixView<'_>>,
    chunk: &Chunk,
    output: &mut [f32],
    activation: Activation,
) {
    let columns = rows.columns();
    let shared = rows.row(chunk.garment);
    for (row, output) in chunk.rows.clone().zip(output.chunks_exact_mut(columns)) {
        add(output, shared);
        for matrix in others {
            add(output, matrix.row(row));
        }
        match activation {
            Activation::Identity => {}
            Activation::Relu => map(output, relu),
            Activation::Gelu => map(output, math::gelu),
        }
        if let Some(residual) = residual {
            add(output, residual.row(row));
        }
    }
}

#[inline(always)]
fn relu(x: f32) -> f32 {
    // Not `max`: a NaN must stay visible.
    if x < 0.0 { 0.0 } else { x }
}

#[inline(always)]
fn add(output: &mut [f32], term: &[f32]) {
    let term = &term[..output.len()];
    for column in 0..output.len() {
        output[column] += term[column];
    }
}

#[inline(always)]
fn map(output: &mut [f32], function: impl Fn(f32) -> f32) {
    for value in output {
        *value = function(*value);
    }
}

/// Gradients of a matrix and of the rows, from what the activation was applied to.
pub(super) fn backward<B: HostBackend>(
    activation: Activation,
    packing: &Packing,
    activated: Vec<FloatTensor<B>>,
    gradient: FloatTensor<B>,
) -> Tensors<B> {
    let identity = activated.is_empty().then(|| gradient.clone());
    let activated: Vec<FloatTensor<B>> = activated.into_iter().map(B::hold).collect();
    let activated: Vec<MatrixView<'_>> = activated.iter().map(B::view).collect();
    let gradient = B::hold(gradient);
    let gradient = B::view(&gradient);
    let columns = gradient.columns();
    if let Some(identity) = identity {
        let [sums] = compute::<B, 1>(
            packing,
            columns,
            [OutputMatrix::Sums(columns)],
            #[inline(always)]
            |chunk, [sums]| {
                for row in chunk.rows.clone() {
                    add(sums, gradient.row(row));
                }
            },
        )
        .take();
        return [identity, sums].into();
    }
    compute(
        packing,
        columns,
        [OutputMatrix::Rows(columns), OutputMatrix::Sums(columns)],
        #[inline(always)]
        |chunk, [output, sums]| {
            backward_chunk(&activated, gradient, chunk, output, sums, activation);
        },
    )
}

#[inline(always)]
fn backward_chunk(
    activated: &[MatrixView<'_>],
    gradient: MatrixView<'_>,
    chunk: &Chunk,
    output: &mut [f32],
    sums: &mut [f32],
    activation: Activation,
) {
    for (row, output) in chunk.rows.clone().zip(output.chunks_exact_mut(sums.len())) {
        let gradient = &gradient.row(row)[..output.len()];
        match activated {
            [activated] => output.copy_from_slice(&activated.row(row)[..gradient.len()]),
            [matrices @ .., rows] => sum_row(matrices, rows.row(chunk.garment), row, output),
            [] => {}
        }
        match activation {
            Activation::Identity => output.copy_from_slice(gradient),
            Activation::Relu => {
                for column in 0..output.len() {
                    output[column] = if output[column] > 0.0 { gradient[column] } else { 0.0 };
                }
            }
            Activation::Gelu => {
                for column in 0..output.len() {
                    output[column] = math::gelu_derivative(output[column]) * gradient[column];
                }
            }
        }
        add(sums, output);
    }
}

#[inline(always)]
fn sum_row(matrices: &[MatrixView<'_>], shared: &[f32], row: usize, output: &mut [f32]) {
    let first = &matrices[0].row(row)[..output.len()];
    let shared = &shared[..output.len()];
    for column in 0..output.len() {
        output[column] = first[column] + shared[column];
    }
    for matrix in &matrices[1..] {
        add(output, matrix.row(row));
    }
}
