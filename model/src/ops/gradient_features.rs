//! Gradient features of DiffusionNet: `tanh(Re(conj(g) ⊙ A g))` per channel, from gradients mixed in advance.

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata};
use burn::tensor::{Slice, Tensor};

use super::backend::FusedOps;
use super::host::{Chunk, HostBackend, NewValues, Rows, chunks, for_each, part_lengths, vectorised};
use super::kernels::Kernels;
use super::math::tanh;

/// `[2V,3C]` → `[V,C]`.
///
/// Rows 0…V hold the derivative along the first tangent axis, rows V…2V along the second; the three column blocks are the
/// gradient g itself, g times the real part of A and g times its imaginary part. With `x0 x1 x2` and `y0 y1 y2` for the six
/// blocks the result is `tanh(x0 (x1 − y2) + y0 (y1 + x2))`.
pub fn gradient_features(mixed: Tensor<2>) -> Tensor<2> {
    Tensor::from_dispatch(Dispatch::gradient_features(mixed.into_dispatch()))
}

// ---------------------------------------------------------------------------------------------------------- host memory

pub(super) fn host_forward<B: HostBackend>(mixed: FloatTensor<B>) -> FloatTensor<B> {
    let device = mixed.device();
    let mixed = B::hold(mixed);
    let mixed = B::rows(&mixed);
    let (vertices, width) = (mixed.count() / 2, mixed.columns() / 3);
    let chunks = chunks(&[vertices], width);
    let mut output = NewValues::new(vertices * width);
    let tasks: Vec<_> = chunks.iter().zip(output.parts(part_lengths(&chunks, width))).collect();
    for_each(tasks, |(chunk, output)| {
        let output = output.zeroed();
        vectorised(
            #[inline(always)]
            || forward_chunk(mixed, vertices, chunk, output),
        );
    });
    B::matrix(output.finish(), width, &device)
}

#[inline(always)]
fn thirds(row: &[f32]) -> [&[f32]; 3] {
    let width = row.len() / 3;
    let (first, rest) = row.split_at(width);
    let (second, third) = rest.split_at(width);
    [first, second, &third[..width]]
}

#[inline(always)]
fn forward_chunk(mixed: Rows<'_>, vertices: usize, chunk: &Chunk, output: &mut [f32]) {
    let width = mixed.columns() / 3;
    for (vertex, output) in chunk.rows.clone().zip(output.chunks_exact_mut(width)) {
        let [x0, x1, x2] = thirds(mixed.row(vertex));
        let [y0, y1, y2] = thirds(mixed.row(vertices + vertex));
        for channel in 0..width {
            let real = x1[channel] - y2[channel];
            let imaginary = y1[channel] + x2[channel];
            output[channel] = tanh(x0[channel].mul_add(real, y0[channel] * imaginary));
        }
    }
}

pub(super) fn host_backward<B: HostBackend>(
    mixed: FloatTensor<B>,
    output: FloatTensor<B>,
    gradient: FloatTensor<B>,
) -> FloatTensor<B> {
    let device = mixed.device();
    let (mixed, output, gradient) = (B::hold(mixed), B::hold(output), B::hold(gradient));
    let (mixed, output, gradient) = (B::rows(&mixed), B::rows(&output), B::rows(&gradient));
    let vertices = mixed.count() / 2;
    let columns = mixed.columns();
    let chunks = chunks(&[vertices], columns);
    let mut result = NewValues::new(mixed.count() * columns);
    let lengths = || part_lengths(&chunks, columns);
    let mut first = result.parts(lengths().chain(lengths()));
    let second = first.split_off(chunks.len());
    let tasks: Vec<_> = chunks.iter().zip(first.into_iter().zip(second)).collect();
    for_each(tasks, |(chunk, (first, second))| {
        let (first, second) = (first.zeroed(), second.zeroed());
        vectorised(
            #[inline(always)]
            || backward_chunk([mixed, output, gradient], vertices, chunk, first, second),
        );
    });
    B::matrix(result.finish(), columns, &device)
}

#[inline(always)]
fn backward_chunk(
    [mixed, output, gradient]: [Rows<'_>; 3],
    vertices: usize,
    chunk: &Chunk,
    first: &mut [f32],
    second: &mut [f32],
) {
    let columns = mixed.columns();
    let width = columns / 3;
    let axes = first.chunks_exact_mut(columns).zip(second.chunks_exact_mut(columns));
    for (vertex, (first, second)) in chunk.rows.clone().zip(axes) {
        let [x0, x1, x2] = thirds(mixed.row(vertex));
        let [y0, y1, y2] = thirds(mixed.row(vertices + vertex));
        let (output, gradient) = (&output.row(vertex)[..width], &gradient.row(vertex)[..width]);
        let (to_x0, rest) = first.split_at_mut(width);
        let (to_x1, to_x2) = rest.split_at_mut(width);
        let (to_y0, rest) = second.split_at_mut(width);
        let (to_y1, to_y2) = rest.split_at_mut(width);
        let (to_x2, to_y2) = (&mut to_x2[..width], &mut to_y2[..width]);
        for channel in 0..width {
            let slope = gradient[channel] * (-output[channel]).mul_add(output[channel], 1.0);
            to_x0[channel] = slope * (x1[channel] - y2[channel]);
            to_y0[channel] = slope * (y1[channel] + x2[channel]);
            to_x1[channel] = slope * x0[channel];
            to_y2[channel] = -slope * x0[channel];
            to_y1[channel] = slope * y0[channel];
            to_x2[channel] = slope * y0[channel];
        }
    }
}

// ---------------------------------------------------------------------------------------------------------- any backend

/// The six blocks `[[x0, x1, x2], [y0, y1, y2]]`.
fn blocks<B: Backend>(mixed: FloatTensor<B>) -> [[FloatTensor<B>; 3]; 2] {
    let (vertices, width) = (mixed.shape()[0] / 2, mixed.shape()[1] / 3);
    [0, 1].map(|axis| {
        [0, 1, 2].map(|part| {
            let rows = Slice::from(axis * vertices..(axis + 1) * vertices);
            B::float_slice(mixed.clone(), &[rows, Slice::from(part * width..(part + 1) * width)])
        })
    })
}

pub(super) fn forward<B: Backend>(mixed: FloatTensor<B>) -> FloatTensor<B> {
    let [[x0, x1, x2], [y0, y1, y2]] = blocks::<B>(mixed);
    let real = B::float_mul(x0, B::float_sub(x1, y2));
    let imaginary = B::float_mul(y0, B::float_add(y1, x2));
    B::float_tanh(B::float_add(real, imaginary))
}

pub(super) fn backward<B: Backend>(
    mixed: FloatTensor<B>,
    output: FloatTensor<B>,
    gradient: FloatTensor<B>,
) -> FloatTensor<B> {
    let [[x0, x1, x2], [y0, y1, y2]] = blocks::<B>(mixed);
    let square = B::float_mul(output.clone(), output);
    let slope = B::float_sub(gradient.clone(), B::float_mul(gradient, square));
    let to_x0 = B::float_mul(slope.clone(), B::float_sub(x1, y2));
    let to_y0 = B::float_mul(slope.clone(), B::float_add(y1, x2));
    let to_x1 = B::float_mul(slope.clone(), x0);
    let to_y1 = B::float_mul(slope, y0);
    let first = B::float_cat(vec![to_x0, to_x1.clone(), to_y1.clone()], 1);
    let second = B::float_cat(vec![to_y0, to_y1, B::float_neg(to_x1)], 1);
    B::float_cat(vec![first, second], 0)
}

// ------------------------------------------------------------------------------------------------------------- autodiff

#[derive(Debug)]
struct FeaturesBackward;

impl<B: Kernels> Backward<B, 1> for FeaturesBackward {
    type State = (FloatTensor<B>, FloatTensor<B>);

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (mixed, output) = ops.state;
        let gradient = grads.consume::<B>(&ops.node);
        if let [Some(parent)] = ops.parents {
            grads.register::<B>(parent.id, B::gradient_features_backward(mixed, output, gradient));
        }
    }
}

/// Runs the operation and records it if its argument is tracked.
pub(super) fn record<B: Kernels, C: CheckpointStrategy>(
    mixed: FloatTensor<Autodiff<B, C>>,
) -> FloatTensor<Autodiff<B, C>> {
    let (mixed, node) = mixed.into_parts();
    match Backward::<B, 1>::prepare::<C>(FeaturesBackward, [node]).compute_bound().stateful() {
        OpsKind::UnTracked(operation) => operation.finish(B::gradient_features_forward(mixed)),
        OpsKind::Tracked(operation) => {
            let output = B::gradient_features_forward(mixed.clone());
            operation.finish((mixed, output.clone()), output)
        }
    }
}
