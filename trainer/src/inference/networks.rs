//! The networks at inference: a prepared scene in, positions on the host out.

use super::acceptance::{accepted, skinned};
use super::draped::Draped;
use super::on_body::OnBody;
use super::tensor_store::{DrapeError, KnownEmbeddings, TensorStore};
use crate::dataset::PreparedScene;
use clothcombo_model::{ClothCombo, DrapeStates, Mode};
use std::time::{Duration, Instant};

/// The networks ready for inference; garments are embedded once.
pub struct Networks<'a> {
    model: ClothCombo,
    tensors: &'a TensorStore,
    embeddings: KnownEmbeddings,
}

impl<'a> Networks<'a> {
    /// Wraps a model without automatic differentiation.
    pub fn new(model: ClothCombo, tensors: &'a TensorStore) -> Self {
        Self { model, tensors, embeddings: tensors.kept_embeddings() }
    }

    /// Drapes the garments of `scene` together on its first body.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn drape(&self, scene: &PreparedScene) -> Result<Draped, DrapeError> {
        self.on_first_body(scene, Mode::Layered, |on_body| drape_on(&self.model, on_body, Mode::Layered).0)
    }

    /// What the forward pass alone makes of `scene`, taken as it is.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn forward(&self, scene: &PreparedScene, mode: Mode) -> Result<Draped, DrapeError> {
        self.on_first_body(scene, mode, |on_body| forward_on(&self.model, on_body, mode).1)
    }

    /// Drapes every garment of `scene` as a single garment.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn drape_single_garments(&self, scene: &PreparedScene) -> Result<Draped, DrapeError> {
        self.on_first_body(scene, Mode::Single, |on_body| drape_on(&self.model, on_body, Mode::Single).0)
    }

    fn on_first_body<T>(
        &self,
        scene: &PreparedScene,
        mode: Mode,
        drape: impl Fn(&OnBody<'_>) -> T,
    ) -> Result<T, DrapeError> {
        let mut outfit = self.tensors.outfit(scene)?;
        if mode == Mode::Single {
            // Each as if there were no other.
            outfit = outfit.with_thickness_below(&scene.thickness_of_unseen())?;
        }
        let embeddings = self.tensors.embed(&self.model, scene, &outfit, &self.embeddings, mode)?;
        let (body, start) = self.tensors.body(&scene.bodies[0])?;
        Ok(drape(&OnBody { scene, outfit: &outfit, embeddings: &embeddings, body: &body, start }))
    }

    /// Linear blend skinning of the start state, which has learned nothing.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn skin(&self, scene: &PreparedScene) -> Result<Draped, DrapeError> {
        let weights = self.tensors.outfit(scene)?.skin_weights;
        let (body, start) = self.tensors.body(&scene.bodies[0])?;
        Ok(skinned(start, weights, &body))
    }

    /// Linear blend skinning of the rest garments, whatever the body's shape: the paper's baseline.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn skin_rest(&self, scene: &PreparedScene) -> Result<Draped, DrapeError> {
        let outfit = self.tensors.outfit(scene)?;
        let (body, _) = self.tensors.body(&scene.bodies[0])?;
        Ok(skinned(outfit.rest, outfit.skin_weights, &body))
    }
}

/// Time of every phase of the networks, until its positions are on the host.
#[derive(Clone, Copy, Debug, Default)]
pub struct NetworkTimes {
    /// The forward pass.
    pub forward: Duration,
    /// Judging its result beside skinning.
    pub acceptance: Duration,
}

/// The forward pass of `model` on an outfit, all its garments together or each as a single garment, and its last state.
pub fn forward_on(model: &ClothCombo, on_body: &OnBody<'_>, mode: Mode) -> (DrapeStates, Draped) {
    let OnBody { outfit, embeddings, body, start, .. } = on_body;
    let states = model.forward(outfit, embeddings, body, start.clone(), mode);
    let last = Draped::of(states.last());
    (states, last)
}

/// Lets `model` drape an outfit; the result is judged beside skinning.
pub fn drape_on(model: &ClothCombo, on_body: &OnBody<'_>, mode: Mode) -> (Draped, NetworkTimes) {
    let clock = Instant::now();
    // On the host before the clock is read: devices compute behind the caller's back.
    let (states, proposed) = forward_on(model, on_body, mode);
    let forward = clock.elapsed();
    let found = accepted(on_body, &proposed, &states.skin_weights, mode);
    (found, NetworkTimes { forward, acceptance: clock.elapsed() - forward })
}
