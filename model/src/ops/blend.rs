//! Weighted mean of a parameter and its running average.

use burn::tensor::Tensor;

#[cfg(feature = "gpu")]
use super::{gpu, host::lies_on_host};

/// `decay · old + (1 − decay) · new`, of one shape, of tensors that autodiff does not track.
pub fn blend<const D: usize>(old: Tensor<D>, new: Tensor<D>, decay: f64) -> Tensor<D> {
    #[cfg(feature = "gpu")]
    if !lies_on_host(&old) {
        return gpu::blend(old, new, decay);
    }
    old * decay + new * (1.0 - decay)
}
