//! The embedding network E_c: a garment to one feature row per vertex and one for the whole.

use burn::module::Module;
use burn::tensor::Tensor;

use crate::config::ModelConfig;
use crate::diffusion_net::DiffusionNet;
use crate::initializer::Initializer;
use crate::ops::product;
use crate::tensors::GarmentTensors;

/// E_c, a DiffusionNet on rest positions (no normalisation of the input, as in the paper).
///
/// Parameters: `diffusion_net` (see [`DiffusionNet`]).
#[derive(Module, Debug)]
pub struct GarmentEncoder {
    /// The network.
    pub diffusion_net: DiffusionNet,
    #[module(skip)]
    has_vertex_embedding: bool,
}

/// Embedding of one garment.
#[derive(Clone, Debug)]
pub struct GarmentEmbedding {
    /// Vertex embedding z_v `[V,d]`; z̄_v in every row without [`ModelConfig::vertex_embedding`].
    pub vertex: Tensor<2>,
    /// Garment embedding z̄_v `[1,d]`, the mass-weighted mean of z_v.
    pub garment: Tensor<2>,
}

impl GarmentEmbedding {
    /// About how much memory it takes (bytes).
    pub fn bytes(&self) -> usize {
        let [vertices, width] = self.vertex.dims();
        4 * width * (vertices + 1)
    }

    /// The same embedding cut from its graph and from autodiff.
    pub fn inner(self) -> Self {
        Self { vertex: self.vertex.inner(), garment: self.garment.inner() }
    }
}

impl GarmentEncoder {
    pub(crate) fn new(config: &ModelConfig, start: &mut Initializer) -> Self {
        let (blocks, width) = (config.diffusion_blocks, config.diffusion_width);
        Self {
            diffusion_net: DiffusionNet::new(blocks, width, config.embedding, start),
            has_vertex_embedding: config.vertex_embedding,
        }
    }

    /// Embeds one garment.
    pub fn forward(&self, garment: &GarmentTensors) -> GarmentEmbedding {
        let vertex = self.diffusion_net.forward(garment);
        // A product with the normalised mass row: a plain sum over thousands of rows would lose digits in f32.
        let mean = product(garment.mass.clone(), vertex.clone());
        let vertex = match self.has_vertex_embedding {
            true => vertex,
            // A product as well: its backward pass sums thousands of rows.
            false => product(Tensor::ones([vertex.dims()[0], 1], &garment.mass.device()), mean.clone()),
        };
        GarmentEmbedding { vertex, garment: mean }
    }
}
