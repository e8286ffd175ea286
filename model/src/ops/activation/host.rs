//! The operation on host memory, in vectors as wide as the processor's.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;

use super::{Activation, ActivationGradients, Saved};
use crate::ops::host::{
    Chunk, HostBackend, NewValues, Rows, chunks, for_each, part_lengths, split_mut, sum_partials, vectorised,
};
use crate::ops::math;

pub(in crate::ops) fn host_forward<B: HostBackend>(
    mut terms: Vec<FloatTensor<B>>,
    rows: FloatTensor<B>,
    residual: Option<FloatTensor<B>>,
    ends: &[usize],
    activation: Activation,
) -> FloatTensor<B> {
    let device = rows.device();
    let mut first = terms.remove(0);
    let terms: Vec<B::Held> = terms.into_iter().map(B::hold).collect();
    let (rows, residual) = (B::hold(rows), residual.map(B::hold));
    let terms: Vec<Rows<'_>> = terms.iter().map(B::rows).collect();
    let (rows, residual) = (B::rows(&rows), residual.as_ref().map(B::rows));
    let columns = rows.columns();
    let chunks = chunks(ends, columns);
    let run = |chunk: &Chunk, output: &mut [f32]| {
        vectorised(
            #[inline(always)]
            || forward_chunk(&terms, rows, residual, chunk, output, activation),
        );
    };
    if let Some(values) = B::own_values_mut(&mut first) {
        let tasks: Vec<_> = chunks.iter().zip(split_mut(values, &chunks, columns)).collect();
        for_each(tasks, |(chunk, values)| run(chunk, values));
        return first;
    }
    let first = B::hold(first);
    let first = B::rows(&first);
    let mut output = NewValues::new(first.count() * columns);
    let tasks: Vec<_> = chunks.iter().zip(output.parts(part_lengths(&chunks, columns))).collect();
    for_each(tasks, |(chunk, part)| {
        let output = part.zeroed();
        for (row, output) in chunk.rows.clone().zip(output.chunks_exact_mut(columns)) {
            output.copy_from_slice(first.row(row));
        }
        run(chunk, output);
    });
    B::matrix(output.finish(), columns, &device)
}

/// `output`, which holds the first term, becomes the result.
#[inline(always)]
fn forward_chunk(
    terms: &[Rows<'_>],
    rows: Rows<'_>,
    residual: Option<Rows<'_>>,
    chunk: &Chunk,
    output: &mut [f32],
    activation: Activation,
) {
    let columns = rows.columns();
    let shared = rows.row(chunk.segment);
    for (row, output) in chunk.rows.clone().zip(output.chunks_exact_mut(columns)) {
        add(output, shared);
        for term in terms {
            add(output, term.row(row));
        }
        match activation {
            Activation::Identity => {}
            Activation::Relu => map(output, math_relu),
            Activation::Gelu => map(output, math::gelu),
        }
        if let Some(residual) = residual {
            add(output, residual.row(row));
        }
    }
}

#[inline(always)]
fn math_relu(x: f32) -> f32 {
    // Not `max`: a NaN must stay visible.
    if x < 0.0 { 0.0 } else { x }
}

#[inline(always)]
fn sum_row(terms: &[Rows<'_>], shared: &[f32], row: usize, output: &mut [f32]) {
    let first = &terms[0].row(row)[..output.len()];
    let shared = &shared[..output.len()];
    for column in 0..output.len() {
        output[column] = first[column] + shared[column];
    }
    for term in &terms[1..] {
        add(output, term.row(row));
    }
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

pub(in crate::ops) fn host_backward<B: HostBackend>(
    saved: Saved<B>,
    gradient: FloatTensor<B>,
    ends: &[usize],
    activation: Activation,
) -> ActivationGradients<B> {
    let device = gradient.device();
    let identity = matches!(saved, Saved::Nothing).then(|| gradient.clone());
    let (terms, rows) = match saved {
        Saved::Nothing => (Vec::new(), None),
        Saved::Output(output) => (vec![B::hold(output)], None),
        Saved::Arguments(terms, rows) => (terms.into_iter().map(B::hold).collect(), Some(B::hold(rows))),
    };
    let terms: Vec<Rows<'_>> = terms.iter().map(B::rows).collect();
    let rows = rows.as_ref().map(B::rows);
    let gradient = B::hold(gradient);
    let gradient = B::rows(&gradient);
    let columns = gradient.columns();
    let chunks = chunks(ends, columns);
    let mut partial = vec![0.0; chunks.len() * columns];
    let sums = partial.chunks_exact_mut(columns.max(1));

    let input = if let Some(input) = identity {
        for_each(chunks.iter().zip(sums).collect(), |(chunk, sums): (&Chunk, &mut [f32])| {
            vectorised(
                #[inline(always)]
                || {
                    for row in chunk.rows.clone() {
                        add(sums, gradient.row(row));
                    }
                },
            );
        });
        input
    } else {
        let mut input = NewValues::new(gradient.count() * columns);
        let parts = input.parts(part_lengths(&chunks, columns));
        let tasks: Vec<_> = chunks.iter().zip(parts).zip(sums).collect();
        for_each(tasks, |((chunk, input), sums)| {
            let input = input.zeroed();
            vectorised(
                #[inline(always)]
                || backward_chunk(&terms, rows, gradient, chunk, input, sums, activation),
            );
        });
        B::matrix(input.finish(), columns, &device)
    };
    let sums = sum_partials(&partial, &chunks, columns, ends.len());
    (input, B::matrix(sums, columns, &device))
}

#[inline(always)]
fn backward_chunk(
    terms: &[Rows<'_>],
    rows: Option<Rows<'_>>,
    gradient: Rows<'_>,
    chunk: &Chunk,
    input: &mut [f32],
    sums: &mut [f32],
    activation: Activation,
) {
    for (row, input) in chunk.rows.clone().zip(input.chunks_exact_mut(sums.len())) {
        let gradient = &gradient.row(row)[..input.len()];
        match rows {
            None => input.copy_from_slice(&terms[0].row(row)[..gradient.len()]),
            Some(rows) => sum_row(terms, rows.row(chunk.segment), row, input),
        }
        match activation {
            Activation::Identity => input.copy_from_slice(gradient),
            Activation::Relu => {
                for column in 0..input.len() {
                    input[column] = if input[column] > 0.0 { gradient[column] } else { 0.0 };
                }
            }
            Activation::Gelu => {
                for column in 0..input.len() {
                    input[column] = math::gelu_derivative(input[column]) * gradient[column];
                }
            }
        }
        add(sums, input);
    }
}
