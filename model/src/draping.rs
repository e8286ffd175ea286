//! Single-garment draping: F_s (body and garment to the draping embedding) and D_s (coordinates to a displacement).

use burn::module::Module;
use burn::tensor::Tensor;

use crate::config::{Dimensions, ModelConfig};
use crate::initializer::Initializer;
use crate::mlp::ResidualMlp;
use crate::packing::Packing;
use crate::siren::{ModulatedSiren, SirenSizes};
use crate::tensors::BodyTensors;

/// F_s and D_s.
///
/// Parameters: `embedding` (F_s, see [`ResidualMlp`]), `displacement` (D_s, see [`ModulatedSiren`]).
#[derive(Module, Debug)]
pub struct Draping {
    /// F_s: (z̄_v, β, θ) → z_s.
    pub embedding: ResidualMlp,
    /// D_s: (x, [z_s, z_v]) → Δx_s.
    pub displacement: ModulatedSiren,
    #[module(skip)]
    scale: f64,
}

impl Draping {
    pub(crate) fn new(config: &ModelConfig, dimensions: &Dimensions, start: &mut Initializer) -> Self {
        let inputs = config.embedding + dimensions.shape + dimensions.pose;
        let (width, hidden) = (config.width, config.mlp_layers - 1);
        Self {
            embedding: ResidualMlp::new(inputs, width, hidden, width, start),
            displacement: ModulatedSiren::new(&SirenSizes::new(config, width), start),
            scale: config.displacement_scale,
        }
    }

    /// Draping embeddings z_s `[M,width]` of garments with embeddings z̄_v `[M,d]` on one body.
    pub fn embed(&self, garments: Tensor<2>, body: &BodyTensors) -> Tensor<2> {
        let count = garments.dims()[0];
        let on_every_row = |row: &Tensor<2>| {
            let [_, columns] = row.dims();
            // A body without shape space has no column of its own.
            (columns > 0).then(|| row.clone().expand([count, columns]))
        };
        let body = [&body.shape, &body.pose].into_iter().filter_map(on_every_row);
        self.embedding.forward(Tensor::cat(std::iter::once(garments).chain(body).collect(), 1))
    }

    /// The part of D_s that depends on the vertex embedding z_v `[ΣV,d]` only.
    pub fn vertex_product(&self, vertex: Tensor<2>) -> Tensor<2> {
        self.displacement.modulator.vertex_product(vertex)
    }

    /// Displacements Δx_s `[ΣV,3]` (m).
    pub fn displace(
        &self,
        rest: Tensor<2>,
        vertex_product: Tensor<2>,
        draping: Tensor<2>,
        packing: &Packing,
    ) -> Tensor<2> {
        self.displacement.forward(rest, vertex_product, draping, packing) * self.scale
    }
}
