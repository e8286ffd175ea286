//! Points moved by their own affine transforms.

#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::tensor::Tensor;

#[cfg(feature = "gpu")]
use super::gpu;
use super::host::{HostBackend, OutputMatrix, compute};
use super::matrix_view::MatrixView;
use super::operation::{Operation, Saves, TensorKernel, apply};
use super::tensors::Tensors;
use crate::packing::Packing;

/// `R_n p_n + t_n`: transforms `[N,12]` (the rows of 3×4 matrices [R|t] one after another), points `[N,3]` → `[N,3]`.
pub fn transform_points(transforms: Tensor<2>, points: Tensor<2>) -> Tensor<2> {
    apply(TransformPoints, [transforms, points])
}

/// Arguments: transforms, points.
#[derive(Clone, Copy, Debug)]
struct TransformPoints;

impl TensorKernel for TransformPoints {
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

impl Operation<2> for TransformPoints {
    fn saves(&self, _: [bool; 2]) -> Saves<2> {
        Saves { arguments: [true; 2], result: false }
    }

    #[cfg(feature = "gpu")]
    fn gradients_on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        gpu::transform_gradients(arguments.take()).into()
    }

    fn gradients_on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
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
fn transform_row(transform: &[f32], point: &[f32], output: &mut [f32]) {
    for (line, value) in transform.chunks_exact(4).zip(output) {
        let sum = line[2].mul_add(point[2], line[3]);
        *value = line[0].mul_add(point[0], line[1].mul_add(point[1], sum));
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
