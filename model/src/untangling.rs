//! Untangling phase: forces between garments (F_f) and the displacement they cause (D_m).

use burn::module::Module;
use burn::tensor::Tensor;

use crate::config::{Graph, ModelConfig};
use crate::initializer::Initializer;
use crate::mlp::ResidualMlp;
use crate::ops::product;
use crate::siren::{ModulatedSiren, SirenSizes};
use crate::tensors::{ForceEdges, OutfitTensors};

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
    #[module(skip)]
    graph: Graph,
}

impl Untangling {
    pub(crate) fn new(config: &ModelConfig, start: &mut Initializer) -> Self {
        let (width, hidden) = (config.width, config.mlp_layers - 1);
        Self {
            force: ResidualMlp::new(2 * width, width, hidden, width, start),
            displacement: ModulatedSiren::new(&SirenSizes::new(config, 3 * width), start),
            scale: config.untangling_scale,
            graph: config.graph,
        }
    }

    /// The part of D_m that depends on the vertex embedding z_v `[ΣV,d]` only.
    pub fn vertex_product(&self, vertex: Tensor<2>) -> Tensor<2> {
        self.displacement.modulator.vertex_product(vertex)
    }

    /// Whether any garment of `outfit` is displaced: always in the full graph, else if two garments can touch.
    pub fn acts_on(&self, outfit: &OutfitTensors) -> bool {
        self.graph == Graph::Full || outfit.edges.is_some()
    }

    /// Displacements Δx_m `[ΣV,3]` (m).
    ///
    /// [`Graph::Near`] connects the contacts of `outfit`: exactly zero on garments without one. [`Graph::Full`] connects all
    /// garments, whatever the contacts.
    ///
    /// `canonical` is x_s `[ΣV,3]`, `draping` z_s `[M,width]`, `vertex_product` from [`Untangling::vertex_product`].
    pub fn displace(
        &self,
        outfit: &OutfitTensors,
        canonical: Tensor<2>,
        draping: Tensor<2>,
        vertex_product: Tensor<2>,
    ) -> Tensor<2> {
        let edges = match self.graph {
            Graph::Near => outfit.edges.clone(),
            Graph::Full => outfit.complete_edges(),
        };
        let [from_below, from_above] = self.net_forces(edges.as_ref(), &draping);
        let latent = Tensor::cat(vec![from_below, from_above, draping], 1);
        let values = self.displacement.forward(canonical, vertex_product, latent, &outfit.packing);
        let displacement = values * self.scale;
        match edges.and_then(|edges| edges.touched) {
            Some(touched) => displacement * touched,
            None => displacement,
        }
    }

    /// Both halves `[M,width]` of the net forces f^i: from the layers below and above. Zero without edges.
    fn net_forces(&self, edges: Option<&ForceEdges>, draping: &Tensor<2>) -> [Tensor<2>; 2] {
        let Some(edges) = edges else { return [draping.zeros_like(), draping.zeros_like()] };
        let receiver = product(edges.receiver.clone(), draping.clone());
        let sender = product(edges.sender.clone(), draping.clone());
        let forces = self.force.forward(Tensor::cat(vec![receiver, sender], 1));
        [&edges.from_below, &edges.from_above].map(|sum| product(sum.clone(), forces.clone()))
    }
}
