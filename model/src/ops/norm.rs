//! Squared norm and scaling of a gradient, each one pass over memory.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, TensorMetadata};
use burn::tensor::{Shape, Tensor, TensorData};
use rayon::prelude::*;

use super::backend::FusedOps;
use super::host::{CHUNK_ELEMENTS, HostBackend, vectorised};

/// Lanes that add up side by side; their sums are added in order.
const LANES: usize = 16;

/// Sum of squares `[1]`, not tracked by autodiff.
pub fn squared_norm<const D: usize>(values: Tensor<D>) -> Tensor<1> {
    Tensor::from_dispatch(Dispatch::squared_norm(values.into_dispatch()))
}

/// `values` times the only element of `factor` `[1]`, in place where nobody else holds them; not tracked by autodiff.
pub fn scale_by<const D: usize>(values: Tensor<D>, factor: Tensor<1>) -> Tensor<D> {
    Tensor::from_dispatch(Dispatch::scale_by(values.into_dispatch(), factor.into_dispatch()))
}

/// `None` where the memory is not f32 on the host.
pub(super) fn host_squared_norm<B: HostBackend>(values: &mut FloatTensor<B>) -> Option<FloatTensor<B>> {
    let device = values.device();
    let values = B::values(values)?;
    let parts: Vec<f64> = values
        .par_chunks(CHUNK_ELEMENTS)
        .map(|chunk| {
            vectorised(
                #[inline(always)]
                || sum_of_squares(chunk),
            )
        })
        .collect();
    let sum = parts.into_iter().sum::<f64>() as f32;
    Some(B::float_from_data(TensorData::new(vec![sum], [1]), &device))
}

#[inline(always)]
fn sum_of_squares(values: &[f32]) -> f64 {
    let mut sums = [0.0_f64; LANES];
    let (lines, rest) = values.as_chunks::<LANES>();
    for line in lines {
        for lane in 0..LANES {
            let value = f64::from(line[lane]);
            sums[lane] += value * value;
        }
    }
    let tail: f64 = rest.iter().map(|value| f64::from(*value) * f64::from(*value)).sum();
    sums.into_iter().sum::<f64>() + tail
}

/// Multiplies in place; `false` where the memory is not f32 on the host.
pub(super) fn host_scale_by<B: HostBackend>(
    values: &mut FloatTensor<B>,
    factor: &mut FloatTensor<B>,
) -> bool {
    let Some(&[factor]) = B::values(factor) else { return false };
    let Some(values) = B::values_mut(values) else { return false };
    values.par_chunks_mut(CHUNK_ELEMENTS).for_each(|chunk| {
        vectorised(
            #[inline(always)]
            || {
                for value in chunk.iter_mut() {
                    *value *= factor;
                }
            },
        );
    });
    true
}

pub(super) fn tensor_squared_norm<B: Backend>(values: FloatTensor<B>) -> FloatTensor<B> {
    // Row sums first: one running sum over a large weight would lose digits in f32.
    let shape = values.shape();
    let columns = shape[shape.num_dims() - 1].max(1);
    let rows = shape.num_elements() / columns;
    let squares = B::float_reshape(B::float_mul(values.clone(), values), Shape::new([rows, columns]));
    B::float_reshape(B::float_sum(B::float_sum_dim(squares, 1)), Shape::new([1]))
}

pub(super) fn tensor_scale_by<B: Backend>(values: FloatTensor<B>, factor: FloatTensor<B>) -> FloatTensor<B> {
    let ones = vec![1; values.shape().num_dims()];
    B::float_mul(values, B::float_reshape(factor, Shape::from(ones)))
}
