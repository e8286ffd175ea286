//! Networks and optimiser: forward, backward, clip, step.

mod scene;
mod step;

pub use step::{StepInput, StepOutput, larger};

use crate::config::{ClipScope, OptimizerConfig, Trains};
use crate::dataset::PreparedScene;
use crate::inference::tensor_store::{DrapeError, KnownEmbeddings, TensorStore};
use crate::system::device::{is_processor, scenes_at_once};
use crate::system::workers::{Workers, among_workers};
use burn::module::Module;
use burn::optim::{GradientsAccumulator, ModuleOptimizer};
use clothcombo_model::{ClothCombo, FusedAdam, GarmentEmbedding, clip_global_norm};
use scene::SceneStep;
use std::time::Instant;
use step::{StepTimes, norm_of};
use tracing::trace_span;

/// Trains the networks.
pub struct Learner {
    model: ClothCombo,
    optimizer: ModuleOptimizer,
    clip: ClipScope,
    max_norm: Option<f64>,
    frozen: Option<Frozen>,
    /// Scenes computed in parallel.
    parallel_scenes: usize,
    workers: Workers,
}

/// The networks before a stage that freezes some, with the embeddings they made.
struct Frozen {
    model: ClothCombo,
    embeddings: KnownEmbeddings,
    /// What the stage trains.
    while_training: Trains,
}

/// The optimiser of a run without any state yet.
pub fn new_optimizer(config: &OptimizerConfig) -> ModuleOptimizer {
    FusedAdam { beta_1: config.beta_1, beta_2: config.beta_2, epsilon: config.epsilon }.into()
}

impl Learner {
    /// Trains `model` (on a device with automatic differentiation) with `optimizer`.
    pub fn new(model: ClothCombo, optimizer: ModuleOptimizer, config: &OptimizerConfig) -> Self {
        let parallel_scenes = scenes_at_once(model.devices().iter().all(is_processor));
        Self {
            model,
            optimizer,
            clip: config.clip,
            max_norm: config.max_norm(),
            frozen: None,
            parallel_scenes,
            workers: Workers::default(),
        }
    }

    /// The same with an optimiser that has taken no step.
    pub fn fresh(model: ClothCombo, config: &OptimizerConfig) -> Self {
        Self::new(model, new_optimizer(config), config)
    }

    /// The networks.
    pub fn model(&self) -> &ClothCombo {
        &self.model
    }

    /// The optimiser.
    pub fn optimizer(&self) -> &ModuleOptimizer {
        &self.optimizer
    }

    /// A whole step of one process: forward, backward, clip, optimiser step.
    ///
    /// # Errors
    /// When a scene's tensors cannot be made.
    pub fn train_step(
        &mut self,
        input: &StepInput<'_>,
        learning_rate: f64,
    ) -> Result<StepOutput, DrapeError> {
        let mut output = self.forward_backward(input)?;
        self.clip(&mut output);
        self.step(&mut output, input.trains, learning_rate);
        Ok(output)
    }

    /// Loss and gradients, of [several scenes at once](scenes_at_once).
    ///
    /// # Errors
    /// When a scene's tensors cannot be made.
    pub fn forward_backward(&mut self, input: &StepInput<'_>) -> Result<StepOutput, DrapeError> {
        self.freeze(input);
        let frozen = self.frozen.as_ref().map(|f| &f.model);
        let step = SceneStep { input, clip: self.clip, max_norm: self.max_norm, frozen };
        let jobs =
            input.scenes.iter().map(|scene| Ok((scene, self.frozen_embeddings(input.tensors, scene)?)));
        let jobs = jobs.collect::<Result<Vec<_>, DrapeError>>()?;
        let mut output = StepOutput::default();
        let mut sum = GradientsAccumulator::<ClothCombo>::new();
        for parallel in jobs.chunks(self.parallel_scenes) {
            let parts = match parallel {
                [job] => vec![among_workers(|| step.compute(&self.model, job))?],
                several => step.compute_in_parallel(&self.model, several, &mut self.workers)?,
            };
            output.times +=
                parts.iter().map(|part| part.times).max_by_key(StepTimes::total).unwrap_or_default();
            for part in parts {
                output.loss += part.loss;
                output.gradient_norm = larger(output.gradient_norm, part.gradient_norm);
                output.scenes.extend(part.scenes);
                if input.scenes.len() == 1 {
                    output.gradients = part.gradients;
                } else if !part.gradients.is_empty() {
                    sum.accumulate(&self.model, part.gradients);
                }
            }
        }
        if input.scenes.len() > 1 {
            output.gradients = sum.grads();
        }
        Ok(output)
    }

    /// Scales the gradient of the whole step down to the largest norm allowed, where that is not done scene by scene.
    pub fn clip(&self, output: &mut StepOutput) {
        let start = Instant::now();
        if self.clip == ClipScope::Step {
            let _span = trace_span!("clip").entered();
            let gradients = &mut output.gradients;
            output.gradient_norm =
                among_workers(|| norm_of(clip_global_norm(&self.model, gradients, self.max_norm, 1.0)));
        }
        output.times.update += start.elapsed();
    }

    /// Moves the parameters, unless loss or gradient is not finite.
    pub fn step(&mut self, output: &mut StepOutput, trains: Trains, learning_rate: f64) {
        let start = Instant::now();
        output.skipped = !(output.loss.is_finite() && output.gradient_norm.is_finite());
        if !output.skipped && !output.gradients.is_empty() {
            let _span = trace_span!("optimiser").entered();
            let gradients = std::mem::take(&mut output.gradients);
            let model = self.model.clone();
            let model = among_workers(|| self.optimizer.step(learning_rate, model, gradients));
            self.model = if trains.freezes() { model } else { model.clamp_diffusion_times() };
        }
        output.times.update += start.elapsed();
    }

    /// Keeps the networks that the stage freezes as they are at its first step.
    fn freeze(&mut self, input: &StepInput<'_>) {
        self.frozen = self.frozen.take().filter(|frozen| frozen.while_training == input.trains);
        if input.trains.freezes() && self.frozen.is_none() {
            self.frozen = Some(Frozen {
                model: self.model.valid(),
                embeddings: input.tensors.kept_embeddings(),
                while_training: input.trains,
            });
        }
    }

    /// What frozen networks make of the garments of `scene`. Here, with all threads, whatever scene meets a garment first: else
    /// the last bits would depend on the order.
    fn frozen_embeddings(
        &self,
        tensors: &TensorStore,
        scene: &PreparedScene,
    ) -> Result<Option<Vec<GarmentEmbedding>>, DrapeError> {
        let encode = |frozen: &Frozen| tensors.encode(&frozen.model, scene, &frozen.embeddings);
        self.frozen.as_ref().map(encode).transpose()
    }
}
