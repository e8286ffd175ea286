use burn::backend::Cube;
use burn::tensor::{Tensor, TensorData};

use super::*;
use crate::ops::gpu::matrix::{Matrix, groups};
use crate::ops::operation::{TensorKernel, run};
use crate::ops::tensors::Tensors;
use crate::testing::device;

#[cube(launch_unchecked)]
fn round<N: Size>(values: &[Vector<f32, N>], output: &mut [Vector<f32, N>], count: usize) {
    if ABSOLUTE_POS < count {
        output[ABSOLUTE_POS] = rounded_to_bf16::<N>(values[ABSOLUTE_POS]);
    }
}

struct Rounding;

impl TensorKernel for Rounding {
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let [values] = arguments.take();
        let values = Matrix::new(values);
        let output = values.empty(values.rows, values.columns);
        let count = values.rows * values.columns / 4;
        let (groups, dim) = groups(values.client(), count);
        // SAFETY: units beyond the last vector do nothing.
        unsafe {
            round::launch_unchecked(
                values.client(),
                groups,
                dim,
                4,
                values.argument(4),
                output.argument(4),
                count,
            );
        }
        [output.tensor].into()
    }
}

/// Matrix units or not: any GPU rounds.
#[test]
fn parts_are_rounded_to_the_nearest_and_what_is_not_finite_stays() {
    let mut values: Vec<f32> = (0..4_000u32).map(|i| f32::from_bits(i.wrapping_mul(0x9e37_79b9))).collect();
    values.retain(|value| value.is_normal() && value.abs() < 1e38);
    let finite = values.len();
    let others = [0x7fff_ffff, 0xffff_ffff, 0x7fc0_0000, 0x7f80_0000, 0xff80_0000, 0, 0x8000_0000];
    values.extend(others.map(f32::from_bits));
    values.resize(values.len().next_multiple_of(4), 0.0);
    let matrix = TensorData::new(values.clone(), [values.len() / 4, 4]);
    let tensor = Tensor::<2>::from_data(matrix, &device().inner());
    let [found] = run(&Rounding, [tensor.into_dispatch()].into()).take();
    let found: Vec<f32> = Tensor::<2>::from_dispatch(found).to_data().try_to_vec().expect("f32");
    for (value, found) in values.iter().zip(&found) {
        let right = match value.is_finite() {
            true => found.to_bits() == (value.to_bits() + 0x8000) & 0xffff_0000,
            false => value == found || value.is_nan() && found.is_nan(),
        };
        assert!(right, "{value}: {found}");
    }
    assert!(finite > 3_000);
}
