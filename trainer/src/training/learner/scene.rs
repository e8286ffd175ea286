//! Loss and gradients of one scene, and of several beside each other.

use super::workers::Workers;
use crate::config::{ClipScope, Trains};
use crate::dataset::PreparedScene;
use crate::inference::contact_features::felt;
use crate::inference::draped::to_host;
use crate::inference::networks::{DrapeError, KnownEmbeddings, TensorStore};
use burn::module::Module;
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use clothcombo_model::{ClothCombo, Feel, GarmentEmbedding, LayeredDrape, clip_global_norm};
use clothcombo_physics::autodiff::{SceneLossOutput, scene_loss};
use std::ops::AddAssign;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tracing::trace_span;

/// Where the time of a step went; honest on backends that compute at once (the CPU ones). Of scenes that were computed
/// beside each other the slowest counts.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTimes {
    /// Networks and energies.
    pub forward: Duration,
    /// Gradients.
    pub backward: Duration,
    /// Clipping, Adam, the running average.
    pub update: Duration,
}

impl StepTimes {
    /// Those of the longest of several that ran beside each other.
    pub(super) fn longest(times: impl Iterator<Item = Self>) -> Self {
        times.max_by_key(|t| t.forward + t.backward + t.update).unwrap_or_default()
    }
}

impl AddAssign for StepTimes {
    fn add_assign(&mut self, other: Self) {
        self.forward += other.forward;
        self.backward += other.backward;
        self.update += other.update;
    }
}

/// The networks before a stage that freezes some, with the embeddings they made.
pub(super) struct Frozen {
    pub model: ClothCombo,
    pub embeddings: KnownEmbeddings,
    /// What the stage trains.
    pub while_training: Trains,
}

/// One scene of a step.
pub(super) struct Asked<'a> {
    pub scene: &'a PreparedScene,
    /// The networks that the stage freezes, and what they made of the garments, if it freezes any.
    pub frozen: Option<(&'a ClothCombo, Vec<GarmentEmbedding>)>,
}

/// What the scenes of a step have in common.
#[derive(Clone, Copy)]
pub(super) struct Work<'a> {
    pub tensors: &'a TensorStore,
    pub trains: Trains,
    /// Weight of a scene in the step's loss.
    pub share: f64,
    /// Whether the gradient of a scene is clipped here, before it becomes a share of the step's.
    pub clip: ClipScope,
    /// Largest norm of a clipped gradient; `None`: any.
    pub max_norm: Option<f64>,
    pub spoil_gradient: bool,
}

/// What one scene contributes to a step.
pub(super) struct SceneGradient {
    /// Its part of the weighted loss.
    pub loss: f64,
    /// Energies per body.
    pub bodies: Vec<SceneLossOutput>,
    /// Its part of the gradient; `None` when nothing in the scene depends on what is trained.
    pub gradients: Option<GradientsParams>,
    /// Norm of the scene's gradient before clipping, where it is clipped; else 0.
    pub norm: f64,
    pub times: StepTimes,
}

/// Losses of a scene.
struct Losses {
    /// Mean over the bodies, those of garments draped alone included; `None` when nothing in it depends on what is trained.
    loss: Option<Tensor<1>>,
    /// The same on the host, always.
    mean: f64,
    /// Energies per body.
    bodies: Vec<SceneLossOutput>,
}

impl Work<'_> {
    /// Every scene on its share of the threads, as few operations of a scene are large enough for all of them.
    ///
    /// burn keeps all operations on the same parameters in one graph under one lock, so that each scene gets a copy of the
    /// networks whose parameters are leaves of their own; their values are shared.
    pub fn compute_beside(
        &self,
        model: &ClothCombo,
        scenes: &[Asked<'_>],
        workers: &mut Workers,
    ) -> Result<Vec<SceneGradient>, DrapeError> {
        let copies = scenes.iter().map(|asked| (detached_copy(model), asked)).collect();
        workers.map(copies, |(model, asked)| self.compute(&model, asked)).into_iter().collect()
    }

    /// Loss and gradients of a scene for the parameters of `model`.
    pub fn compute(&self, model: &ClothCombo, asked: &Asked<'_>) -> Result<SceneGradient, DrapeError> {
        let start = Instant::now();
        let Losses { loss, mean, bodies } = self.forward(model, asked)?;
        let forward = start.elapsed();
        let start = Instant::now();
        let mut gradients = loss.map(|mut loss| {
            if self.clip == ClipScope::Step && self.share < 1.0 {
                loss = loss * self.share;
            }
            if self.spoil_gradient {
                loss = loss * f64::NAN;
            }
            trace_span!("backward").in_scope(|| GradientsParams::from_grads(loss.backward(), model))
        });
        let backward = start.elapsed();
        let start = Instant::now();
        let norm = match (&mut gradients, self.clip) {
            (Some(gradients), ClipScope::Scene) => trace_span!("clip")
                .in_scope(|| norm_of(clip_global_norm(model, gradients, self.max_norm, self.share))),
            _ => 0.0,
        };
        let times = StepTimes { forward, backward, update: start.elapsed() };
        Ok(SceneGradient { loss: mean * self.share, bodies, gradients, norm, times })
    }

    fn forward(&self, model: &ClothCombo, asked: &Asked<'_>) -> Result<Losses, DrapeError> {
        let scene = asked.scene;
        let outfit = trace_span!("tensors").in_scope(|| self.tensors.outfit(scene))?;
        let (first_stage, embeddings) = match &asked.frozen {
            Some((frozen, known)) => (*frozen, frozen.pack(&outfit, known)?),
            None => (model, self.tensors.embed(model, scene, &outfit, &self.tensors.embeddings())?),
        };
        // What untangles: the networks themselves, or as they were before, while only corrections learn.
        let untangler = if self.trains == Trains::Corrections { first_stage } else { model };
        let embeddings = match self.trains {
            Trains::Single => embeddings,
            Trains::Untangling | Trains::All | Trains::Corrections => {
                untangler.prepare_untangling(&outfit, embeddings)
            }
        };
        let loss_at = |posed, canonical, energy| {
            trace_span!("energies").in_scope(|| scene_loss(posed, canonical, energy))
        };
        let alone = if self.trains == Trains::All { scene.alone } else { 0.0 };
        let share = 1.0 / scene.bodies.len() as f64;
        let (mut bodies, mut losses, mut mean) = (Vec::with_capacity(scene.bodies.len()), Vec::new(), 0.0);
        let mut add = |output: &SceneLossOutput, weight: f64| {
            losses.push(output.loss.clone() * weight);
            mean += output.value().total * weight;
        };
        for prepared in &scene.bodies {
            let (body, start) = trace_span!("tensors").in_scope(|| self.tensors.body(prepared))?;
            let single = first_stage.drape_single(&outfit, &embeddings, &body, start.clone());
            if alone > 0.0 {
                let energy = Arc::new(prepared.energy.without_layers());
                add(&loss_at(single.posed.clone(), single.canonical.clone(), energy), alone * share);
            }
            let untangled = || untangler.untangle(&outfit, &embeddings, &single, &body);
            let states = match self.trains {
                Trains::Single => {
                    vec![LayeredDrape { posed: single.posed.clone(), canonical: single.canonical.clone() }]
                }
                Trains::Untangling | Trains::All => vec![untangled()],
                Trains::Corrections => {
                    let feel: Feel<'_> = &|posed| {
                        let device = posed.device();
                        trace_span!("contact features")
                            .in_scope(|| felt(scene, prepared, &scene.contacts, &to_host(posed), &device))
                    };
                    model.correct(&outfit, &embeddings, (start, &single), &untangled(), &body, feel)
                }
            };
            // Every correction learns from where it leads itself.
            let each = share / states.len() as f64;
            let mut last = None;
            for LayeredDrape { posed, canonical } in states {
                let output = loss_at(posed, canonical, prepared.energy.clone());
                add(&output, each);
                last = Some(output);
            }
            bodies.extend(last);
        }
        let depends = self.trains != Trains::Untangling || untangler.untangling.acts_on(&outfit);
        let loss = losses.into_iter().reduce(|a, b| a + b).filter(|_| depends);
        Ok(Losses { loss, mean, bodies })
    }
}

/// A gradient norm on the host; 0 of no gradient.
pub(super) fn norm_of(norm: Option<Tensor<1>>) -> f64 {
    norm.map_or(0.0, |norm| f64::from(norm.into_scalar::<f32>()))
}

/// The larger of two norms; NaN if either is, which `f64::max` would drop.
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// The same parameters as leaves of another graph. Not `fork`: it notes a move between devices in the graph of the original,
/// and there the note stays for as long as a parameter does that is not trained.
fn detached_copy(model: &ClothCombo) -> ClothCombo {
    model.valid().train()
}
