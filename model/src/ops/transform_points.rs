//! Points moved by their own affine transforms.

#[cfg(feature = "gpu")]
use super::gpu;
use burn::backend::Backend;
#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Tensor;

use super::composed::column_block;
use super::host::{HostBackend, MatrixView, OutputMatrix, compute};
use super::operation::{ArgumentGradients, FusedOps, Operation, Saved, Saves, TensorKernel, apply};
use super::tensors::Tensors;
use crate::packing::Packing;

/// `R_n p_n + t_n`: transforms `[N,12]` (the rows of 3×4 matrices [R|t] one after another), points `[N,3]` → `[N,3]`.
pub fn transform_points(transforms: Tensor<2>, points: Tensor<2>) -> Tensor<2> {
    apply(TransformPoints, [transforms, points])
}

/// Arguments: transforms, points.
#[derive(Clone, Copy, Debug)]
pub(super) struct TransformPoints;

impl Operation<2> for TransformPoints {
    fn saves(&self, _: [bool; 2]) -> Saves<2> {
        Saves { arguments: [true; 2], result: false }
    }

    fn backward<B: FusedOps>(&self, saved: Saved<B, 2>, gradient: FloatTensor<B>) -> ArgumentGradients<B, 2> {
        B::run(&TransformGradients, saved.with(gradient)).take().map(Some)
    }
}

impl TensorKernel for TransformPoints {
    fn composed<B: Backend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [transforms, points] = arguments.take();
        let axes = (0..3).map(|axis| {
            let [linear, offset] = transform_parts::<B>(&transforms, axis);
            B::float_add(B::float_sum_dim(B::float_mul(linear, points.clone()), 1), offset)
        });
        [B::float_cat(axes.collect(), 1)].into()
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        [gpu::transform_points(arguments.take())].into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let held = arguments.take().map(B::hold);
        let [transforms, points] = held.each_ref().map(B::view);
        compute(
            &Packing::new([points.rows()]),
            12,
            [OutputMatrix::Rows(3)],
            #[inline(always)]
            |chunk, [output]| {
                for (row, output) in chunk.rows.clone().zip(output.chunks_exact_mut(3)) {
                    transform_row(transforms.row(row), points.row(row), output);
                }
            },
        )
    }
}

#[inline(always)]
fn transform_row(transform: &[f32], point: &[f32], output: &mut [f32]) {
    for (line, value) in transform.chunks_exact(4).zip(output) {
        let sum = line[2].mul_add(point[2], line[3]);
        *value = line[0].mul_add(point[0], line[1].mul_add(point[1], sum));
    }
}

/// Linear part `[N,3]` and offset `[N,1]` of one row of every transform.
fn transform_parts<B: Backend>(transforms: &FloatTensor<B>, axis: usize) -> [FloatTensor<B>; 2] {
    let columns = [4 * axis..4 * axis + 3, 4 * axis + 3..4 * axis + 4];
    columns.map(|columns| column_block::<B>(transforms.clone(), columns))
}

/// Gradients of transforms and points from these and the gradient of the result.
#[derive(Clone, Copy, Debug)]
pub(super) struct TransformGradients;

impl TensorKernel for TransformGradients {
    fn composed<B: Backend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [transforms, points, gradient] = arguments.take();
        let axes = [0, 1, 2].map(|axis| {
            let gradient = column_block::<B>(gradient.clone(), axis..axis + 1);
            let [linear, _] = transform_parts::<B>(&transforms, axis);
            let of_transform = [B::float_mul(points.clone(), gradient.clone()), gradient.clone()];
            (of_transform, B::float_mul(linear, gradient))
        });
        let [(x, of_x), (y, of_y), (z, of_z)] = axes;
        let of_transforms = B::float_cat([x, y, z].into_iter().flatten().collect(), 1);
        [of_transforms, B::float_add(B::float_add(of_x, of_y), of_z)].into()
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        gpu::transform_gradients(arguments.take()).into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let held = arguments.take().map(B::hold);
        let [transforms, points, gradient] = held.each_ref().map(B::view);
        compute(
            &Packing::new([points.rows()]),
            12,
            [OutputMatrix::Rows(12), OutputMatrix::Rows(3)],
            #[inline(always)]
            |chunk, [of_transforms, of_points]| {
                let rows = of_transforms.chunks_exact_mut(12).zip(of_points.chunks_exact_mut(3));
                for (row, (of_transform, of_point)) in chunk.rows.clone().zip(rows) {
                    let arguments = [transforms, points, gradient].map(|rows: MatrixView<'_>| rows.row(row));
                    row_gradients(arguments, of_transform, of_point);
                }
            },
        )
    }
}

#[inline(always)]
fn row_gradients([transform, point, gradient]: [&[f32]; 3], of_transform: &mut [f32], of_point: &mut [f32]) {
    let lines = transform.chunks_exact(4).zip(of_transform.chunks_exact_mut(4));
    for ((line, of_line), &gradient) in lines.zip(gradient) {
        for axis in 0..3 {
            of_line[axis] = gradient * point[axis];
            of_point[axis] = line[axis].mul_add(gradient, of_point[axis]);
        }
        of_line[3] = gradient;
    }
}
