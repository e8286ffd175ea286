//! The whole of ClothCombo: garments, order, body to draped positions.
//!
//! Every part runs in a `tracing` span of its own name, which costs nothing until someone listens.

use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::{Device, Tensor};
use tracing::trace_span;

use crate::config::{Dimensions, ModelConfig};
use crate::correction::{Conditioning, Correction};
use crate::diffusion_net::MINIMUM_TIME;
use crate::draping::Draping;
use crate::error::ModelError;
use crate::garment_encoder::{GarmentEmbedding, GarmentEncoder};
use crate::initializer::Initializer;
use crate::linear_blend_skinning::linear_blend_skinning;
use crate::skinning::Skinning;
use crate::tensors::{BodyTensors, ContactFeatureTensors, GarmentTensors, OutfitTensors, stack_rows};
use crate::untangling::Untangling;

/// The four networks, and those that correct what they do.
///
/// Parameters (the names in a safetensors file): `garment_encoder`, `draping`, `skinning`, `untangling`, `corrections.{0…}`, each
/// documented at its type.
#[derive(Module, Debug)]
pub struct ClothCombo {
    /// E_c.
    pub garment_encoder: GarmentEncoder,
    /// F_s and D_s.
    pub draping: Draping,
    /// S.
    pub skinning: Skinning,
    /// F_f and D_m.
    pub untangling: Untangling,
    /// Correct what the others do, one after the other; the paper has none.
    pub corrections: Vec<Correction>,
    /// Correction steps at inference ([`ModelConfig::correction_steps`]).
    #[module(skip)]
    pub correction_steps: usize,
}

/// What the vertices of all garments feel at posed positions `[ΣV,3]` [m].
pub type Feel<'a> = &'a dyn Fn(Tensor<2>) -> ContactFeatureTensors;

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
    draping_product: Tensor<2>,
    skinning_product: Tensor<2>,
    untangling_product: Option<Tensor<2>>,
}

impl Embeddings {
    /// The same embeddings cut from their graph and from autodiff.
    pub fn inner(self) -> Self {
        Self {
            vertex: self.vertex.inner(),
            garment: self.garment.inner(),
            draping_product: self.draping_product.inner(),
            skinning_product: self.skinning_product.inner(),
            untangling_product: self.untangling_product.map(Tensor::inner),
        }
    }
}

/// Garments draped one by one, before untangling.
#[derive(Clone, Debug)]
pub struct SingleDrape {
    /// Canonical (T-pose) positions x_s `[ΣV,3]` in metres.
    pub canonical: Tensor<2>,
    /// Posed positions V_s `[ΣV,3]` in metres.
    pub posed: Tensor<2>,
    /// Corrected skin weights W + ΔW `[ΣV,J]`.
    pub skin_weights: Tensor<2>,
    /// Draping embeddings z_s `[M,width]`.
    pub draping_embedding: Tensor<2>,
}

impl SingleDrape {
    /// The same drape cut from its graph and from autodiff.
    pub fn inner(self) -> Self {
        Self {
            canonical: self.canonical.inner(),
            posed: self.posed.inner(),
            skin_weights: self.skin_weights.inner(),
            draping_embedding: self.draping_embedding.inner(),
        }
    }
}

/// Garments of an outfit after untangling.
#[derive(Clone, Debug)]
pub struct LayeredDrape {
    /// Canonical (T-pose) positions x_m `[ΣV,3]` in metres.
    pub canonical: Tensor<2>,
    /// Posed positions V_m `[ΣV,3]` in metres.
    pub posed: Tensor<2>,
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
            corrections: Vec::new(),
            correction_steps: 0,
        }
        .with_corrections(config, start))
    }

    /// Embeds one garment (E_c).
    pub fn encode(&self, garment: &GarmentTensors) -> GarmentEmbedding {
        let _span = trace_span!("embedding").entered();
        self.garment_encoder.forward(garment)
    }

    /// Packs the embeddings of an outfit's garments, in its order, and multiplies them with every weight of the single
    /// draping phase that acts on vertices.
    ///
    /// # Errors
    /// A number of embeddings or of their rows that disagrees with the outfit.
    pub fn pack(
        &self,
        outfit: &OutfitTensors,
        garments: &[GarmentEmbedding],
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
        let _span = trace_span!("vertex products").entered();
        let vertex = stack_rows(garments.iter().map(|embedding| embedding.vertex.clone()).collect());
        let garment = stack_rows(garments.iter().map(|embedding| embedding.garment.clone()).collect());
        Ok(Embeddings {
            draping_product: self.draping.vertex_product(vertex.clone()),
            skinning_product: self.skinning.vertex_product(outfit.rest.clone(), vertex.clone()),
            untangling_product: None,
            vertex,
            garment,
        })
    }

    /// Adds what untangling needs of the embeddings, so that several bodies share it.
    ///
    /// Uses the untangling weights of `self`: when the first stage is frozen, pack with the frozen model and prepare with
    /// the trained one. Does nothing for an outfit that [untangling leaves alone](Untangling::acts_on).
    pub fn prepare_untangling(&self, outfit: &OutfitTensors, mut embeddings: Embeddings) -> Embeddings {
        if self.untangling.acts_on(outfit) {
            let _span = trace_span!("untangling").entered();
            embeddings.untangling_product = Some(self.untangling.vertex_product(embeddings.vertex.clone()));
        }
        embeddings
    }

    /// Drapes every garment on its own.
    ///
    /// `start` `[ΣV,3]` is what the displacement is added to: the rest positions, or those moved with the body's shape.
    pub fn drape_single(
        &self,
        outfit: &OutfitTensors,
        embeddings: &Embeddings,
        body: &BodyTensors,
        start: Tensor<2>,
    ) -> SingleDrape {
        let span = trace_span!("draping").entered();
        let draping_embedding = self.draping.embed(embeddings.garment.clone(), body);
        let displacement = self.draping.displace(
            outfit.rest.clone(),
            embeddings.draping_product.clone(),
            draping_embedding.clone(),
            &outfit.packing,
        );
        let canonical = displacement + start;
        drop(span);
        let _span = trace_span!("skinning").entered();
        let skin_weights =
            self.skinning.weights(outfit, embeddings.skinning_product.clone(), draping_embedding.clone());
        let posed = linear_blend_skinning(canonical.clone(), skin_weights.clone(), body.bones.clone());
        SingleDrape { canonical, posed, skin_weights, draping_embedding }
    }

    /// Lets the garments press on each other.
    ///
    /// An outfit that [untangling leaves alone](Untangling::acts_on): returns the single drape and evaluates nothing. The single
    /// drape may come from a frozen model (plain tensors), in which case gradients reach the untangling networks only.
    pub fn untangle(
        &self,
        outfit: &OutfitTensors,
        embeddings: &Embeddings,
        single: &SingleDrape,
        body: &BodyTensors,
    ) -> LayeredDrape {
        let _span = self.untangling.acts_on(outfit).then(|| trace_span!("untangling").entered());
        let displacement = self.untangling.displace(
            outfit,
            single.canonical.clone(),
            single.draping_embedding.clone(),
            || match &embeddings.untangling_product {
                Some(product) => product.clone(),
                None => self.untangling.vertex_product(embeddings.vertex.clone()),
            },
        );
        match displacement {
            None => LayeredDrape { canonical: single.canonical.clone(), posed: single.posed.clone() },
            Some(displacement) => {
                let canonical = single.canonical.clone() + displacement;
                let posed =
                    linear_blend_skinning(canonical.clone(), single.skin_weights.clone(), body.bones.clone());
                LayeredDrape { canonical, posed }
            }
        }
    }

    /// The same networks with new correction networks in place of any they have; untrained, these correct nothing.
    pub fn with_corrections(mut self, config: &ModelConfig, start: &mut Initializer) -> Self {
        self.corrections = (0..config.corrections).map(|_| Correction::new(config, start)).collect();
        self.correction_steps = config.correction_steps.unwrap_or(config.corrections);
        self
    }

    /// The same networks with at most `steps` correction steps at inference.
    pub fn with_correction_steps(mut self, steps: usize) -> Self {
        self.correction_steps = steps;
        self
    }

    /// The states after each of the correction networks, one after the other, as they are trained; none without any.
    ///
    /// `draped` is where `single` and untangling brought the garments from `start`; `feel` says what is felt at posed positions.
    /// Nothing of that gets a gradient, whatever device it comes from.
    pub fn correct(
        &self,
        outfit: &OutfitTensors,
        embeddings: &Embeddings,
        (start, single): (Tensor<2>, &SingleDrape),
        draped: &LayeredDrape,
        body: &BodyTensors,
        feel: Feel<'_>,
    ) -> Vec<LayeredDrape> {
        let mut states: Vec<LayeredDrape> = Vec::with_capacity(self.corrections.len());
        for network in 0..self.corrections.len() {
            let before = states.last().unwrap_or(draped);
            let felt = feel(before.posed.clone().detach());
            let canonical = before.canonical.clone().detach();
            let state = self.correct_once(
                network,
                outfit,
                embeddings,
                (start.clone(), single),
                canonical,
                body,
                felt,
            );
            states.push(state);
        }
        states
    }

    /// Where correction network `network` moves garments from `canonical` positions `[ΣV,3]` [m], at which `felt` is felt.
    ///
    /// # Panics
    /// If there is no such network.
    pub fn correct_once(
        &self,
        network: usize,
        outfit: &OutfitTensors,
        embeddings: &Embeddings,
        (start, single): (Tensor<2>, &SingleDrape),
        canonical: Tensor<2>,
        body: &BodyTensors,
        felt: ContactFeatureTensors,
    ) -> LayeredDrape {
        let _span = trace_span!("corrections").entered();
        let [vertex, draping, weights] =
            [&embeddings.vertex, &single.draping_embedding, &single.skin_weights].map(|t| t.clone().detach());
        let given = Conditioning { vertex: &vertex, draping: &draping, packing: &outfit.packing };
        let displacement = canonical - start.clone();
        let canonical = self.corrections[network].correct(displacement, felt, &given) + start;
        let posed = linear_blend_skinning(canonical.clone(), weights, body.bones.clone());
        LayeredDrape { canonical, posed }
    }

    /// Raises diffusion times that an optimiser step pushed below the smallest one in use.
    ///
    /// Call it after every step: the published DiffusionNet clamps the parameter itself, and a time left far below the
    /// bound would need as many steps to come back.
    pub fn clamp_diffusion_times(mut self) -> Self {
        for block in &mut self.garment_encoder.diffusion_net.blocks {
            let time = block.diffusion.time.clone();
            block.diffusion.time = ClampTimes.map_float(time);
        }
        self
    }
}

struct ClampTimes;

impl ModuleMapper for ClampTimes {
    fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (id, value, mapper) = parameter.consume();
        let tracked = value.is_require_grad();
        let clamped = value.inner().clamp_min(MINIMUM_TIME);
        let clamped = if tracked { Tensor::from_inner(clamped).require_grad() } else { clamped };
        Param::from_mapped_value(id, clamped, mapper)
    }
}

#[cfg(test)]
mod tests;
