//! Gradient features of DiffusionNet: `tanh(Re(conj(g) ⊙ A g))` per channel, from gradients mixed in advance.

use burn::tensor::Tensor;

#[cfg(feature = "gpu")]
use super::{gpu, host::lies_on_host};

/// `[2V,3C]` → `[V,C]`.
///
/// Rows 0…V hold the derivative along the first tangent axis, rows V…2V along the second; the three column blocks are the
/// gradient g itself, g times the real part of A and g times its imaginary part. With `x0 x1 x2` and `y0 y1 y2` for the six
/// blocks the result is `tanh(x0 (x1 − y2) + y0 (y1 + x2))`.
///
/// On a GPU in one pass; the host has [`diffusion_mlp`](super::diffusion_mlp()) for all that a block does at a vertex.
pub fn gradient_features(mixed: Tensor<2>) -> Tensor<2> {
    #[cfg(feature = "gpu")]
    if !lies_on_host(&mixed) {
        return gpu::gradient_features(mixed);
    }
    composed(mixed)
}

/// The same of burn's operations.
pub(super) fn composed(mixed: Tensor<2>) -> Tensor<2> {
    let [x, y] = mixed.chunk(2, 0).try_into().expect("two axes");
    let [[x0, x1, x2], [y0, y1, y2]] = [x, y].map(|axis| axis.chunk(3, 1).try_into().expect("three parts"));
    (x0 * (x1 - y2) + y0 * (y1 + x2)).tanh()
}
