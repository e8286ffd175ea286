//! Squared norm and scaling of a gradient.

use burn::backend::{Backend, Cube, TensorMetadata};
use burn::tensor::Shape;
use burn_cubecl::cubecl;
use cubecl::prelude::*;

use super::{GpuTensor, Matrix, UNITS, empty, groups};

/// Entries that one unit adds up.
const PER_UNIT: usize = 64;

#[cube(launch_unchecked)]
fn sums(values: &[f32], partial: &mut [f32], count: usize, #[comptime] squared: bool) {
    let mut shared = Shared::<[f32]>::new_slice(comptime!(UNITS as usize));
    let mut sum = 0.0f32;
    let start = CUBE_POS_X as usize * comptime!(UNITS as usize * PER_UNIT) + UNIT_POS as usize;
    for i in 0..PER_UNIT {
        let at = start + i * comptime!(UNITS as usize);
        if at < count {
            let value = values[at];
            sum += if squared { value * value } else { value };
        }
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
        partial[CUBE_POS_X as usize] = shared[0];
    }
}

/// Sum of squares `[1]`.
pub(in super::super) fn squared_norm(values: GpuTensor) -> GpuTensor {
    let values = Matrix::new(values).tensor;
    let mut count = values.shape().num_elements();
    let (mut values, mut squared) = (values, true);
    while squared || count > 1 {
        let groups = count.div_ceil(UNITS as usize * PER_UNIT).max(1);
        let partial = empty(&values, Shape::new([groups]));
        // SAFETY: units beyond the last entry read nothing.
        unsafe {
            sums::launch_unchecked(
                &values.client,
                CubeCount::Static(groups as u32, 1, 1),
                CubeDim::new_1d(UNITS),
                super::buffer(&values, count, 1),
                super::buffer(&partial, groups, 1),
                count,
                squared,
            );
        }
        (values, count, squared) = (partial, groups, false);
    }
    values
}

#[cube(launch_unchecked)]
fn scaled(values: &[f32], factor: &[f32], output: &mut [f32], count: usize) {
    let i = ABSOLUTE_POS;
    if i < count {
        output[i] = values[i] * factor[0];
    }
}

/// `values` times the only element of `factor`.
pub(in super::super) fn scale(values: GpuTensor, factor: GpuTensor) -> GpuTensor {
    let shape = values.shape();
    let [values, factor] = [values, factor].map(|tensor| Matrix::new(tensor).tensor);
    let output = empty(&values, shape.clone());
    let count = shape.num_elements();
    let (groups, dim) = groups(&values.client, count);
    // SAFETY: units beyond the last entry do nothing.
    unsafe {
        scaled::launch_unchecked(
            &values.client,
            groups,
            dim,
            super::buffer(&values, count, 1),
            super::buffer(&factor, 1, 1),
            super::buffer(&output, count, 1),
            count,
        );
    }
    output
}
