//! The networks together: parameters, embeddings of garments, packed embeddings of outfits.
//!
//! Every part runs in a `tracing` span of its own name, which costs nothing until someone listens.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use tracing::trace_span;

use crate::config::{Dimensions, ModelConfig};
use crate::diffusion_net::MINIMUM_TIME;
use crate::draping::Draping;
use crate::error::ModelError;
use crate::garment_encoder::{GarmentEmbedding, GarmentEncoder};
use crate::initializer::Initializer;
use crate::mode::Mode;
use crate::skinning::Skinning;
use crate::surroundings::Surroundings;
use crate::tensors::{GarmentTensors, OutfitTensors, stack_rows};
use crate::untangling::Untangling;

/// The four networks.
///
/// Parameters (the names in a safetensors file): `garment_encoder`, `draping`, `skinning`, `surroundings`, `untangling`, each
/// documented at its type.
#[derive(Module, Debug)]
pub struct ClothCombo {
    /// E_c.
    pub garment_encoder: GarmentEncoder,
    /// F_s and D_s.
    pub draping: Draping,
    /// S.
    pub skinning: Skinning,
    /// The pose around every vertex; the paper has none.
    pub surroundings: Option<Surroundings>,
    /// F_f and D_m.
    pub untangling: Untangling,
}

/// Embeddings of the garments of an outfit, with everything that follows from them alone.
///
/// Depends on garments and weights, not on the body: make it once and drape any number of bodies, in training (one graph,
/// one shared gradient) or at inference.
#[derive(Clone, Debug)]
pub struct Embeddings {
    /// Vertex embeddings z_v `[ΣV,d]`.
    pub vertex: Tensor<2>,
    /// Garment embeddings z̄_v `[M,d]`.
    pub garment: Tensor<2>,
    pub(crate) draping_product: Tensor<2>,
    pub(crate) skinning_product: Tensor<2>,
    pub(crate) untangling_product: Option<Tensor<2>>,
}

impl ClothCombo {
    /// Networks with random weights, fixed by the seed; they require gradients if the device has autodiff.
    ///
    /// # Errors
    /// A configuration value out of range, or dimensions without a joint.
    pub fn new(
        config: &ModelConfig,
        dimensions: &Dimensions,
        seed: u64,
        device: &Device,
    ) -> Result<Self, ModelError> {
        config.validate()?;
        if dimensions.joints == 0 {
            return Err(ModelError::Config {
                key: "joints",
                value: "0".into(),
                expected: "at least 1".into(),
            });
        }
        let start = &mut Initializer::new(seed, device);
        Ok(Self {
            garment_encoder: GarmentEncoder::new(config, start),
            draping: Draping::new(config, dimensions, start),
            skinning: Skinning::new(config, dimensions, start),
            untangling: Untangling::new(config, start),
            surroundings: (config.surroundings > 0).then(|| Surroundings::new(config, dimensions, start)),
        })
    }

    /// Embeds one garment (E_c).
    pub fn encode(&self, garment: &GarmentTensors) -> GarmentEmbedding {
        let _span = trace_span!("embedding").entered();
        self.garment_encoder.forward(garment)
    }

    /// Packs the embeddings of an outfit's garments, in its order, and multiplies them with every weight that acts on vertices
    /// in a [forward pass](Self::forward) of `mode`.
    ///
    /// # Errors
    /// A number of embeddings or of their rows that disagrees with the outfit.
    pub fn pack(
        &self,
        outfit: &OutfitTensors,
        garments: &[GarmentEmbedding],
        mode: Mode,
    ) -> Result<Embeddings, ModelError> {
        let ranges = outfit.ranges();
        if ranges.len() != garments.len() {
            let reason = format!("{} embeddings for an outfit of {} garments", garments.len(), ranges.len());
            return Err(ModelError::Outfit { garment: garments.len().min(ranges.len()), reason });
        }
        for (garment, (range, embedding)) in ranges.iter().zip(garments).enumerate() {
            let rows = embedding.vertex.dims()[0];
            if rows != range.len() {
                let reason = format!("an embedding of {rows} vertices, the garment has {}", range.len());
                return Err(ModelError::Outfit { garment, reason });
            }
        }
        let span = trace_span!("vertex products").entered();
        let vertex = stack_rows(garments.iter().map(|embedding| embedding.vertex.clone()).collect());
        let garment = stack_rows(garments.iter().map(|embedding| embedding.garment.clone()).collect());
        let draping_product = self.draping.vertex_product(vertex.clone());
        let skinning_product = self.skinning.vertex_product(outfit.rest.clone(), vertex.clone());
        drop(span);
        let untangling_product = (mode == Mode::Layered && self.untangling.acts_on(outfit)).then(|| {
            let _span = trace_span!("untangling").entered();
            self.untangling.vertex_product(vertex.clone())
        });
        Ok(Embeddings { vertex, garment, draping_product, skinning_product, untangling_product })
    }

    /// Raises diffusion times that an optimiser step pushed below the smallest one in use.
    ///
    /// Call it after every step: the published DiffusionNet clamps the parameter itself, and a time left far below the
    /// bound would need as many steps to come back.
    pub fn clamp_diffusion_times(mut self) -> Self {
        for block in &mut self.garment_encoder.diffusion_net.blocks {
            block.diffusion.time = block.diffusion.time.clone().map(|time| {
                let tracked = time.is_require_grad();
                let clamped = time.inner().clamp_min(MINIMUM_TIME);
                if tracked { Tensor::from_inner(clamped).require_grad() } else { clamped }
            });
        }
        self
    }
}
