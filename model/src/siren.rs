//! Modulated SIREN (Mehta et al., "Modulated periodic activations for generalizable local functional representations").
//!
//! A sine network maps coordinates to values while a ReLU network maps a latent to one gate per sine unit:
//!
//! ```text
//! m_0 = ReLU(A_0 z + a_0)            m_l = ReLU(A_l [m_{l−1}, z] + a_l)
//! h_0 = x                            h_{l+1} = sin(w0 (W_l h_l + b_l)) ⊙ m_l
//! ```
//!
//! Here the latent is `z = [garment row, vertex row]`. Each `A_l` is stored in the three parts that act on the previous
//! gate, on the garment row and on the vertex row: the second is one row per garment, and the third is one wide product
//! for all layers, which does not depend on the body and can be kept. The result is exactly that of the whole `A_l`.

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use crate::config::ModelConfig;
use crate::initializer::{Initializer, fan_in_bound};
use crate::linear::Linear;
use crate::ops::{
    Activation, activate_packed, activate_packed_sum, lies_on_host, modulated_siren, product,
    sine_modulation, split_columns,
};
use crate::packing::Packing;

/// Sizes and frequencies of a [`ModulatedSiren`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SirenSizes {
    /// Sine layers L.
    pub layers: usize,
    /// Units per layer.
    pub width: usize,
    /// Length of the latent's part that is one row per garment.
    pub garment_latent: usize,
    /// Length of the latent's part that is one row per vertex.
    pub vertex_latent: usize,
    /// w0 of the first layer.
    pub omega_first: f64,
    /// w0 of the others.
    pub omega_hidden: f64,
}

impl SirenSizes {
    /// D_s and D_m, which differ in the latent of a garment.
    pub(crate) fn new(config: &ModelConfig, garment_latent: usize) -> Self {
        Self {
            layers: config.siren_layers,
            width: config.siren_width,
            garment_latent,
            vertex_latent: config.embedding,
            omega_first: config.omega_first,
            omega_hidden: config.omega_hidden,
        }
    }
}

/// The gates m_l.
///
/// Parameters (blocks of `width` columns, one block per layer): `vertex` `[vertex_latent, L·width]`, `garment`
/// `[garment_latent, L·width]`, `bias` `[L·width]`, `hidden.{l}` `[width, width]` for the gates 1…L−1.
#[derive(Module, Debug)]
pub struct Modulator {
    /// Part of every layer that acts on the vertex row.
    pub vertex: Param<Tensor<2>>,
    /// Part of every layer that acts on the garment row.
    pub garment: Param<Tensor<2>>,
    /// Biases of every layer.
    pub bias: Param<Tensor<1>>,
    /// Part that acts on the previous gate, from the second layer on.
    pub hidden: Vec<Param<Tensor<2>>>,
    #[module(skip)]
    width: usize,
}

impl Modulator {
    fn new(sizes: &SirenSizes, start: &mut Initializer) -> Self {
        let columns = sizes.layers * sizes.width;
        let latent = sizes.garment_latent + sizes.vertex_latent;
        // Each column block starts as the same rows of an ordinary layer on [previous gate, latent] would.
        let bounds: Vec<f32> = (0..columns)
            .map(|column| {
                let previous = if column < sizes.width { 0 } else { sizes.width };
                fan_in_bound(previous + latent) as f32
            })
            .collect();
        let bound = fan_in_bound(sizes.width + latent);
        Self {
            vertex: start.uniform_columns([sizes.vertex_latent, columns], &bounds),
            garment: start.uniform_columns([sizes.garment_latent, columns], &bounds),
            bias: start.uniform_columns([columns], &bounds),
            hidden: (1..sizes.layers).map(|_| start.uniform([sizes.width, sizes.width], bound)).collect(),
            width: sizes.width,
        }
    }

    /// The part of all gates that depends on the vertices only: `[N, vertex_latent]` → `[N, L·width]`.
    pub fn vertex_product(&self, vertex: Tensor<2>) -> Tensor<2> {
        product(vertex, self.vertex.val())
    }

    /// The part of all gates that depends on the garments only: `[M, garment_latent]` → `[M, L·width]`.
    fn rows(&self, garment: Tensor<2>) -> Tensor<2> {
        product(garment, self.garment.val()) + self.bias.val().unsqueeze()
    }

    /// The gates m_0 … m_{L−1}, each `[N,width]`.
    fn gates(&self, vertex_product: Tensor<2>, rows: Tensor<2>, packing: &Packing) -> Vec<Tensor<2>> {
        let layers = self.hidden.len() + 1;
        let rows = split_columns(rows, self.width, layers);
        let products = split_columns(vertex_product, self.width, layers);
        let mut gates: Vec<Tensor<2>> = Vec::with_capacity(layers);
        for (layer, (fixed, row)) in products.into_iter().zip(rows).enumerate() {
            let gate = match layer.checked_sub(1) {
                None => activate_packed(Activation::Relu, fixed, row, packing),
                Some(previous) => {
                    let inner = product(gates[previous].clone(), self.hidden[previous].val());
                    activate_packed_sum(Activation::Relu, [inner, fixed], row, packing)
                }
            };
            gates.push(gate);
        }
        gates
    }
}

/// Coordinates and latent to a displacement.
///
/// Parameters: `modulator` (see [`Modulator`]), `sine.{0…}` with `weight` and `bias`, `output` with `weight` and `bias`.
#[derive(Module, Debug)]
pub struct ModulatedSiren {
    /// Latent to gates.
    pub modulator: Modulator,
    /// The sine layers.
    pub sine: Vec<Linear>,
    /// Last, linear layer to three values.
    pub output: Linear,
    #[module(skip)]
    omega_first: f64,
    #[module(skip)]
    omega_hidden: f64,
}

impl ModulatedSiren {
    /// SIREN initialisation (Sitzmann et al.): U(±1/in) for the first layer, U(±√(6/in)/w0) for the others.
    ///
    /// The output bias starts at zero: drawn, it would shift every garment by centimetres before training has begun,
    /// while the gates make the rest of an untrained network nearly vanish.
    pub fn new(sizes: &SirenSizes, start: &mut Initializer) -> Self {
        let modulator = Modulator::new(sizes, start);
        let hidden_bound = (6.0 / sizes.width as f64).sqrt() / sizes.omega_hidden;
        let sine = (0..sizes.layers)
            .map(|layer| match layer {
                0 => Linear::uniform(3, sizes.width, 1.0 / 3.0, start),
                _ => Linear::uniform(sizes.width, sizes.width, hidden_bound, start),
            })
            .collect();
        Self {
            modulator,
            sine,
            output: Linear { weight: start.uniform([sizes.width, 3], hidden_bound), bias: start.zeros([3]) },
            omega_first: sizes.omega_first,
            omega_hidden: sizes.omega_hidden,
        }
    }

    /// Coordinates `[N,3]`, [`Modulator::vertex_product`] `[N, L·width]` and garment latents `[M, garment_latent]` to
    /// values `[N,3]`.
    pub fn forward(
        &self,
        coordinates: Tensor<2>,
        vertex_product: Tensor<2>,
        garment: Tensor<2>,
        packing: &Packing,
    ) -> Tensor<2> {
        let rows = self.modulator.rows(garment);
        // A single layer has no weights between layers to hand over.
        if self.sine.len() == 1 || !lies_on_host(&coordinates) {
            return self.layer_by_layer(coordinates, vertex_product, rows, packing);
        }
        let arguments = [
            coordinates,
            vertex_product,
            rows,
            Tensor::cat(self.modulator.hidden.iter().map(Param::val).collect(), 0),
            self.sine[0].weight.val(),
            Tensor::cat(self.sine[1..].iter().map(|layer| layer.weight.val()).collect(), 0),
            Tensor::cat(self.sine.iter().map(Linear::bias_row).collect(), 1),
            self.output.weight.val(),
            self.output.bias_row(),
        ];
        modulated_siren(arguments, [self.omega_first, self.omega_hidden], packing)
    }

    /// Every layer as operations of its own: what GPUs run, and the oracle of the fused form.
    fn layer_by_layer(
        &self,
        coordinates: Tensor<2>,
        vertex_product: Tensor<2>,
        rows: Tensor<2>,
        packing: &Packing,
    ) -> Tensor<2> {
        let gates = self.modulator.gates(vertex_product, rows, packing);
        let mut features = coordinates;
        for (layer, (sine, gate)) in self.sine.iter().zip(gates).enumerate() {
            let omega = if layer == 0 { self.omega_first } else { self.omega_hidden };
            features = sine_modulation(sine.product(features), sine.bias_row(), gate, omega);
        }
        self.output.forward(features)
    }
}

#[cfg(test)]
mod tests;
