//! Weighted mean of a parameter and its running average.

use burn::backend::Cube;
use burn::tensor::Tensor;
use burn_cubecl::cubecl;
use cubecl::prelude::*;

use super::matrix::{Matrix, groups};
use crate::ops::operation::{TensorKernel, run};
use crate::ops::tensors::Tensors;

#[cube(launch_unchecked)]
fn weighted_mean(old: &[f32], new: &[f32], output: &mut [f32], count: usize, decay: f32, rest: f32) {
    let i = ABSOLUTE_POS;
    if i < count {
        output[i] = old[i] * decay + new[i] * rest;
    }
}

/// See [`blend`](crate::ops::blend()).
pub(in crate::ops) fn blend<const D: usize>(old: Tensor<D>, new: Tensor<D>, decay: f64) -> Tensor<D> {
    let [mean] = run(&WeightedMean { decay }, [old.into_dispatch(), new.into_dispatch()].into()).take();
    Tensor::from_dispatch(mean)
}

/// Arguments: old, new.
struct WeightedMean {
    decay: f64,
}

impl TensorKernel for WeightedMean {
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let [old, new] = arguments.take().map(Matrix::new);
        old.assert_like([&new]);
        let output = old.like();
        let (groups, dim) = groups(old.client(), old.count());
        // SAFETY: units beyond the last entry do nothing.
        unsafe {
            weighted_mean::launch_unchecked(
                old.client(),
                groups,
                dim,
                old.argument(1),
                new.argument(1),
                output.argument(1),
                old.count(),
                self.decay as f32,
                (1.0 - self.decay) as f32,
            );
        }
        [output.tensor].into()
    }
}
