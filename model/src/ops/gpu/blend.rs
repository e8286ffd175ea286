//! Weighted mean of a parameter and its running average.

use burn::backend::TensorMetadata;
use burn_cubecl::cubecl;
use burn_cubecl::kernel::into_contiguous;
use cubecl::prelude::*;

use super::{GpuTensor, empty, groups};

#[cube(launch_unchecked)]
fn weighted_mean(old: &[f32], new: &[f32], output: &mut [f32], count: usize, decay: f32, rest: f32) {
    let i = ABSOLUTE_POS;
    if i < count {
        output[i] = old[i] * decay + new[i] * rest;
    }
}

/// See [`blend`](super::super::blend()).
pub(in crate::ops) fn blend(arguments: [GpuTensor; 2], decay: f64) -> GpuTensor {
    let shape = arguments[0].shape();
    let [old, new] = arguments.map(into_contiguous);
    let output = empty(&old, shape.clone());
    let count = shape.num_elements();
    let (groups, dim) = groups(&old.client, count);
    // SAFETY: units beyond the last entry do nothing.
    unsafe {
        weighted_mean::launch_unchecked(
            &old.client,
            groups,
            dim,
            super::buffer(&old, count, 1),
            super::buffer(&new, count, 1),
            super::buffer(&output, count, 1),
            count,
            decay as f32,
            (1.0 - decay) as f32,
        );
    }
    output
}
