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

/// What a modulated SIREN of L > 1 layers with W units is applied to, and its parameters.
pub struct SirenArguments {
    /// Coordinates `[N,I]`.
    pub coordinates: Tensor<2>,
    /// Part of the gates' arguments that every row has for itself `[N,L·W]`.
    pub vertex_product: Tensor<2>,
    /// Part of the gates' arguments that the rows of a garment share, with the biases `[M,L·W]`.
    pub rows: Tensor<2>,
    /// Weights between the gates, one below the other `[(L−1)·W,W]`.
    pub gate_weights: Tensor<2>,
    /// Weight of the first sine layer `[I,W]`.
    pub first_weight: Tensor<2>,
    /// Weights of the other sine layers, one below the other `[(L−1)·W,W]`.
    pub sine_weights: Tensor<2>,
    /// Biases of the sine layers, side by side `[1,L·W]`.
    pub sine_biases: Tensor<2>,
    /// Weight of the output layer `[W,O]`.
    pub output_weight: Tensor<2>,
    /// Bias of the output layer `[1,O]`.
    pub output_bias: Tensor<2>,
}

/// Values `[N,O]`, where the tensors [lie in host memory](super::lies_on_host).
pub fn modulated_siren(
    arguments: SirenArguments,
    [omega_first, omega_hidden]: [f64; 2],
    packing: &Packing,
) -> Tensor<2> {
    let a = arguments;
    let layers = a.gate_weights.dims()[0] / a.gate_weights.dims()[1] + 1;
    let mut omegas = vec![omega_hidden as f32; layers];
    omegas[0] = omega_first as f32;
    let operation = ModulatedSirenLayers { omegas, packing: packing.clone(), recorded: false };
    let arguments = [
        a.coordinates,
        a.vertex_product,
        a.rows,
        a.gate_weights,
        a.first_weight,
        a.sine_weights,
        a.sine_biases,
        a.output_weight,
        a.output_bias,
    ];
    apply(operation, arguments)
}

/// Arguments in the order of [`SirenArguments`].
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
