//! `sin(w0·(input + bias)) ⊙ gate`: one layer of a modulated SIREN after its matrix product.

use burn::tensor::Tensor;

#[cfg(feature = "gpu")]
use super::{gpu, host::lies_on_host};

/// `sin(omega·(input + bias)) ⊙ gate`: input and gate `[N,C]`, bias `[1,C]`.
///
/// On a GPU in one pass; the host has [`modulated_siren`](super::modulated_siren()) for all layers at once.
pub fn sine_modulation(input: Tensor<2>, bias: Tensor<2>, gate: Tensor<2>, omega: f64) -> Tensor<2> {
    #[cfg(feature = "gpu")]
    if !lies_on_host(&input) {
        return gpu::sine_modulation([input, bias, gate], omega);
    }
    ((input + bias) * omega).sin() * gate
}
