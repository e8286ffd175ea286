//! `activation(sum of matrices + one row per segment) + residual` in one pass.

use std::sync::Arc;

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, NodeGuard, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata};
use burn::tensor::{Shape, Slice, Tensor};

use super::backend::FusedOps;
use super::host::{
    Chunk, HostBackend, NewValues, Rows, chunks, for_each, part_lengths, split_mut, sum_partials, vectorised,
};
use super::kernels::Kernels;
use super::math;
use super::segments::{SegmentEnds, Segments, ranges};

/// Pointwise activation of a fused layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    let ends = one_segment(&input);
    dispatch(Dispatch::activate(input.into_dispatch(), bias.into_dispatch(), ends, activation))
}

/// `activation(input + bias) + residual`: matrices `[N,C]`, bias `[1,C]`.
pub fn activate_residual(
    activation: Activation,
    input: Tensor<2>,
    bias: Tensor<2>,
    residual: Tensor<2>,
) -> Tensor<2> {
    let ends = one_segment(&input);
    dispatch(Dispatch::activate_residual(
        input.into_dispatch(),
        bias.into_dispatch(),
        residual.into_dispatch(),
        ends,
        activation,
    ))
}

/// `activation(input + its segment's row)`: input `[N,C]`, rows `[M,C]`.
pub fn segment_activate(
    activation: Activation,
    input: Tensor<2>,
    rows: Tensor<2>,
    segments: &Segments,
) -> Tensor<2> {
    let ends = segments.ends().clone();
    dispatch(Dispatch::activate(input.into_dispatch(), rows.into_dispatch(), ends, activation))
}

/// `activation(a + b + its segment's row)`: matrices `[N,C]`, rows `[M,C]`.
pub fn segment_activate_sum(
    activation: Activation,
    terms: [Tensor<2>; 2],
    rows: Tensor<2>,
    segments: &Segments,
) -> Tensor<2> {
    let [a, b] = terms;
    dispatch(Dispatch::activate_two(
        a.into_dispatch(),
        b.into_dispatch(),
        rows.into_dispatch(),
        segments.ends().clone(),
        activation,
    ))
}

fn dispatch(tensor: burn::backend::DispatchTensor) -> Tensor<2> {
    Tensor::from_dispatch(tensor)
}

fn one_segment(input: &Tensor<2>) -> SegmentEnds {
    Arc::from([input.dims()[0]])
}

/// Gradients of [`host_forward`]'s arguments: of every term (and they are equal), and of the rows.
pub(super) type ActivationGradients<B> = (FloatTensor<B>, FloatTensor<B>);

// ---------------------------------------------------------------------------------------------------------- host memory

pub(super) fn host_forward<B: HostBackend>(
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

/// What the backward pass needs of the forward one.
#[derive(Debug)]
pub(super) enum Saved<B: Backend> {
    /// Identity: nothing.
    Nothing,
    /// ReLU without residual: its output is positive exactly where its input was.
    Output(FloatTensor<B>),
    /// Otherwise the argument of the activation is added up again.
    Arguments(Vec<FloatTensor<B>>, FloatTensor<B>),
}

impl<B: Backend> Clone for Saved<B> {
    fn clone(&self) -> Self {
        match self {
            Self::Nothing => Self::Nothing,
            Self::Output(output) => Self::Output(output.clone()),
            Self::Arguments(terms, rows) => Self::Arguments(terms.clone(), rows.clone()),
        }
    }
}

pub(super) fn host_backward<B: HostBackend>(
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

// ---------------------------------------------------------------------------------------------------------- any backend

pub(super) fn forward<B: Backend>(
    terms: Vec<FloatTensor<B>>,
    rows: FloatTensor<B>,
    residual: Option<FloatTensor<B>>,
    ends: &[usize],
    activation: Activation,
) -> FloatTensor<B> {
    let sum = sum::<B>(terms, rows, ends);
    let value = match activation {
        Activation::Identity => sum,
        Activation::Relu => B::float_clamp_min(sum, 0.0.into()),
        Activation::Gelu => B::float_mul(sum.clone(), normal_distribution::<B>(sum)),
    };
    match residual {
        Some(residual) => B::float_add(value, residual),
        None => value,
    }
}

pub(super) fn backward<B: Backend>(
    saved: Saved<B>,
    gradient: FloatTensor<B>,
    ends: &[usize],
    activation: Activation,
) -> ActivationGradients<B> {
    let sum = match saved {
        Saved::Nothing => None,
        Saved::Output(output) => Some(output),
        Saved::Arguments(terms, rows) => Some(sum::<B>(terms, rows, ends)),
    };
    let input = match (activation, sum) {
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
    let sums = ranges(ends).map(|range| B::float_sum_dim(row_block::<B>(input.clone(), range), 0)).collect();
    (input, concatenate::<B>(sums))
}

fn sum<B: Backend>(terms: Vec<FloatTensor<B>>, rows: FloatTensor<B>, ends: &[usize]) -> FloatTensor<B> {
    let shared = broadcast_rows::<B>(rows, ends);
    terms.into_iter().fold(shared, |sum, term| B::float_add(term, sum))
}

/// Repeats the row of every segment; a lone row is left to broadcast.
pub(super) fn broadcast_rows<B: Backend>(rows: FloatTensor<B>, ends: &[usize]) -> FloatTensor<B> {
    if ends.len() == 1 {
        return rows;
    }
    let columns = rows.shape()[1];
    let blocks = ranges(ends).enumerate().map(|(segment, range)| {
        let row = row_block::<B>(rows.clone(), segment..segment + 1);
        B::float_expand(row, Shape::new([range.len(), columns]))
    });
    concatenate::<B>(blocks.collect())
}

fn row_block<B: Backend>(matrix: FloatTensor<B>, rows: std::ops::Range<usize>) -> FloatTensor<B> {
    let columns = matrix.shape()[1];
    B::float_slice(matrix, &[Slice::from(rows), Slice::from(0..columns)])
}

fn concatenate<B: Backend>(mut blocks: Vec<FloatTensor<B>>) -> FloatTensor<B> {
    match blocks.len() {
        1 => blocks.remove(0),
        _ => B::float_cat(blocks, 0),
    }
}

fn normal_distribution<B: Backend>(x: FloatTensor<B>) -> FloatTensor<B> {
    let erf = B::float_erf(B::float_mul_scalar(x, std::f64::consts::FRAC_1_SQRT_2.into()));
    B::float_add_scalar(B::float_mul_scalar(erf, 0.5.into()), 0.5.into())
}

// ------------------------------------------------------------------------------------------------------------- autodiff

/// N parents: the terms, then the rows, then the residual if there is one.
#[derive(Debug)]
struct ActivationBackward<const N: usize>;

impl<B: Kernels, const N: usize> Backward<B, N> for ActivationBackward<N> {
    type State = (Saved<B>, SegmentEnds, Activation, usize);

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (saved, ends, activation, terms) = ops.state;
        let gradient = grads.consume::<B>(&ops.node);
        let residual = gradient.clone();
        let (input, rows) = B::activation_backward(saved, gradient, &ends, activation);
        for (index, parent) in ops.parents.into_iter().enumerate() {
            let Some(parent) = parent else { continue };
            let gradient = match index.cmp(&terms) {
                std::cmp::Ordering::Less => input.clone(),
                std::cmp::Ordering::Equal => rows.clone(),
                std::cmp::Ordering::Greater => residual.clone(),
            };
            grads.register::<B>(parent.id, gradient);
        }
    }
}

/// Runs the operation and records it if any parent is tracked.
pub(super) fn record<B: Kernels, C: CheckpointStrategy, const N: usize>(
    parents: [NodeGuard; N],
    terms: Vec<FloatTensor<B>>,
    rows: FloatTensor<B>,
    residual: Option<FloatTensor<B>>,
    ends: SegmentEnds,
    activation: Activation,
) -> FloatTensor<Autodiff<B, C>> {
    let prepared = Backward::<B, N>::prepare::<C>(ActivationBackward::<N>, parents);
    match prepared.compute_bound().stateful() {
        OpsKind::UnTracked(operation) => {
            operation.finish(B::activation(terms, rows, residual, &ends, activation))
        }
        OpsKind::Tracked(operation) => {
            let count = terms.len();
            let plain_relu = activation == Activation::Relu && residual.is_none();
            let arguments = (activation != Activation::Identity && !plain_relu)
                .then(|| Saved::Arguments(terms.clone(), rows.clone()));
            let output = B::activation(terms, rows, residual, &ends, activation);
            let saved = match arguments {
                Some(arguments) => arguments,
                None if plain_relu => Saved::Output(output.clone()),
                None => Saved::Nothing,
            };
            operation.finish((saved, ends, activation, count), output)
        }
    }
}
