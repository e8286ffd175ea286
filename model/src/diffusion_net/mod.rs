//! DiffusionNet (Sharp et al., "DiffusionNet: Discretization agnostic learning on surfaces") with spectral diffusion.
//!
//! Diffusion over k eigenpairs makes x_diff = Φ c with c = e^{−λt} ⊙ (Φᵀ M x), which has only k rows. Everything linear that
//! follows is applied to c before it is expanded to the vertices: the tangent gradients through the precomputed G_xΦ and
//! G_yΦ, their complex mixing, and the part of the first MLP layer that acts on x_diff. No sparse operation is left.
//! It agrees with the published order of operations to rounding.

mod block;
mod mixing;
mod spectral;
#[cfg(test)]
mod tests;

pub use block::{BlockMlp, DiffusionBlock};
pub use mixing::ComplexMixing;
pub(crate) use spectral::MINIMUM_TIME;
pub use spectral::SpectralDiffusion;

use burn::module::Module;
use burn::tensor::Tensor;

use crate::initializer::Initializer;
use crate::linear::Linear;
use crate::tensors::GarmentTensors;

/// Vertex features from rest positions.
///
/// Parameters: `first` and `last` (each `weight`, `bias`), `blocks.{0…}` (see [`DiffusionBlock`]).
#[derive(Module, Debug)]
pub struct DiffusionNet {
    /// Coordinates to channels.
    pub first: Linear,
    /// The blocks.
    pub blocks: Vec<DiffusionBlock>,
    /// Channels to the embedding.
    pub last: Linear,
}

impl DiffusionNet {
    /// A network from 3 coordinates through `blocks` blocks of `width` channels to
    /// `outputs` features.
    pub fn new(blocks: usize, width: usize, outputs: usize, start: &mut Initializer) -> Self {
        Self {
            first: Linear::new(3, width, start),
            blocks: (0..blocks).map(|_| DiffusionBlock::new(width, start)).collect(),
            last: Linear::new(width, outputs, start),
        }
    }

    /// Features `[V, outputs]` of a garment's vertices.
    pub fn forward(&self, garment: &GarmentTensors) -> Tensor<2> {
        let features = self.first.forward(garment.rest.clone());
        let features = self.blocks.iter().fold(features, |features, block| block.forward(features, garment));
        self.last.forward(features)
    }
}
