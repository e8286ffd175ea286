//! Constant tensors of garments, outfits and bodies on one device, and embeddings of garments.

use super::draped::to_device;
use crate::dataset::{
    Dataset, DatasetError, PreparedBody, PreparedGarment, PreparedScene, SCENES_AHEAD, tensor_bytes,
};
use crate::system::device::is_processor;
use crate::system::lru_cache::{KeptBytes, LruCache, MemoryBudget, Residence};
use burn::tensor::{Device, Tensor};
use clothcombo_model::{
    BodyTensors, ClothCombo, Dimensions, Embeddings, GarmentArrays, GarmentEmbedding, GarmentTensors, Mode,
    ModelError, OutfitTensors,
};
use clothcombo_physics::operators::SurfaceOperators;
use miette::Diagnostic;
use std::sync::Arc;
use thiserror::Error;

/// Why a scene cannot be draped.
#[derive(Debug, Error, Diagnostic)]
pub enum DrapeError {
    /// A garment cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Dataset(#[from] DatasetError),
    /// The networks do not take it.
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// Embeddings of one state of the networks, by garment; threads share it.
pub type KnownEmbeddings = LruCache<GarmentEmbedding>;

/// The constant tensors of garments on one device, made when a garment is first used.
pub struct TensorStore {
    dataset: Arc<Dataset>,
    memory: Arc<MemoryBudget>,
    garments: LruCache<GarmentTensors>,
    dimensions: Dimensions,
    device: Device,
}

impl TensorStore {
    /// For the garments of `dataset`.
    pub fn new(dataset: Arc<Dataset>, dimensions: Dimensions, device: &Device) -> Self {
        let memory = match is_processor(device) {
            true => dataset.memory.clone(),
            false => {
                MemoryBudget::new(KeptBytes { total: usize::MAX, device: dataset.memory.limits().device })
            }
        };
        let garments = LruCache::new(&memory, Residence::Device);
        Self { dataset, memory, garments, dimensions, device: device.clone().inner() }
    }

    /// What is kept of garments on the device, and how much may be.
    pub fn memory(&self) -> &MemoryBudget {
        &self.memory
    }

    /// The data the tensors are made from.
    pub fn dataset(&self) -> &Dataset {
        &self.dataset
    }

    /// The tensors of one garment.
    ///
    /// # Errors
    /// When its operators cannot be read or its numbers are not finite.
    pub fn garment(
        &self,
        index: usize,
        garment: &PreparedGarment,
    ) -> Result<Arc<GarmentTensors>, DrapeError> {
        if let Some(tensors) = self.garments.get(index) {
            return Ok(tensors);
        }
        let operators = self.dataset.garments.operators(index)?;
        let tensors = garment_tensors(garment, &operators, &self.dimensions, &self.device)?;
        Ok(self.garments.insert(index, tensors, self.bytes(garment, operators.eigen_count)))
    }

    fn bytes(&self, garment: &PreparedGarment, eigen_count: usize) -> usize {
        tensor_bytes(garment.vertex_count(), eigen_count, self.dimensions.joints)
    }

    /// Makes the tensors of the scene's garments, so that a step on another thread finds them; not where those of the scenes
    /// before it would have to make room for them.
    ///
    /// # Errors
    /// As [`garment`](Self::garment).
    pub fn warm(&self, scene: &PreparedScene, eigen_count: usize) -> Result<(), DrapeError> {
        let bytes: usize = scene.garments.iter().map(|garment| self.bytes(garment, eigen_count)).sum();
        let KeptBytes { total, device } = self.memory.limits();
        if bytes.saturating_mul(SCENES_AHEAD + 2) > total.min(device) {
            return Ok(());
        }
        scene
            .sample
            .garments
            .iter()
            .zip(&scene.garments)
            .try_for_each(|(&g, garment)| self.garment(g, garment).map(|_| ()))
    }

    /// The outfit of a scene.
    ///
    /// # Errors
    /// When the scene has no garment, or one cannot be read.
    pub fn outfit(&self, scene: &PreparedScene) -> Result<OutfitTensors, DrapeError> {
        let garments =
            scene.sample.garments.iter().zip(&scene.garments).map(|(&g, garment)| self.garment(g, garment));
        let garments = garments.collect::<Result<Vec<_>, _>>()?;
        let garments = garments.iter().map(Arc::as_ref).collect::<Vec<_>>();
        Ok(OutfitTensors::new(&garments, &scene.contacts)?.with_thickness_below(&scene.thickness_below)?)
    }

    /// An empty store of embeddings for [`embed`](Self::embed), of one scene: all of them are kept for as long as it lives.
    pub fn embeddings(&self) -> KnownEmbeddings {
        LruCache::unlimited()
    }

    /// The same for any number of scenes, within the limits of memory.
    pub fn kept_embeddings(&self) -> KnownEmbeddings {
        LruCache::new(&self.memory, Residence::Device)
    }

    /// One body of a scene, and the start positions of the garments on it `[ΣV, 3]`.
    ///
    /// # Errors
    /// When its numbers are not finite.
    pub fn body(&self, body: &PreparedBody) -> Result<(BodyTensors, Tensor<2>), ModelError> {
        body_tensors(body, &self.dimensions, &self.device)
    }

    /// Embeds each distinct garment of `scene` once and packs them in its order, for a forward pass of `mode`. `known` keeps
    /// embeddings between calls; it must be emptied when the weights change.
    ///
    /// # Errors
    /// When outfit and embeddings disagree.
    pub fn embed(
        &self,
        model: &ClothCombo,
        scene: &PreparedScene,
        outfit: &OutfitTensors,
        known: &KnownEmbeddings,
        mode: Mode,
    ) -> Result<Embeddings, DrapeError> {
        Ok(model.pack(outfit, &self.encode(model, scene, known)?, mode)?)
    }

    /// The embeddings of the garments of `scene`, from `known` or made now and kept there.
    ///
    /// # Errors
    /// When a garment cannot be read.
    pub fn encode(
        &self,
        model: &ClothCombo,
        scene: &PreparedScene,
        known: &KnownEmbeddings,
    ) -> Result<Vec<GarmentEmbedding>, DrapeError> {
        let encoded = |(&g, garment): (&usize, &Arc<PreparedGarment>)| {
            let embedding = match known.get(g) {
                Some(kept) => kept,
                None => {
                    let embedding = model.encode(self.garment(g, garment)?.as_ref());
                    let bytes = embedding.bytes();
                    known.insert(g, embedding, bytes)
                }
            };
            Ok(embedding.as_ref().clone())
        };
        scene.sample.garments.iter().zip(&scene.garments).map(encoded).collect()
    }
}

/// The constant tensors of one garment.
///
/// # Errors
/// When its numbers are not finite.
pub fn garment_tensors(
    garment: &PreparedGarment,
    operators: &SurfaceOperators,
    dimensions: &Dimensions,
    device: &Device,
) -> Result<GarmentTensors, ModelError> {
    let rest: Vec<f32> = garment.garment.rest.positions().iter().flatten().map(|v| *v as f32).collect();
    let arrays = GarmentArrays {
        rest: &rest,
        mass: &operators.mass,
        eigenvalues: &operators.eigenvalues,
        eigenvectors: &operators.eigenvectors,
        gradient_x_basis: &operators.gradient_x_basis,
        gradient_y_basis: &operators.gradient_y_basis,
        skin_weights: &garment.skin_weights,
    };
    GarmentTensors::new(&arrays, dimensions.joints, device)
}

/// One body of a scene, and the start positions of the garments on it `[ΣV, 3]`.
///
/// # Errors
/// When its numbers are not finite.
pub fn body_tensors(
    body: &PreparedBody,
    dimensions: &Dimensions,
    device: &Device,
) -> Result<(BodyTensors, Tensor<2>), ModelError> {
    let tensors =
        BodyTensors::new(&body.shape, &body.pose, &body.bones, &body.joint_features, dimensions, device)?;
    Ok((tensors, to_device(&body.start, device)))
}
