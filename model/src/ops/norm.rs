//! Squared norm and scaling of a gradient, each one pass over memory.

#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::backend::DispatchTensor;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Shape, Tensor, TensorData};
use rayon::prelude::*;

#[cfg(feature = "gpu")]
use super::gpu;
use super::host::{CHUNK_ELEMENTS, HostBackend};
use super::instruction_set::vectorised;
use super::operation::{TensorKernel, run};
use super::tensors::Tensors;

/// Lanes that add up in parallel; their sums are added in order.
const SUM_LANES: usize = 16;

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
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        [gpu::squared_norm(arguments.0)].into()
    }

    fn on_host<B: HostBackend>(&self, Tensors(tensors): Tensors<B>) -> Tensors<B> {
        let sums = tensors.into_iter().map(squares_on_host::<B>).collect();
        [B::float_reshape(B::float_sum(B::float_cat(sums, 0)), Shape::new([1]))].into()
    }
}

/// Sum of squares `[1]`.
fn squares_on_host<B: HostBackend>(mut tensor: FloatTensor<B>) -> FloatTensor<B> {
    let parts: Vec<f64> = B::values(&mut tensor)
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
    let mut sums = [0.0_f64; SUM_LANES];
    let (lines, rest) = values.as_chunks::<SUM_LANES>();
    for line in lines {
        for lane in 0..SUM_LANES {
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
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let [values, factor] = arguments.take();
        [gpu::scale(values, factor)].into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [mut tensor, mut factor] = arguments.take();
        let by = B::values(&mut factor)[0];
        B::values_mut(&mut tensor).par_chunks_mut(CHUNK_ELEMENTS).for_each(|chunk| {
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
