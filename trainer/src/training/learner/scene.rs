//! Loss and gradients of one scene, and of several in parallel.

use super::step::{StepInput, StepOutput, StepTimes, norm_of};
use crate::config::{ClipScope, Trains};
use crate::dataset::PreparedScene;
use crate::inference::tensor_store::DrapeError;
use crate::system::workers::Workers;
use burn::module::Module;
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use clothcombo_model::{ClothCombo, DrapeState, GarmentEmbedding, clip_global_norm};
use clothcombo_physics::autodiff::{SceneLossOutput, scene_loss};
use clothcombo_physics::energy::SceneEnergy;
use std::sync::Arc;
use std::time::Instant;
use tracing::trace_span;

/// One scene of a step, with the embeddings of its garments where frozen networks made them.
type Job<'a> = (&'a PreparedScene, Option<Vec<GarmentEmbedding>>);

/// What the scenes of a step have in common.
#[derive(Clone, Copy)]
pub(super) struct SceneStep<'a> {
    pub input: &'a StepInput<'a>,
    pub clip: ClipScope,
    /// Largest norm of a clipped gradient; `None`: any.
    pub max_norm: Option<f64>,
    pub frozen: Option<&'a ClothCombo>,
}

/// Losses of a scene.
#[derive(Default)]
struct Losses {
    /// Weighted losses whose sum is minimised.
    terms: Vec<Tensor<1>>,
    /// Their sum on the host.
    sum: f64,
    /// Energies per body.
    bodies: Vec<SceneLossOutput>,
}

impl Losses {
    fn add(&mut self, state: &DrapeState, energy: &Arc<SceneEnergy<f32>>, weight: f64) -> SceneLossOutput {
        let _span = trace_span!("energies").entered();
        let output = scene_loss(state.posed.clone(), state.canonical.clone(), energy.clone());
        self.terms.push(output.loss.clone() * weight);
        self.sum += output.value().total * weight;
        output
    }
}

impl SceneStep<'_> {
    /// Every scene on its share of the threads, as few operations of a scene are large enough for all of them.
    ///
    /// burn keeps all operations on the same parameters in one graph under one lock, so that each scene gets a copy of the
    /// networks whose parameters are leaves of their own; their values are shared.
    pub fn compute_in_parallel(
        &self,
        model: &ClothCombo,
        jobs: &[Job<'_>],
        workers: &mut Workers,
    ) -> Result<Vec<StepOutput>, DrapeError> {
        let copies = jobs.iter().map(|job| (detached_copy(model), job)).collect();
        workers.map(copies, |(model, job)| self.compute(&model, job)).into_iter().collect()
    }

    /// Loss and gradients of a scene for the parameters of `model`.
    pub fn compute(&self, model: &ClothCombo, job: &Job<'_>) -> Result<StepOutput, DrapeError> {
        let share = 1.0 / self.input.total as f64;
        let start = Instant::now();
        let Losses { terms, sum, bodies } = self.losses(model, job)?;
        let forward = start.elapsed();
        let start = Instant::now();
        let mut gradients = GradientsParams::new();
        if let Some(mut loss) = terms.into_iter().reduce(|a, b| a + b) {
            if self.clip == ClipScope::Step && share < 1.0 {
                loss = loss * share;
            }
            if self.input.spoil_gradient {
                loss = loss * f64::NAN;
            }
            let _span = trace_span!("backward").entered();
            gradients = GradientsParams::from_grads(loss.backward(), model);
        }
        let backward = start.elapsed();
        let start = Instant::now();
        let mut gradient_norm = 0.0;
        if self.clip == ClipScope::Scene && !gradients.is_empty() {
            let _span = trace_span!("clip").entered();
            gradient_norm = norm_of(clip_global_norm(model, &mut gradients, self.max_norm, share));
        }
        let times = StepTimes { forward, backward, update: start.elapsed() };
        let scenes = vec![bodies];
        Ok(StepOutput { loss: sum * share, scenes, gradients, gradient_norm, skipped: false, times })
    }

    /// The losses of a scene, mean over its bodies; no terms when nothing in it depends on what is trained.
    fn losses(&self, model: &ClothCombo, (scene, embedded): &Job<'_>) -> Result<Losses, DrapeError> {
        let StepInput { tensors, trains, .. } = *self.input;
        let networks = with_frozen(model, self.frozen, trains);
        let outfit = trace_span!("tensors").in_scope(|| tensors.outfit(scene))?;
        let mode = trains.mode();
        let embeddings = match embedded {
            Some(embedded) => networks.pack(&outfit, embedded, mode)?,
            None => tensors.embed(&networks, scene, &outfit, &tensors.embeddings(), mode)?,
        };
        let share = 1.0 / scene.bodies.len() as f64;
        let single_weight = if trains == Trains::All { scene.single_garments * share } else { 0.0 };
        let mut losses = Losses::default();
        for body in &scene.bodies {
            let (of_body, start) = trace_span!("tensors").in_scope(|| tensors.body(body))?;
            let states = networks.forward(&outfit, &embeddings, &of_body, start, mode);
            if single_weight > 0.0 {
                losses.add(&states.single, &Arc::new(scene.energy_of_singles(body)), single_weight);
            }
            let output = losses.add(states.last(), &body.energy, share);
            losses.bodies.push(output);
        }
        if trains == Trains::Untangling && !networks.untangling.acts_on(&outfit) {
            losses.terms.clear();
        }
        Ok(losses)
    }
}

/// The networks of a step: those that learn from `model`, those that the stage freezes from `frozen`.
fn with_frozen(model: &ClothCombo, frozen: Option<&ClothCombo>, trains: Trains) -> ClothCombo {
    let frozen = || frozen.expect("kept at the first step of a stage that freezes").clone();
    match trains {
        Trains::Single | Trains::All => model.clone(),
        Trains::Draping => ClothCombo { garment_encoder: frozen().garment_encoder, ..model.clone() },
        Trains::Untangling => ClothCombo { untangling: model.untangling.clone(), ..frozen() },
    }
}

/// The same parameters as leaves of another graph. Not `fork`: it notes a move between devices in the graph of the original,
/// and there the note stays for as long as a parameter does that is not trained.
fn detached_copy(model: &ClothCombo) -> ClothCombo {
    model.valid().train()
}
