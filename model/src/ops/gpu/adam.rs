//! One Adam update.

use burn_cubecl::cubecl;
use cubecl::prelude::*;

use super::matrix::{GpuTensor, Matrix, groups};

#[cube(launch_unchecked)]
fn update(
    parameter: &[f32],
    gradient: &[f32],
    first: &[f32],
    second: &[f32],
    new_parameter: &mut [f32],
    new_first: &mut [f32],
    new_second: &mut [f32],
    count: usize,
    beta_1: f32,
    beta_2: f32,
    step_size: f32,
    epsilon: f32,
) {
    let i = ABSOLUTE_POS;
    if i < count {
        let g = gradient[i];
        let m = first[i] * beta_1 + g * (1.0 - beta_1);
        let v = second[i] * beta_2 + g * g * (1.0 - beta_2);
        new_first[i] = m;
        new_second[i] = v;
        new_parameter[i] = parameter[i] - step_size * m / (f32::sqrt(v) + epsilon);
    }
}

/// Parameter and both moments after an update; see [`adam_step`](crate::ops::adam_step).
pub(in crate::ops) fn adam(
    arguments: [GpuTensor; 4],
    [beta_1, beta_2]: [f32; 2],
    step_size: f32,
    epsilon: f32,
) -> [GpuTensor; 3] {
    let [parameter, gradient, first, second] = arguments.map(Matrix::new);
    parameter.assert_like([&gradient, &first, &second]);
    let outputs = [(); 3].map(|()| parameter.like());
    let (groups, dim) = groups(parameter.client(), parameter.count());
    // SAFETY: units beyond the last entry do nothing.
    unsafe {
        update::launch_unchecked(
            parameter.client(),
            groups,
            dim,
            parameter.argument(1),
            gradient.argument(1),
            first.argument(1),
            second.argument(1),
            outputs[0].argument(1),
            outputs[1].argument(1),
            outputs[2].argument(1),
            parameter.count(),
            beta_1,
            beta_2,
            step_size,
            epsilon,
        );
    }
    outputs.map(|output| output.tensor)
}
