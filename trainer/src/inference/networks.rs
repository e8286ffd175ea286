//! The networks at inference: a prepared scene in, positions on the host out.

use super::draped::{Draped, draped, to_device};
use crate::dataset::{
    Dataset, DatasetError, PreparedBody, PreparedGarment, PreparedScene, SCENES_AHEAD, tensor_bytes,
};
use crate::inference::contact_features::LayerInteraction;
use crate::inference::correct::{corrected, skinned};
use crate::inference::descent::Descent;
use crate::system::device::is_processor;
use crate::system::lru_cache::{KeptBytes, LruCache, MemoryBudget, Residence};
use burn::tensor::{Device, Tensor};
use clothcombo_model::{
    BodyTensors, ClothCombo, Dimensions, Embeddings, GarmentArrays, GarmentEmbedding, GarmentTensors,
    ModelError, OutfitTensors,
};
use clothcombo_physics::operators::SurfaceOperators;
use miette::Diagnostic;
use std::sync::Arc;
use std::time::{Duration, Instant};
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

/// The constant tensors of a wardrobe on one device, made when a garment is first drawn.
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
        Ok(OutfitTensors::new(&garments.iter().map(Arc::as_ref).collect::<Vec<_>>(), &scene.contacts)?)
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

    /// Embeds each distinct garment of `scene` once and packs them in its order. `known` keeps embeddings between calls;
    /// it must be emptied when the weights change.
    ///
    /// # Errors
    /// When outfit and embeddings disagree.
    pub fn embed(
        &self,
        model: &ClothCombo,
        scene: &PreparedScene,
        outfit: &OutfitTensors,
        known: &KnownEmbeddings,
    ) -> Result<Embeddings, DrapeError> {
        Ok(model.pack(outfit, &self.encode(model, scene, known)?)?)
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
    let tensors = BodyTensors::new(&body.shape, &body.pose, &body.bones, dimensions, device)?;
    Ok((tensors, to_device(&body.start, device)))
}

/// The networks ready for inference; garments are embedded once.
pub struct Networks<'a> {
    model: ClothCombo,
    tensors: &'a TensorStore,
    embeddings: Arc<KnownEmbeddings>,
}

impl<'a> Networks<'a> {
    /// Wraps a model without automatic differentiation.
    pub fn new(model: ClothCombo, tensors: &'a TensorStore) -> Self {
        Self { model, tensors, embeddings: Arc::new(tensors.kept_embeddings()) }
    }

    /// The same without corrections.
    pub fn uncorrected(&self) -> Self {
        self.with_correction_steps(0)
    }

    /// The same with at most `steps` correction steps.
    pub fn with_correction_steps(&self, steps: usize) -> Self {
        let model = self.model.clone().with_correction_steps(steps);
        Self { model, tensors: self.tensors, embeddings: self.embeddings.clone() }
    }

    /// Drapes the garments of `scene` together on its first body.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn drape(&self, scene: &PreparedScene) -> Result<Draped, DrapeError> {
        self.ask(scene, |on_body| drape_on(&self.model, on_body).0)
    }

    /// Drapes every garment of `scene` as if it were worn alone.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn drape_alone(&self, scene: &PreparedScene) -> Result<Draped, DrapeError> {
        self.ask(scene, |on_body| drape_alone(&self.model, on_body))
    }

    fn ask<T>(&self, scene: &PreparedScene, answer: impl Fn(&OnBody<'_>) -> T) -> Result<T, DrapeError> {
        let outfit = self.tensors.outfit(scene)?;
        let embeddings = self.tensors.embed(&self.model, scene, &outfit, &self.embeddings)?;
        let (body, start) = self.tensors.body(&scene.bodies[0])?;
        Ok(answer(&OnBody { scene, outfit: &outfit, embeddings: &embeddings, body: &body, start }))
    }

    /// The energy of every garment of `scene`, with the pairs that it is part of, at the states that the correction steps take
    /// from skinning on [J].
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn energies(&self, scene: &PreparedScene) -> Result<Vec<Vec<f64>>, DrapeError> {
        self.ask(scene, |on_body| {
            let mut energies = Vec::new();
            drape_watched(&self.model, on_body, &mut |descent| energies.push(descent.energies().to_vec()));
            energies
        })
    }

    /// Linear blend skinning of the start state, which has learned nothing.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn skin(&self, scene: &PreparedScene) -> Result<Draped, DrapeError> {
        let (_, start) = self.tensors.body(&scene.bodies[0])?;
        self.skin_from(scene, start)
    }

    /// Linear blend skinning of the rest garments, whatever the body's shape: the paper's baseline.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn skin_rest(&self, scene: &PreparedScene) -> Result<Draped, DrapeError> {
        let rest = self.tensors.outfit(scene)?.rest;
        self.skin_from(scene, rest)
    }

    fn skin_from(&self, scene: &PreparedScene, start: Tensor<2>) -> Result<Draped, DrapeError> {
        let outfit = self.tensors.outfit(scene)?;
        let (body, _) = self.tensors.body(&scene.bodies[0])?;
        Ok(skinned(start, outfit.skin_weights, &body))
    }
}

/// An outfit with its embeddings on the first body of a scene.
pub struct OnBody<'a> {
    /// The scene.
    pub scene: &'a PreparedScene,
    /// Its garments.
    pub outfit: &'a OutfitTensors,
    /// Their embeddings.
    pub embeddings: &'a Embeddings,
    /// Its first body.
    pub body: &'a BodyTensors,
    /// Where the garments start on it `[ΣV, 3]` [m].
    pub start: Tensor<2>,
}

/// Time of every phase of the networks, until its positions are on the host.
#[derive(Clone, Copy, Debug, Default)]
pub struct NetworkTimes {
    /// Every garment by itself.
    pub draping: Duration,
    /// The garments against each other.
    pub untangling: Duration,
    /// The correction networks.
    pub correcting: Duration,
}

/// Lets `model` drape an outfit.
pub fn drape_on(model: &ClothCombo, on_body: &OnBody<'_>) -> (Draped, NetworkTimes) {
    drape_watched(model, on_body, &mut |_| ())
}

/// The same; `watch` sees every state that the correction steps accept.
fn drape_watched(
    model: &ClothCombo,
    on_body: &OnBody<'_>,
    watch: &mut dyn FnMut(&Descent<'_>),
) -> (Draped, NetworkTimes) {
    let OnBody { outfit, embeddings, body, start, .. } = on_body;
    let mut times = NetworkTimes::default();
    let clock = Instant::now();
    let single = model.drape_single(outfit, embeddings, body, start.clone());
    // On the host before the clock is read: devices compute behind the caller's back.
    let mut found = draped(&single.canonical, &single.posed);
    times.draping = clock.elapsed();
    let layered = model.untangle(outfit, embeddings, &single, body);
    if model.untangling.acts_on(outfit) {
        found = draped(&layered.canonical, &layered.posed);
    }
    times.untangling = clock.elapsed() - times.draping;
    found = corrected(model, on_body, &single, found, LayerInteraction::Together, watch);
    times.correcting = clock.elapsed() - times.draping - times.untangling;
    (found, times)
}

/// Lets `model` drape every garment of an outfit by itself, before untangling (whatever `model.graph`), and correct it alone.
pub fn drape_alone(model: &ClothCombo, on_body: &OnBody<'_>) -> Draped {
    let OnBody { outfit, embeddings, body, start, .. } = on_body;
    let single = model.drape_single(outfit, embeddings, body, start.clone());
    let found = draped(&single.canonical, &single.posed);
    corrected(model, on_body, &single, found, LayerInteraction::Alone, &mut |_| ())
}
