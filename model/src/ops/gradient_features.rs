//! Gradient features of DiffusionNet: `tanh(Re(conj(g) ⊙ A g))` per channel, from gradients mixed in advance.

#[cfg(feature = "gpu")]
use super::gpu;
#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::Tensor;

use super::composed::block;
use super::host::{
    Chunk, HostBackend, MatrixView, NewPart, NewValues, OutputMatrix, chunks, compute, for_each, vectorised,
};
use super::math::tanh;
use super::operation::{ArgumentGradients, FusedOps, Operation, Saved, Saves, TensorKernel, apply};
use super::tensors::Tensors;
use crate::packing::Packing;

/// `[2V,3C]` → `[V,C]`.
///
/// Rows 0…V hold the derivative along the first tangent axis, rows V…2V along the second; the three column blocks are the
/// gradient g itself, g times the real part of A and g times its imaginary part. With `x0 x1 x2` and `y0 y1 y2` for the six
/// blocks the result is `tanh(x0 (x1 − y2) + y0 (y1 + x2))`.
pub fn gradient_features(mixed: Tensor<2>) -> Tensor<2> {
    apply(GradientFeatures, [mixed])
}

/// Argument: mixed gradients.
#[derive(Clone, Copy, Debug)]
pub(super) struct GradientFeatures;

impl Operation<1> for GradientFeatures {
    fn saves(&self, _: [bool; 1]) -> Saves<1> {
        Saves { arguments: [true], result: true }
    }

    fn backward<B: FusedOps>(&self, saved: Saved<B, 1>, gradient: FloatTensor<B>) -> ArgumentGradients<B, 1> {
        B::run(&FeatureGradients, saved.with(gradient)).take().map(Some)
    }
}

impl TensorKernel for GradientFeatures {
    fn composed<B: Backend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [mixed] = arguments.take();
        let [[x0, x1, x2], [y0, y1, y2]] = blocks::<B>(mixed);
        let real = B::float_mul(x0, B::float_sub(x1, y2));
        let imaginary = B::float_mul(y0, B::float_add(y1, x2));
        [B::float_tanh(B::float_add(real, imaginary))].into()
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let [mixed] = arguments.take();
        [gpu::gradient_features(mixed)].into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let held = arguments.take().map(B::hold);
        let [mixed] = held.each_ref().map(B::view);
        let (vertices, width) = (mixed.rows() / 2, mixed.columns() / 3);
        compute(
            &Packing::new([vertices]),
            width,
            [OutputMatrix::Rows(width)],
            #[inline(always)]
            |chunk, [output]| forward_chunk(mixed, vertices, chunk, output),
        )
    }
}

/// The six blocks `[[x0, x1, x2], [y0, y1, y2]]`.
fn blocks<B: Backend>(mixed: FloatTensor<B>) -> [[FloatTensor<B>; 3]; 2] {
    let (vertices, width) = (mixed.shape()[0] / 2, mixed.shape()[1] / 3);
    [0, 1].map(|axis| {
        [0, 1, 2].map(|part| {
            let rows = axis * vertices..(axis + 1) * vertices;
            block::<B>(mixed.clone(), rows, part * width..(part + 1) * width)
        })
    })
}

#[inline(always)]
fn thirds(row: &[f32]) -> [&[f32]; 3] {
    let width = row.len() / 3;
    let (first, rest) = row.split_at(width);
    let (second, third) = rest.split_at(width);
    [first, second, &third[..width]]
}

#[inline(always)]
fn forward_chunk(mixed: MatrixView<'_>, vertices: usize, chunk: &Chunk, output: &mut [f32]) {
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

/// Gradient of the mixed gradients from these, the features and the gradient of the features.
#[derive(Clone, Copy, Debug)]
pub(super) struct FeatureGradients;

impl TensorKernel for FeatureGradients {
    fn composed<B: Backend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [mixed, output, gradient] = arguments.take();
        let [[x0, x1, x2], [y0, y1, y2]] = blocks::<B>(mixed);
        let square = B::float_mul(output.clone(), output);
        let slope = B::float_sub(gradient.clone(), B::float_mul(gradient, square));
        let of_x0 = B::float_mul(slope.clone(), B::float_sub(x1, y2));
        let of_y0 = B::float_mul(slope.clone(), B::float_add(y1, x2));
        let of_x1 = B::float_mul(slope.clone(), x0);
        let of_y1 = B::float_mul(slope, y0);
        let first = B::float_cat(vec![of_x0, of_x1.clone(), of_y1.clone()], 1);
        let second = B::float_cat(vec![of_y0, of_y1, B::float_neg(of_x1)], 1);
        [B::float_cat(vec![first, second], 0)].into()
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        [gpu::feature_gradients(arguments.take())].into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let held = arguments.take().map(B::hold);
        let [mixed, output, gradient] = held.each_ref().map(B::view);
        let (vertices, columns) = (mixed.rows() / 2, mixed.columns());
        let chunks = chunks(&Packing::new([vertices]), columns);
        // Every task writes rows of both axes of the one matrix.
        let lengths: Vec<usize> = chunks.iter().map(|chunk| chunk.rows.len() * columns).collect();
        let mut result = NewValues::new([lengths.clone(), lengths].concat());
        let mut first = result.parts();
        let second = first.split_off(chunks.len());
        let tasks = chunks.iter().zip(first.into_iter().zip(second)).collect();
        for_each(tasks, |(chunk, (first, second)): (&Chunk, (NewPart<'_>, NewPart<'_>))| {
            let (first, second) = (first.zeroed(), second.zeroed());
            vectorised(
                #[inline(always)]
                || backward_chunk([mixed, output, gradient], vertices, chunk, first, second),
            );
        });
        [B::matrix(result.finish(), columns)].into()
    }
}

#[inline(always)]
fn backward_chunk(
    [mixed, output, gradient]: [MatrixView<'_>; 3],
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
        let (of_x0, rest) = first.split_at_mut(width);
        let (of_x1, of_x2) = rest.split_at_mut(width);
        let (of_y0, rest) = second.split_at_mut(width);
        let (of_y1, of_y2) = rest.split_at_mut(width);
        let (of_x2, of_y2) = (&mut of_x2[..width], &mut of_y2[..width]);
        for channel in 0..width {
            let slope = gradient[channel] * (-output[channel]).mul_add(output[channel], 1.0);
            of_x0[channel] = slope * (x1[channel] - y2[channel]);
            of_y0[channel] = slope * (y1[channel] + x2[channel]);
            of_x1[channel] = slope * x0[channel];
            of_y2[channel] = -slope * x0[channel];
            of_y1[channel] = slope * y0[channel];
            of_x2[channel] = slope * y0[channel];
        }
    }
}
