//! Untangling phase: forces between garments (F_f) and the displacement they cause (D_m).

use burn::module::Module;
use burn::tensor::Tensor;

use crate::config::ModelConfig;
use crate::initializer::Initializer;
use crate::mlp::ResidualMlp;
use crate::ops::product;
use crate::siren::{ModulatedSiren, SirenSizes};
use crate::tensors::OutfitTensors;

/// F_f and D_m.
///
/// Parameters: `force` (F_f, see [`ResidualMlp`]), `displacement` (D_m, see [`ModulatedSiren`]).
#[derive(Module, Debug)]
pub struct Untangling {
    /// F_f: (z_s^i, z_s^j) → f^ij.
    pub force: ResidualMlp,
    /// D_m: (x_s, [f^i, z_s, z_v]) → Δx_m.
    pub displacement: ModulatedSiren,
    #[module(skip)]
    scale: f64,
}

impl Untangling {
    pub(crate) fn new(config: &ModelConfig, start: &mut Initializer) -> Self {
        let (width, hidden) = (config.width, config.mlp_layers - 1);
        let sizes = SirenSizes {
            layers: config.siren_layers,
            width: config.siren_width,
            garment_latent: 3 * width,
            vertex_latent: config.embedding,
            omega_first: config.omega_first,
            omega_hidden: config.omega_hidden,
        };
        Self {
            force: ResidualMlp::new(2 * width, width, hidden, width, start),
            displacement: ModulatedSiren::new(&sizes, start),
            scale: config.untangling_scale,
        }
    }

    /// The part of D_m that depends on the vertex embedding z_v `[ΣV,d]` only.
    pub fn vertex_product(&self, vertex: Tensor<2>) -> Tensor<2> {
        self.displacement.modulator.vertex_product(vertex)
    }

    /// Displacements Δx_m `[ΣV,3]` in metres, exactly zero on garments without contact; `None` if nothing can touch.
    ///
    /// `canonical` is x_s `[ΣV,3]`, `draping` z_s `[M,width]`, `vertex_product` from [`Untangling::vertex_product`].
    pub fn displace(
        &self,
        outfit: &OutfitTensors,
        canonical: Tensor<2>,
        draping: Tensor<2>,
        vertex_product: impl FnOnce() -> Tensor<2>,
    ) -> Option<Tensor<2>> {
        let edges = outfit.edges.as_ref()?;
        let receiver = product(edges.receiver.clone(), draping.clone());
        let sender = product(edges.sender.clone(), draping.clone());
        let forces = self.force.forward(Tensor::cat(vec![receiver, sender], 1));
        let from_below = product(edges.from_below.clone(), forces.clone());
        let from_above = product(edges.from_above.clone(), forces);
        let latent = Tensor::cat(vec![from_below, from_above, draping], 1);
        let values = self.displacement.forward(canonical, vertex_product(), latent, &outfit.segments);
        let displacement = values * self.scale;
        Some(match &edges.touched {
            Some(touched) => displacement * touched.clone(),
            None => displacement,
        })
    }
}
