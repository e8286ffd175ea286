//! A training run whose steps are measured.

use super::phases::{OTHER, PHASES, record_phases};
use crate::config::{ClipScope, Config, OptimizerConfig, Trains};
use crate::dataset::{Dataset, Plan, PreparedScene, prepare, sample_training};
use crate::evaluation::median_ms;
use crate::inference::draped::to_host;
use crate::inference::tensor_store::{DrapeError, TensorStore};
use crate::run::spread::Spread;
use crate::system::device::is_processor;
use crate::system::memory::Memory;
use crate::training::learner::{Learner, StepInput};
use crate::training::process_group::RankPartition;
use crate::training::scenes::prefetch;
use crate::training::schedule::Schedule;
use burn::module::Module;
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor, TensorData};
use clothcombo_model::{ClothCombo, DrapeState, Embeddings, OutfitTensors};
use clothcombo_physics::energy::{SceneEnergy, Term};
use miette::{IntoDiagnostic, Report, miette};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// A training run whose steps are measured.
pub struct BenchmarkRun {
    config: Arc<Config>,
    tensors: Arc<TensorStore>,
    learner: Learner,
    device: Device,
    /// Index of the stage.
    stage: usize,
    first_step: u64,
}

/// Where the time of training steps goes.
#[derive(Clone, Debug, Serialize)]
pub struct Profile {
    /// Steps that were measured.
    pub steps: usize,
    /// Median time of a step, with the wait for its scene (ms).
    pub step_ms: f64,
    /// Median time of every part (ms), in the order of [`PHASES`].
    pub phases_ms: Vec<(&'static str, f64)>,
    /// Median time to sample and prepare a scene (ms). In training another thread does this while a step computes.
    pub prepare_ms: f64,
}

/// Median times of the parts of one scene (ms), and memory.
#[derive(Clone, Debug, Serialize)]
pub struct Costs {
    /// All networks without gradients, embedding included.
    pub forward_ms: f64,
    /// All networks and their backward pass from a fixed gradient at the positions.
    pub forward_backward_ms: f64,
    /// A whole step: networks, losses, backward pass, clip, Adam.
    pub step_ms: f64,
    /// A step on several scenes (`accumulate`), in parallel where there are threads for it; absent if none was asked for.
    pub step_of_several_ms: Option<f64>,
    /// All losses with their gradient.
    pub losses_ms: f64,
    /// Draping an outfit whose embeddings are known, as for the next frame of a motion.
    pub drape_ms: f64,
    /// Value and gradient of each single loss, with its own neighbour searches.
    pub terms_ms: BTreeMap<&'static str, f64>,
    /// Largest resident memory of the process during whole steps (MiB); absent where the system does not report it.
    pub peak_mib: Option<f64>,
}

impl BenchmarkRun {
    /// A new run of stage `stage` of `config` on `device` (named without automatic differentiation).
    ///
    /// # Errors
    /// When there is no such stage or the networks cannot be made.
    pub fn new(config: Config, dataset: Arc<Dataset>, stage: usize, device: &Device) -> Result<Self, Report> {
        let boundaries = Schedule::new(&config).boundaries();
        let first_step = *boundaries.get(stage).ok_or_else(|| {
            miette!("the configuration has {} stages, there is no stage {stage}", boundaries.len())
        })?;
        let device = device.clone().autodiff();
        let dimensions = dataset.dimensions();
        let model = ClothCombo::new(&config.model, &dimensions, config.seed, &device).into_diagnostic()?;
        let learner = Learner::fresh(model, &config.optimizer);
        let tensors = Arc::new(TensorStore::new(dataset, dimensions, &device));
        Ok(Self { config: Arc::new(config), tensors, learner, device, stage, first_step })
    }

    /// The configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The data.
    pub fn dataset(&self) -> &Dataset {
        self.tensors.dataset()
    }

    /// The networks.
    pub fn model(&self) -> &ClothCombo {
        self.learner.model()
    }

    /// Takes the parameters of `other`, and a new optimiser.
    ///
    /// # Errors
    /// When the networks differ in size.
    pub fn copy_parameters(&mut self, other: &Self) -> Result<(), Report> {
        let model = self.model().clone().try_load_record(other.model().clone().into_record());
        self.learner = Learner::fresh(model.map_err(|error| miette!("{error}"))?, &self.config.optimizer);
        Ok(())
    }

    /// The scene of the stage's first step, or of `offset` steps later.
    ///
    /// # Errors
    /// When a garment cannot be read.
    pub fn scene(&self, offset: u64) -> Result<PreparedScene, Report> {
        let step = self.first_step + offset;
        let at = Schedule::new(&self.config).at(step);
        let plan = Plan { stage: &self.config.stages[at.stage], progress: at.stage_progress };
        let sample = sample_training(self.dataset(), self.config.seed, step, 0, plan);
        Ok(prepare(self.dataset(), &self.config.losses, sample, at.run_progress)?)
    }

    /// Which networks the stage trains.
    pub fn trains(&self) -> Trains {
        self.config.stages[self.stage].trains
    }

    /// Trains `steps` steps as a run does, scenes prepared ahead on another thread, after three to warm up.
    ///
    /// # Errors
    /// When the stage has too few steps, or a scene cannot be prepared.
    pub fn profile(&mut self, steps: usize) -> Result<Profile, Report> {
        const WARM_UP: usize = 3;
        let schedule = Schedule::new(&self.config);
        let left = self.config.stages[self.stage].steps;
        if left < (WARM_UP + steps) as u64 {
            return Err(miette!(
                help = "measure fewer steps with --steps",
                "the stage has {left} steps, {} are needed ({WARM_UP} to warm up)",
                WARM_UP + steps
            ));
        }
        let (tensors, config) = (self.tensors.clone(), self.config.clone());
        let scenes = prefetch(tensors, config, self.first_step, RankPartition::WHOLE).into_diagnostic()?;
        let mut parts: Vec<Vec<f64>> = vec![Vec::new(); PHASES.len()];
        let mut totals = Vec::new();
        for step in 0..WARM_UP + steps {
            let start = Instant::now();
            let step_scenes = scenes
                .next_item()
                .ok_or_else(|| miette!("the thread that prepares scenes ended early"))??;
            let wait = start.elapsed().as_secs_f64();
            let rate = schedule.at(self.first_step + step as u64).learning_rate;
            let trains = self.trains();
            let device = self.device.clone();
            // What fails in waiting fails again in the wait after the step, which returns the error.
            let wait_for_spans = move || drop(device.sync());
            let (outcome, mut times) = record_phases(wait_for_spans, || {
                let input = StepInput::whole(&self.tensors, &step_scenes, trains);
                self.learner.train_step(&input, rate).map(drop)
            });
            outcome?;
            self.settle()?;
            let total = start.elapsed().as_secs_f64();
            times.insert(PHASES[0], wait);
            // The parts of scenes computed in parallel add up to more than the step.
            times.insert(OTHER, (total - times.values().sum::<f64>()).max(0.0));
            if step >= WARM_UP {
                totals.push(1e3 * total);
                for (part, name) in parts.iter_mut().zip(PHASES) {
                    part.push(1e3 * times.get(name).copied().unwrap_or(0.0));
                }
            }
        }
        drop(scenes);
        let mut offset = 0;
        let prepare_ms = median_ms(0.2, || {
            offset += 1;
            self.scene(offset)
        })?;
        let phases_ms =
            PHASES.into_iter().zip(parts.into_iter().map(|part| Spread::of(part).median)).collect();
        Ok(Profile { steps, step_ms: Spread::of(totals).median, phases_ms, prepare_ms })
    }

    /// Positions of the scene's garments on its first body, posed and canonical, `[ΣV, 3]` each (m), on the device of `model`.
    fn drape(&self, model: &ClothCombo, scene: &PreparedScene) -> Result<[Tensor<2>; 2], DrapeError> {
        let outfit = self.tensors.outfit(scene)?;
        let known = self.tensors.embeddings();
        let embeddings = self.tensors.embed(model, scene, &outfit, &known, self.trains().mode())?;
        self.drape_embedded(model, scene, &outfit, &embeddings)
    }

    /// The part of [`drape`](Self::drape) that depends on the body.
    fn drape_embedded(
        &self,
        model: &ClothCombo,
        scene: &PreparedScene,
        outfit: &OutfitTensors,
        embeddings: &Embeddings,
    ) -> Result<[Tensor<2>; 2], DrapeError> {
        let (body, start) = self.tensors.body(&scene.bodies[0])?;
        let states = model.forward(outfit, embeddings, &body, start, self.trains().mode());
        let DrapeState { posed, canonical } = states.last().clone();
        Ok([posed, canonical])
    }

    /// The same without gradients, on the host.
    ///
    /// # Errors
    /// When the scene's tensors cannot be made.
    pub fn host_drape(&self, scene: &PreparedScene) -> Result<[Vec<[f32; 3]>; 2], DrapeError> {
        Ok(self.drape(&self.model().valid(), scene)?.map(to_host))
    }

    /// The loss of a training step on `scene`, and the gradient of every parameter before clipping, by name. It is empty for
    /// parameters that the stage does not train.
    ///
    /// # Errors
    /// When the scene's tensors cannot be made.
    pub fn loss_and_gradients(
        &self,
        scene: &PreparedScene,
    ) -> Result<(f64, Vec<(String, Vec<f32>)>), DrapeError> {
        // `ClipScope::Step` clips in the update, which is not made here.
        let unclipped = OptimizerConfig { clip: ClipScope::Step, ..self.config.optimizer.clone() };
        let mut learner = Learner::fresh(self.model().clone(), &unclipped);
        let input = StepInput::whole(&self.tensors, std::slice::from_ref(scene), self.trains());
        let computed = learner.forward_backward(&input)?;
        let mut named = NamedGradients { gradients: computed.gradients, path: Vec::new(), found: Vec::new() };
        self.model().visit(&mut named);
        Ok((computed.loss, named.found))
    }

    /// Waits until the device has computed everything: a GPU gets its work and computes later.
    fn settle(&self) -> Result<(), Report> {
        self.device.sync().map_err(|error| miette!("{error:?}"))
    }

    fn step_ms(&mut self, scenes: &[PreparedScene], seconds: f64) -> Result<f64, Report> {
        // The memory of a GPU takes a few steps to find its sizes.
        const WARM_UP: usize = 8;
        let trains = self.trains();
        let warm_up = if is_processor(&self.device) { 0 } else { WARM_UP };
        let mut step = || {
            self.learner.train_step(&StepInput::whole(&self.tensors, scenes, trains), 1e-4)?;
            self.settle()
        };
        (0..warm_up).try_for_each(|_| step())?;
        median_ms(seconds, step)
    }

    /// Measures the parts of one scene, each for about `seconds`, and a step on it `several` times over.
    ///
    /// # Errors
    /// When the scene cannot be prepared or its tensors cannot be made.
    pub fn costs(&mut self, seconds: f64, several: usize) -> Result<Costs, Report> {
        let scenes = [self.scene(0)?];
        let [scene] = &scenes;
        let reset = Memory::reset_peak();
        let step_ms = self.step_ms(&scenes, seconds)?;
        let peak_mib = Memory::now().filter(|_| reset).map(|memory| memory.peak as f64 / f64::from(1 << 20));
        let step_of_several_ms = match several {
            0 | 1 => None,
            _ => {
                let scenes = (0..several).map(|_| self.scene(0)).collect::<Result<Vec<_>, _>>()?;
                Some(self.step_ms(&scenes, seconds)?)
            }
        };

        let plain = self.model().valid();
        let read = |positions: [Tensor<2>; 2]| positions.map(Tensor::into_data);
        let forward_ms = median_ms(seconds, || self.drape(&plain, scene).map(read))?;
        let outfit = self.tensors.outfit(scene)?;
        let known = self.tensors.embeddings();
        let embeddings = self.tensors.embed(&plain, scene, &outfit, &known, self.trains().mode())?;
        let drape_ms =
            median_ms(seconds, || self.drape_embedded(&plain, scene, &outfit, &embeddings).map(read))?;

        let count = scene.bodies[0].start.len();
        let pull: Vec<f32> = (0..3 * count).map(|i| (i * 37 % 101) as f32 / 50.0 - 1.0).collect();
        let pull = Tensor::<2>::from_data(TensorData::new(pull, [count, 3]), &self.device.clone().inner());
        let forward_backward_ms = median_ms(seconds, || {
            let [posed, _] = self.drape(self.model(), scene)?;
            let gradients = (posed * pull.clone()).sum().backward();
            let gradients = GradientsParams::from_grads(gradients, self.model());
            self.settle()?;
            Ok::<_, Report>(gradients)
        })?;

        let [posed, canonical] = self.host_drape(scene)?;
        let energy = &scene.bodies[0].energy;
        let evaluate = |energy: &SceneEnergy<f32>| {
            median_ms(seconds / 4.0, || Ok::<_, Report>(energy.evaluate(&posed, &canonical)))
        };
        let losses_ms = evaluate(energy)?;
        let mut terms_ms = BTreeMap::new();
        for term in Term::ALL {
            if let Some(single) = energy.only(term) {
                terms_ms.insert(term.name(), evaluate(&single)?);
            }
        }
        Ok(Costs {
            forward_ms,
            forward_backward_ms,
            step_ms,
            step_of_several_ms,
            losses_ms,
            drape_ms,
            terms_ms,
            peak_mib,
        })
    }
}

struct NamedGradients {
    gradients: GradientsParams,
    path: Vec<String>,
    found: Vec<(String, Vec<f32>)>,
}

impl burn::module::ModuleVisitor for NamedGradients {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }
    fn visit_float<const D: usize>(&mut self, parameter: &burn::module::Param<Tensor<D>>) {
        let gradient = self.gradients.get::<D>(parameter.id);
        let values = gradient.and_then(|g| g.into_data().try_to_vec().ok()).unwrap_or_default();
        self.found.push((self.path.join("."), values));
    }
}
