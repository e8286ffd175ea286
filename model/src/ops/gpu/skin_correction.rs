//! Corrections of skin weights, projected to the joints that a garment uses; one unit per row.

use burn_cubecl::cubecl;
use cubecl::prelude::*;

use super::matrix::{GpuTensor, Matrix, groups};
use crate::packing::Packing;

#[cube(launch_unchecked)]
fn project(
    mask: &[f32],
    values: &[f32],
    base: &[f32],
    output: &mut [f32],
    start: usize,
    end: usize,
    garment: usize,
    joints: usize,
    scale: f32,
    #[comptime] zero_sum: bool,
    #[comptime] has_base: bool,
) {
    let row = start + ABSOLUTE_POS;
    if row < end {
        let mut mean = 0.0f32;
        if zero_sum {
            let mut sum = 0.0f32;
            let mut used = 0.0f32;
            for joint in 0..joints {
                let weight = mask[garment * joints + joint];
                sum += weight * values[row * joints + joint];
                used += weight;
            }
            mean = sum / f32::max(used, 1.0);
        }
        for joint in 0..joints {
            let i = row * joints + joint;
            let mut value = scale * mask[garment * joints + joint] * (values[i] - mean);
            if has_base {
                value += base[i];
            }
            output[i] = value;
        }
    }
}

/// `base + scale·P(values)`; see [`skin_correction`](crate::ops::skin_correction()).
pub(in crate::ops) fn projection(
    [mask, values]: [GpuTensor; 2],
    base: Option<GpuTensor>,
    packing: &Packing,
    scale: f64,
    zero_sum: bool,
) -> GpuTensor {
    let [mask, values] = [mask, values].map(Matrix::new);
    let base = base.map(Matrix::new);
    values.assert_like(&base);
    mask.assert_size(packing.count(), values.columns);
    assert_eq!(packing.rows(), values.rows, "packed rows");
    let output = values.empty(values.rows, values.columns);
    for (garment, range) in packing.ranges().enumerate() {
        let (count, dim) = groups(values.client(), range.len());
        // SAFETY: units beyond the last row of the garment do nothing.
        unsafe {
            project::launch_unchecked(
                values.client(),
                count,
                dim,
                mask.argument(1),
                values.argument(1),
                base.as_ref().unwrap_or(&values).argument(1),
                output.argument(1),
                range.start,
                range.end,
                garment,
                values.columns,
                scale as f32,
                zero_sum,
                base.is_some(),
            );
        }
    }
    output.tensor
}
