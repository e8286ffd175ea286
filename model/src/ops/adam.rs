//! One Adam update of a parameter and both its moments, in a single pass over memory.

#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::tensor::Tensor;
use rayon::prelude::*;

#[cfg(feature = "gpu")]
use super::gpu;
use super::host::{CHUNK_ELEMENTS, HostBackend};
use super::instruction_set::vectorised;
use super::operation::{TensorKernel, run};
use super::tensors::Tensors;

/// Factors of one update; those of the bias correction are already in `step_size` and `epsilon`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdamFactors {
    /// Decay of the first moment.
    pub beta_1: f32,
    /// Decay of the second moment.
    pub beta_2: f32,
    /// Learning rate times `√(1 − β₂ᵗ) / (1 − β₁ᵗ)`.
    pub step_size: f32,
    /// ε times `√(1 − β₂ᵗ)`.
    pub epsilon: f32,
}

/// The parameter and both moments after one update, `m ← β₁m + (1 − β₁)g`, `v ← β₂v + (1 − β₂)g²`,
/// `p ← p − step·m / (√v + ε)`; all of one shape, none tracked by autodiff.
///
/// Memory that no other tensor shares is overwritten in place.
pub fn adam_step<const D: usize>(
    parameter: Tensor<D>,
    gradient: Tensor<D>,
    [first, second]: [Tensor<D>; 2],
    factors: AdamFactors,
) -> (Tensor<D>, [Tensor<D>; 2]) {
    let arguments = [parameter, gradient, first, second].map(Tensor::into_dispatch);
    let [parameter, first, second] = run(&factors, arguments.into()).take().map(Tensor::from_dispatch);
    (parameter, [first, second])
}

/// Arguments: parameter, gradient, first and second moment. Results: parameter, first and second moment.
impl TensorKernel for AdamFactors {
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let Self { beta_1, beta_2, step_size, epsilon } = *self;
        gpu::adam(arguments.take(), [beta_1, beta_2], step_size, epsilon).into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [mut parameter, mut gradient, mut first, mut second] = arguments.take();
        let (p, g) = (B::values_mut(&mut parameter), B::values(&mut gradient));
        let (m, v) = (B::values_mut(&mut first), B::values_mut(&mut second));
        let parts = p.par_chunks_mut(CHUNK_ELEMENTS).zip(g.par_chunks(CHUNK_ELEMENTS));
        let moments = m.par_chunks_mut(CHUNK_ELEMENTS).zip(v.par_chunks_mut(CHUNK_ELEMENTS));
        parts.zip(moments).for_each(|((p, g), (m, v))| {
            vectorised(
                #[inline(always)]
                || update(p, g, m, v, *self),
            );
        });
        [parameter, first, second].into()
    }
}

#[inline(always)]
fn update(p: &mut [f32], g: &[f32], m: &mut [f32], v: &mut [f32], factors: AdamFactors) {
    let AdamFactors { beta_1, beta_2, step_size, epsilon } = factors;
    let (rest_1, rest_2) = (1.0 - beta_1, 1.0 - beta_2);
    let count = p.len();
    let (g, m, v) = (&g[..count], &mut m[..count], &mut v[..count]);
    for i in 0..count {
        m[i] = m[i] * beta_1 + g[i] * rest_1;
        v[i] = v[i] * beta_2 + g[i] * g[i] * rest_2;
        p[i] -= step_size * m[i] / (v[i].sqrt() + epsilon);
    }
}
