//! Squared norm and scaling of a gradient.

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_cubecl::cubecl;
use burn_cubecl::kernel::into_contiguous;
use cubecl::prelude::*;

use super::matrix::{GpuTensor, Matrix, UNITS, buffer, empty, groups};

/// Most groups that add up one tensor.
const MOST_GROUPS: usize = 64;

/// Every group adds up its share of the entries, or of their squares.
#[cube(launch_unchecked)]
fn sums(
    values: &[f32],
    partial: &mut [f32],
    count: usize,
    offset: usize,
    groups: usize,
    #[comptime] squared: bool,
) {
    let mut shared = Shared::<[f32]>::new_slice(comptime!(UNITS as usize));
    let mut sum = 0.0f32;
    let mut at = CUBE_POS_X as usize * comptime!(UNITS as usize) + UNIT_POS as usize;
    while at < count {
        let value = values[at];
        sum += if squared { value * value } else { value };
        at += groups * comptime!(UNITS as usize);
    }
    shared[UNIT_POS as usize] = sum;
    sync_cube();
    let mut half = comptime!(UNITS / 2).runtime();
    while half > 0 {
        if UNIT_POS < half {
            let other = shared[(UNIT_POS + half) as usize];
            shared[UNIT_POS as usize] += other;
        }
        sync_cube();
        half /= 2;
    }
    if UNIT_POS == 0 {
        partial[offset + CUBE_POS_X as usize] = shared[0];
    }
}

fn launch_sums(values: &GpuTensor, partial: &GpuTensor, offset: usize, groups: usize, squared: bool) {
    let (count, partials) = (values.shape().num_elements(), partial.shape().num_elements());
    // SAFETY: units beyond the last entry read nothing, and `partial` has an entry for every group from `offset` on.
    unsafe {
        sums::launch_unchecked(
            &values.client,
            CubeCount::Static(groups as u32, 1, 1),
            CubeDim::new_1d(UNITS),
            buffer(values, count, 1),
            buffer(partial, partials, 1),
            count,
            offset,
            groups,
            squared,
        );
    }
}

/// Sum of squares `[1]` of all tensors, at least one.
pub(in crate::ops) fn squared_norm(tensors: Vec<GpuTensor>) -> GpuTensor {
    let tensors: Vec<GpuTensor> = tensors.into_iter().map(into_contiguous).collect();
    let groups =
        |tensor: &GpuTensor| tensor.shape().num_elements().div_ceil(4 * UNITS as usize).clamp(1, MOST_GROUPS);
    let partial = empty(&tensors[0], Shape::new([tensors.iter().map(groups).sum()]));
    let mut offset = 0;
    for tensor in &tensors {
        launch_sums(tensor, &partial, offset, groups(tensor), true);
        offset += groups(tensor);
    }
    let sum = empty(&partial, Shape::new([1]));
    launch_sums(&partial, &sum, 0, 1, false);
    sum
}

#[cube(launch_unchecked)]
fn scaled(values: &[f32], factor: &[f32], output: &mut [f32], count: usize) {
    let i = ABSOLUTE_POS;
    if i < count {
        output[i] = values[i] * factor[0];
    }
}

/// `values` times the only element of `factor`.
pub(in crate::ops) fn scale(values: GpuTensor, factor: GpuTensor) -> GpuTensor {
    let [values, factor] = [values, factor].map(Matrix::new);
    factor.assert_size(1, 1);
    let output = values.like();
    let (groups, dim) = groups(values.client(), values.count());
    // SAFETY: units beyond the last entry do nothing.
    unsafe {
        scaled::launch_unchecked(
            values.client(),
            groups,
            dim,
            values.argument(1),
            factor.argument(1),
            output.argument(1),
            values.count(),
        );
    }
    output.tensor
}
