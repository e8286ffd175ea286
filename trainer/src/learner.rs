//! Networks and optimiser: one step on one prepared scene.

use crate::config::{OptimizerConfig, Trains};
use crate::drape::{DrapeError, WardrobeTensors};
use crate::scene::{PreparedScene, Recent};
use burn::module::Module;
use burn::optim::{GradientsAccumulator, GradientsParams, ModuleOptimizer};
use burn::tensor::Tensor;
use clothcombo_model::{ClothCombo, FusedAdam, GarmentEmbedding, clip_global_norm, global_norm};
use clothcombo_physics::autodiff::{SceneLossOutput, scene_loss};
use std::time::{Duration, Instant};
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

/// Loss and gradients of scenes, before the update.
pub struct Computed {
    /// Their part of the weighted loss.
    pub loss: f64,
    /// Energies per scene and body.
    pub scenes: Vec<Vec<SceneLossOutput>>,
    /// Their part of the gradient; empty when nothing in the scenes depends on what is trained.
    pub gradients: GradientsParams,
    /// Where the time went.
    pub times: StepTimes,
}

/// What a step found.
pub struct StepOutcome {
    /// Weighted loss, mean over the bodies of a scene, mean over the scenes.
    pub loss: f64,
    /// Energies per scene and body.
    pub scenes: Vec<Vec<SceneLossOutput>>,
    /// Global gradient norm before clipping; 0 when nothing in the scenes depends on what is trained.
    pub gradient_norm: f64,
    /// Whether the parameters were left alone because loss or gradient was not finite.
    pub skipped: bool,
    /// Where the time went.
    pub times: StepTimes,
}

/// Where the time of a step went; honest on backends that compute at once (the CPU ones).
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTimes {
    /// Networks and energies.
    pub forward: Duration,
    /// Gradients.
    pub backward: Duration,
    /// Clipping, Adam, the running average.
    pub update: Duration,
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

    /// One optimiser step on the mean loss of `scenes`. `spoil_gradient` makes the gradient NaN, for tests of what happens
    /// then.
    ///
    /// # Errors
    /// When a scene's tensors cannot be made.
    pub fn step(
        &mut self,
        tensors: &WardrobeTensors,
        scenes: &[PreparedScene],
        trains: Trains,
        learning_rate: f64,
        spoil_gradient: bool,
    ) -> Result<StepOutcome, DrapeError> {
        let computed = self.compute(tensors, scenes, scenes.len(), trains, spoil_gradient)?;
        Ok(self.update(computed, trains, learning_rate))
    }

    /// Loss and gradients of `scenes`, which are some of the `total` scenes of a step.
    ///
    /// # Errors
    /// When a scene's tensors cannot be made.
    pub fn compute(
        &mut self,
        tensors: &WardrobeTensors,
        scenes: &[PreparedScene],
        total: usize,
        trains: Trains,
        spoil_gradient: bool,
    ) -> Result<Computed, DrapeError> {
        let mut computed = Computed {
            loss: 0.0,
            scenes: Vec::with_capacity(scenes.len()),
            gradients: GradientsParams::new(),
            times: StepTimes::default(),
        };
        let share = 1.0 / total as f64;
        let mut sum = GradientsAccumulator::<ClothCombo>::new();
        for scene in scenes {
            let start = Instant::now();
            let (loss, values) = self.forward(tensors, scene, trains)?;
            let mean = values.iter().map(|s| s.value().total).sum::<f64>() / values.len() as f64;
            computed.loss += mean * share;
            computed.scenes.push(values);
            computed.times.forward += start.elapsed();
            let Some(mut loss) = loss else { continue };
            if total > 1 {
                loss = loss * share;
            }
            if spoil_gradient {
                loss = loss * f64::NAN;
            }
            let start = Instant::now();
            let gradients = trace_span!("backward")
                .in_scope(|| GradientsParams::from_grads(loss.backward(), &self.model));
            match scenes.len() {
                1 => computed.gradients = gradients,
                _ => sum.accumulate(&self.model, gradients),
            }
            computed.times.backward += start.elapsed();
        }
        if scenes.len() > 1 {
            computed.gradients = sum.grads();
        }
        Ok(computed)
    }

    /// The optimiser step on gradients of the whole step.
    pub fn update(&mut self, computed: Computed, trains: Trains, learning_rate: f64) -> StepOutcome {
        let Computed { loss, scenes, mut gradients, times } = computed;
        let mut outcome = StepOutcome { loss, scenes, gradient_norm: 0.0, skipped: !loss.is_finite(), times };
        if gradients.is_empty() {
            return outcome;
        }
        let start = Instant::now();
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
        outcome.times.update = start.elapsed();
        outcome
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
