//! Points moved by their own affine transforms, one unit each.

use burn_cubecl::cubecl;
use cubecl::prelude::*;

use super::matrix::{GpuTensor, Matrix, groups};

#[cube(launch_unchecked)]
fn forward(transforms: &[f32], points: &[f32], output: &mut [f32], rows: usize) {
    let row = ABSOLUTE_POS;
    if row < rows {
        #[unroll]
        for axis in 0..3 {
            let line = row * 12 + axis * 4;
            let mut sum = transforms[line + 3];
            #[unroll]
            for k in 0..3 {
                sum += transforms[line + k] * points[row * 3 + k];
            }
            output[row * 3 + axis] = sum;
        }
    }
}

/// `R_n p_n + t_n`; see [`transform_points`](crate::ops::transform_points()).
pub(in crate::ops) fn transform_points(arguments: [GpuTensor; 2]) -> GpuTensor {
    let [transforms, points] = arguments.map(Matrix::new);
    points.assert_size(points.rows, 3);
    transforms.assert_size(points.rows, 12);
    let output = points.empty(points.rows, 3);
    let (count, dim) = groups(points.client(), points.rows);
    // SAFETY: units beyond the last row do nothing.
    unsafe {
        forward::launch_unchecked(
            points.client(),
            count,
            dim,
            transforms.argument(1),
            points.argument(1),
            output.argument(1),
            points.rows,
        );
    }
    output.tensor
}

#[cube(launch_unchecked)]
fn backward(
    transforms: &[f32],
    points: &[f32],
    gradient: &[f32],
    of_transforms: &mut [f32],
    of_points: &mut [f32],
    rows: usize,
) {
    let row = ABSOLUTE_POS;
    if row < rows {
        #[unroll]
        for axis in 0..3 {
            let slope = gradient[row * 3 + axis];
            #[unroll]
            for k in 0..3 {
                of_transforms[row * 12 + axis * 4 + k] = slope * points[row * 3 + k];
            }
            of_transforms[row * 12 + axis * 4 + 3] = slope;
        }
        #[unroll]
        for k in 0..3 {
            let mut sum = 0.0f32;
            #[unroll]
            for axis in 0..3 {
                sum += transforms[row * 12 + axis * 4 + k] * gradient[row * 3 + axis];
            }
            of_points[row * 3 + k] = sum;
        }
    }
}

/// Gradients of transforms and points from these and the gradient of the result.
pub(in crate::ops) fn transform_gradients(arguments: [GpuTensor; 3]) -> [GpuTensor; 2] {
    let [transforms, points, gradient] = arguments.map(Matrix::new);
    points.assert_size(points.rows, 3);
    points.assert_like([&gradient]);
    transforms.assert_size(points.rows, 12);
    let of_transforms = points.empty(points.rows, 12);
    let of_points = points.empty(points.rows, 3);
    let (count, dim) = groups(points.client(), points.rows);
    // SAFETY: units beyond the last row do nothing.
    unsafe {
        backward::launch_unchecked(
            points.client(),
            count,
            dim,
            transforms.argument(1),
            points.argument(1),
            gradient.argument(1),
            of_transforms.argument(1),
            of_points.argument(1),
            points.rows,
        );
    }
    [of_transforms.tensor, of_points.tensor]
}
