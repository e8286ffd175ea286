//! All layers of a modulated SIREN as one operation in host memory.
//!
//! A block of rows goes through all layers before the next one, so that what the layers hand on stays in a core's caches.
//! The backward pass reads the phases and the gates of the forward pass and computes the rest again.

use burn::tensor::Tensor;

use super::host::HostBackend;
use super::operation::{Operation, Saves, TensorKernel, apply};
use super::tensors::Tensors;
use crate::packing::Packing;

mod backward;
mod forward;
mod weights;

/// Values `[N,O]` of a modulated SIREN of L > 1 layers with W units, where the tensors
/// [lie in host memory](super::lies_on_host). `omegas` are the w0 of the first and of the other layers. Arguments:
///
/// - coordinates `[N,I]`;
/// - the part of the gates' arguments that every row has for itself `[N,L·W]`;
/// - the part that the rows of a garment share, with the biases `[M,L·W]`;
/// - weights between the gates, one below the other `[(L−1)·W,W]`;
/// - weight of the first sine layer `[I,W]`;
/// - weights of the other sine layers, one below the other `[(L−1)·W,W]`;
/// - biases of the sine layers, side by side `[1,L·W]`;
/// - weight of the output layer `[W,O]`, and its bias `[1,O]`.
pub fn modulated_siren(
    arguments: [Tensor<2>; 9],
    [omega_first, omega_hidden]: [f64; 2],
    packing: &Packing,
) -> Tensor<2> {
    let [_, _, _, gate_weights, ..] = &arguments;
    let layers = gate_weights.dims()[0] / gate_weights.dims()[1] + 1;
    let mut omegas = vec![omega_hidden as f32; layers];
    omegas[0] = omega_first as f32;
    apply(ModulatedSirenLayers { omegas, packing: packing.clone(), recorded: false }, arguments)
}

/// Arguments of [`modulated_siren`].
#[derive(Clone, Debug)]
struct ModulatedSirenLayers {
    /// w0 of every layer.
    omegas: Vec<f32>,
    packing: Packing,
    /// Whether phases and gates are results too.
    recorded: bool,
}

impl TensorKernel for ModulatedSirenLayers {
    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        forward::run::<B>(&self.omegas, &self.packing, self.recorded, arguments.take())
    }
}

impl Operation<9> for ModulatedSirenLayers {
    fn recorded(self) -> Self {
        Self { recorded: true, ..self }
    }

    /// Coordinates and weights.
    fn saves(&self, _: [bool; 9]) -> Saves<9> {
        Saves { arguments: [true, false, false, true, true, true, false, true, false], result: false }
    }

    fn gradients_on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        backward::run::<B>(&self.omegas, &self.packing, arguments.take())
    }
}
