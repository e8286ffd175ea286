//! Weighted mean of a parameter and its running average.

use burn::backend::Backend;
#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::tensor::Tensor;

#[cfg(feature = "gpu")]
use super::gpu;
use super::operation::{TensorKernel, run};
use super::tensors::Tensors;

/// `decay · old + (1 − decay) · new`, of one shape; not tracked by autodiff.
pub fn blend<const D: usize>(old: Tensor<D>, new: Tensor<D>, decay: f64) -> Tensor<D> {
    let [mean] = run(&Blend { decay }, [old.into_dispatch(), new.into_dispatch()].into()).take();
    Tensor::from_dispatch(mean)
}

/// Arguments: old, new.
struct Blend {
    decay: f64,
}

impl TensorKernel for Blend {
    fn composed<B: Backend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [old, new] = arguments.take();
        let kept = B::float_mul_scalar(old, self.decay.into());
        [B::float_add(kept, B::float_mul_scalar(new, (1.0 - self.decay).into()))].into()
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        [gpu::blend(arguments.take(), self.decay)].into()
    }
}
