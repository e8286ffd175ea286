//! Networks and optimiser: one step on one prepared scene.

use crate::config::{OptimizerConfig, Trains};
use crate::drape::{DrapeError, WardrobeTensors};
use crate::scene::{PreparedScene, Recent};
use burn::module::Module;
use burn::optim::{GradientsParams, ModuleOptimizer};
use burn::tensor::Tensor;
use clothcombo_model::{ClothCombo, FusedAdam, GarmentEmbedding, clip_global_norm, global_norm};
use clothcombo_physics::autodiff::{SceneLossOutput, scene_loss};
use tracing::trace_span;

/// Trains the networks.
pub struct Learner {
    model: ClothCombo,
    optimizer: ModuleOptimizer,
    clip_norm: f64,
    frozen: Option<Frozen>,
}

/// The first stage while it is not trained, with the embeddings it made.
struct Frozen {
    model: ClothCombo,
    embeddings: Recent<GarmentEmbedding>,
}

/// What a step found.
pub struct StepOutcome {
    /// Weighted loss, mean over the scene's bodies.
    pub loss: f64,
    /// Energies per body.
    pub scenes: Vec<SceneLossOutput>,
    /// Global gradient norm before clipping; 0 when nothing in the scene depends on what is trained.
    pub gradient_norm: f64,
    /// Whether the parameters were left alone because loss or gradient was not finite.
    pub skipped: bool,
}

/// The optimiser of a run without any state yet.
pub fn new_optimizer(config: &OptimizerConfig) -> ModuleOptimizer {
    FusedAdam { beta_1: config.beta_1, beta_2: config.beta_2, epsilon: config.epsilon }.into()
}

impl Learner {
    /// Trains `model` (on a device with automatic differentiation) with `optimizer`.
    pub fn new(model: ClothCombo, optimizer: ModuleOptimizer, config: &OptimizerConfig) -> Self {
        Self { model, optimizer, clip_norm: config.clip_norm, frozen: None }
    }

    /// The networks.
    pub fn model(&self) -> &ClothCombo {
        &self.model
    }

    /// The optimiser.
    pub fn optimizer(&self) -> &ModuleOptimizer {
        &self.optimizer
    }

    /// One optimiser step on the bodies of `scene`.
    ///
    /// # Errors
    /// When the scene's tensors cannot be made.
    pub fn step(
        &mut self,
        tensors: &WardrobeTensors,
        scene: &PreparedScene,
        trains: Trains,
        learning_rate: f64,
    ) -> Result<StepOutcome, DrapeError> {
        let (loss, scenes) = self.forward(tensors, scene, trains)?;
        let mean = scenes.iter().map(|s| s.value().total).sum::<f64>() / scenes.len() as f64;
        let mut outcome = StepOutcome { loss: mean, scenes, gradient_norm: 0.0, skipped: false };
        let Some(loss) = loss else { return Ok(outcome) };

        let mut gradients =
            trace_span!("backward").in_scope(|| GradientsParams::from_grads(loss.backward(), &self.model));
        let clipping = trace_span!("clip").entered();
        let norm = match self.clip_norm > 0.0 {
            true => clip_global_norm(&self.model, &mut gradients, self.clip_norm),
            false => global_norm(&self.model, &gradients),
        };
        outcome.gradient_norm = norm.map_or(0.0, |n| n.into_scalar::<f32>() as f64);
        drop(clipping);
        outcome.skipped = !(outcome.loss.is_finite() && outcome.gradient_norm.is_finite());
        if !outcome.skipped {
            let _span = trace_span!("optimiser").entered();
            let model = self.optimizer.step(learning_rate, self.model.clone(), gradients);
            self.model = if trains == Trains::Untangling { model } else { model.clamp_diffusion_times() };
        }
        Ok(outcome)
    }

    /// Mean loss over the bodies, `None` when nothing in it depends on what is trained.
    fn forward(
        &mut self,
        tensors: &WardrobeTensors,
        scene: &PreparedScene,
        trains: Trains,
    ) -> Result<(Option<Tensor<1>>, Vec<SceneLossOutput>), DrapeError> {
        let outfit = trace_span!("tensors").in_scope(|| tensors.outfit(scene))?;
        if trains != Trains::Untangling {
            self.frozen = None;
        } else if self.frozen.is_none() {
            self.frozen = Some(Frozen { model: self.model.valid(), embeddings: tensors.embeddings() });
        }
        let (first_stage, embeddings) = match &mut self.frozen {
            Some(f) => (&f.model, tensors.embed(&f.model, scene, &outfit, &mut f.embeddings)?),
            None => (&self.model, tensors.embed(&self.model, scene, &outfit, &mut tensors.embeddings())?),
        };
        let embeddings = match trains {
            Trains::Single => embeddings,
            Trains::Untangling | Trains::All => self.model.prepare_untangling(&outfit, embeddings),
        };
        let mut scenes = Vec::with_capacity(scene.bodies.len());
        for prepared in &scene.bodies {
            let (body, start) = trace_span!("tensors").in_scope(|| tensors.body(prepared))?;
            let single = first_stage.drape_single(&outfit, &embeddings, &body, start);
            let (posed, canonical) = match trains {
                Trains::Single => (single.posed, single.canonical),
                Trains::Untangling | Trains::All => {
                    let layered = self.model.untangle(&outfit, &embeddings, &single, &body);
                    (layered.posed, layered.canonical)
                }
            };
            let energy = prepared.energy.clone();
            scenes.push(trace_span!("energies").in_scope(|| scene_loss(posed, canonical, energy)));
        }
        let depends = trains != Trains::Untangling || outfit.has_contacts();
        let sum = scenes.iter().map(|s| s.loss.clone()).reduce(|a, b| a + b);
        let loss = sum.filter(|_| depends).map(|l| l / scenes.len() as f64);
        Ok((loss, scenes))
    }
}
