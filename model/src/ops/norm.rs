//! Squared norm and scaling of a gradient, each one pass over memory.

#[cfg(feature = "gpu")]
use super::gpu;
#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, DispatchTensor, TensorMetadata};
use burn::tensor::{Shape, Tensor, TensorData};
use rayon::prelude::*;

use super::host::{CHUNK_ELEMENTS, HostBackend, vectorised};
use super::operation::{TensorKernel, run};
use super::tensors::Tensors;

/// Lanes that add up in parallel; their sums are added in order.
const LANES: usize = 16;

/// Sum `[1]` of the squares of all entries of some tensors; not tracked by autodiff.
///
/// # Panics
/// If there is no tensor.
pub fn squared_norm(tensors: Vec<DispatchTensor>) -> Tensor<1> {
    let [sum] = run(&SquaredNorm, Tensors(tensors)).take();
    Tensor::from_dispatch(sum)
}

/// `values` times the only element of `factor` `[1]`, in place if no other tensor shares them; not tracked by autodiff.
pub fn scale_by<const D: usize>(values: Tensor<D>, factor: Tensor<1>) -> Tensor<D> {
    let [scaled] = run(&ScaleBy, [values.into_dispatch(), factor.into_dispatch()].into()).take();
    Tensor::from_dispatch(scaled)
}

struct SquaredNorm;

impl TensorKernel for SquaredNorm {
    fn composed<B: Backend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        [sum::<B>(arguments.0.into_iter().map(squares::<B>).collect())].into()
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        [gpu::squared_norm(arguments.0)].into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        [sum::<B>(arguments.0.into_iter().map(squares_on_host::<B>).collect())].into()
    }
}

/// The sum `[1]` of several sums `[1]`.
fn sum<B: Backend>(parts: Vec<FloatTensor<B>>) -> FloatTensor<B> {
    B::float_reshape(B::float_sum(B::float_cat(parts, 0)), Shape::new([1]))
}

/// Sum of squares `[1]`.
fn squares<B: Backend>(values: FloatTensor<B>) -> FloatTensor<B> {
    // Row sums first: one running sum over a large weight would lose digits in f32.
    let shape = values.shape();
    let columns = shape[shape.num_dims() - 1].max(1);
    let rows = shape.num_elements() / columns;
    let squares = B::float_reshape(B::float_mul(values.clone(), values), Shape::new([rows, columns]));
    B::float_reshape(B::float_sum(B::float_sum_dim(squares, 1)), Shape::new([1]))
}

fn squares_on_host<B: HostBackend>(mut tensor: FloatTensor<B>) -> FloatTensor<B> {
    let Some(values) = B::values(&mut tensor) else { return squares::<B>(tensor) };
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
    B::float_from_data(TensorData::new(vec![sum], [1]), &Default::default())
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

/// Arguments: values, factor.
struct ScaleBy;

impl TensorKernel for ScaleBy {
    fn composed<B: Backend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [values, factor] = arguments.take();
        let ones = vec![1; values.shape().num_dims()];
        [B::float_mul(values, B::float_reshape(factor, Shape::from(ones)))].into()
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let [values, factor] = arguments.take();
        [gpu::scale(values, factor)].into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [mut tensor, mut factor] = arguments.take();
        let (Some(values), Some(&[by])) = (B::values_mut(&mut tensor), B::values(&mut factor)) else {
            return self.composed([tensor, factor].into());
        };
        values.par_chunks_mut(CHUNK_ELEMENTS).for_each(|chunk| {
            vectorised(
                #[inline(always)]
                || {
                    for value in chunk.iter_mut() {
                        *value *= by;
                    }
                },
            );
        });
        [tensor].into()
    }
}
