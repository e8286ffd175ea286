//! Networks and optimiser: one step on prepared scenes.

mod scene;
mod workers;

use crate::config::{ClipScope, OptimizerConfig, Trains};
use crate::dataset::PreparedScene;
use crate::inference::networks::{DrapeError, TensorStore};
use crate::system::device::is_processor;
use burn::module::Module;
use burn::optim::{GradientsAccumulator, GradientsParams, ModuleOptimizer};
use clothcombo_model::{ClothCombo, FusedAdam, clip_global_norm};
use clothcombo_physics::autodiff::SceneLossOutput;
use scene::{Asked, Frozen, Work, norm_of};
use std::time::Instant;
use tracing::trace_span;
use workers::Workers;

pub use scene::StepTimes;
pub(crate) use scene::larger;

/// Trains the networks.
pub struct Learner {
    model: ClothCombo,
    optimizer: ModuleOptimizer,
    clip: ClipScope,
    max_norm: Option<f64>,
    frozen: Option<Frozen>,
    /// Scenes computed beside each other.
    at_once: usize,
    workers: Workers,
}

/// Loss and gradients of scenes, before the update.
pub struct Computed {
    /// Their part of the weighted loss.
    pub loss: f64,
    /// Energies per scene and body.
    pub scenes: Vec<Vec<SceneLossOutput>>,
    /// Their part of the gradient, clipped already where every scene is ([`ClipScope::Scene`]); empty when nothing in the
    /// scenes depends on what is trained.
    pub gradients: GradientsParams,
    /// Largest gradient norm of a scene before clipping, where every scene is clipped; else 0. Not finite if that of any
    /// scene is not.
    pub largest_norm: f64,
    /// Where the time went.
    pub times: StepTimes,
}

/// What a step found.
pub struct StepOutcome {
    /// Weighted loss, mean over the bodies of a scene, mean over the scenes.
    pub loss: f64,
    /// Energies per scene and body.
    pub scenes: Vec<Vec<SceneLossOutput>>,
    /// Global gradient norm before clipping: the largest of the scenes' where every scene is clipped, else that of their mean;
    /// 0 when nothing in the scenes depends on what is trained.
    pub gradient_norm: f64,
    /// Whether the parameters were left alone because loss or gradient was not finite.
    pub skipped: bool,
    /// Where the time went.
    pub times: StepTimes,
}

/// The optimiser of a run without any state yet.
pub fn new_optimizer(config: &OptimizerConfig) -> ModuleOptimizer {
    FusedAdam { beta_1: config.beta_1, beta_2: config.beta_2, epsilon: config.epsilon }.into()
}

impl Learner {
    /// Trains `model` (on a device with automatic differentiation) with `optimizer`.
    pub fn new(model: ClothCombo, optimizer: ModuleOptimizer, config: &OptimizerConfig) -> Self {
        // A GPU computes one scene after the other anyway.
        let at_once = if model.devices().iter().all(is_processor) { rayon::current_num_threads() } else { 1 };
        Self {
            model,
            optimizer,
            clip: config.clip,
            max_norm: config.max_norm(),
            frozen: None,
            at_once,
            workers: Workers::default(),
        }
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
        tensors: &TensorStore,
        scenes: &[PreparedScene],
        trains: Trains,
        learning_rate: f64,
        spoil_gradient: bool,
    ) -> Result<StepOutcome, DrapeError> {
        let computed = self.compute(tensors, scenes, scenes.len(), trains, spoil_gradient)?;
        Ok(self.update(computed, trains, learning_rate))
    }

    /// Loss and gradients of `scenes`, which are some of the `total` scenes of a step. On a processor as many of them are
    /// computed beside each other as there are threads.
    ///
    /// # Errors
    /// When a scene's tensors cannot be made.
    pub fn compute(
        &mut self,
        tensors: &TensorStore,
        scenes: &[PreparedScene],
        total: usize,
        trains: Trains,
        spoil_gradient: bool,
    ) -> Result<Computed, DrapeError> {
        self.frozen = self.frozen.take().filter(|frozen| frozen.while_training == trains);
        if trains.freezes() && self.frozen.is_none() {
            self.frozen = Some(Frozen {
                model: self.model.valid(),
                embeddings: tensors.kept_embeddings(),
                while_training: trains,
            });
        }
        let frozen = |scene| match &self.frozen {
            // Here, with all threads, whatever scene meets a garment first: else the last bits would depend on the order.
            Some(Frozen { model, embeddings, .. }) => {
                tensors.encode(model, scene, embeddings).map(|embeddings| Some((model, embeddings)))
            }
            None => Ok(None),
        };
        let asked = scenes.iter().map(|scene| Ok(Asked { scene, frozen: frozen(scene)? }));
        let asked: Vec<Asked<'_>> = asked.collect::<Result<_, DrapeError>>()?;
        let (clip, max_norm) = (self.clip, self.max_norm);
        let work = Work { tensors, trains, share: 1.0 / total as f64, clip, max_norm, spoil_gradient };
        let mut computed = Computed {
            loss: 0.0,
            scenes: Vec::with_capacity(scenes.len()),
            gradients: GradientsParams::new(),
            largest_norm: 0.0,
            times: StepTimes::default(),
        };
        let mut sum = GradientsAccumulator::<ClothCombo>::new();
        for at_once in asked.chunks(self.at_once) {
            let parts = match at_once {
                [asked] => vec![work.compute(&self.model, asked)?],
                several => work.compute_beside(&self.model, several, &mut self.workers)?,
            };
            computed.times += StepTimes::longest(parts.iter().map(|part| part.times));
            for part in parts {
                computed.loss += part.loss;
                computed.largest_norm = larger(computed.largest_norm, part.norm);
                computed.scenes.push(part.bodies);
                match part.gradients {
                    None => {}
                    Some(gradients) if scenes.len() == 1 => computed.gradients = gradients,
                    Some(gradients) => sum.accumulate(&self.model, gradients),
                }
            }
        }
        if scenes.len() > 1 {
            computed.gradients = sum.grads();
        }
        Ok(computed)
    }

    /// The optimiser step on gradients of the whole step.
    pub fn update(&mut self, computed: Computed, trains: Trains, learning_rate: f64) -> StepOutcome {
        let Computed { loss, scenes, mut gradients, largest_norm, times } = computed;
        let mut outcome = StepOutcome { loss, scenes, gradient_norm: 0.0, skipped: !loss.is_finite(), times };
        if gradients.is_empty() {
            return outcome;
        }
        let start = Instant::now();
        outcome.gradient_norm = match self.clip {
            ClipScope::Scene => largest_norm,
            ClipScope::Step => trace_span!("clip")
                .in_scope(|| norm_of(clip_global_norm(&self.model, &mut gradients, self.max_norm, 1.0))),
        };
        outcome.skipped = !(outcome.loss.is_finite() && outcome.gradient_norm.is_finite());
        if !outcome.skipped {
            let _span = trace_span!("optimiser").entered();
            let model = self.optimizer.step(learning_rate, self.model.clone(), gradients);
            self.model = if trains.freezes() { model } else { model.clamp_diffusion_times() };
        }
        outcome.times.update += start.elapsed();
        outcome
    }
}
