//! A run in progress: everything the training loop acts on.

use crate::checkpoint::{Checkpoint, CheckpointState};
use crate::config::Config;
use crate::drape::{Networks, WardrobeTensors};
use crate::evaluate::{ValidationReport, ValidationSet};
use crate::event::StepRecord;
use crate::learner::{Learner, StepOutcome, new_optimizer};
use crate::run_dir::RunDir;
use crate::samples;
use crate::scene::{Library, PreparedScene};
use crate::schedule::{Schedule, ScheduleAt};
use burn::module::Module;
use burn::tensor::Device;
use clothcombo_model::{ClothCombo, Dimensions};
use clothcombo_physics::energy::Term;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Consecutive steps without a finite gradient after which a run gives up.
const MAX_SKIPPED: u32 = 20;

/// A run in progress.
pub struct Session {
    run: RunDir,
    config: Arc<Config>,
    library: Arc<Library>,
    schedule: Schedule,
    tensors: Arc<WardrobeTensors>,
    validation: ValidationSet,
    learner: Learner,
    step: u64,
    skipped_in_a_row: u32,
}

impl Session {
    /// A new run on `device` (named without automatic differentiation).
    ///
    /// # Errors
    /// When the networks or tensors cannot be made.
    pub fn new(run: RunDir, config: Config, library: Arc<Library>, device: &Device) -> Result<Self, Report> {
        let device = device.clone().autodiff();
        device.seed(config.seed);
        let model = ClothCombo::new(&config.model, &dimensions(&library), &device).into_diagnostic()?;
        let learner = Learner::new(model, new_optimizer(&config.optimizer), &config.optimizer);
        Self::with_learner(run, config, library, &device, learner, 0)
    }

    /// The run in `run`, from its newest checkpoint on.
    ///
    /// # Errors
    /// When there is no usable checkpoint, or it was made with other data.
    pub fn resume(
        run: RunDir,
        config: Config,
        library: Arc<Library>,
        device: &Device,
    ) -> Result<Self, Report> {
        let device = device.clone().autodiff();
        let checkpoint = Checkpoint::open(run.root())?;
        let expected = state(&library, 0);
        let found = &checkpoint.state;
        if (&found.joints, found.shape_count, found.pose_features)
            != (&expected.joints, expected.shape_count, expected.pose_features)
        {
            return Err(miette!(
                help = "the body, garments or motions have changed since the run was started; restore them",
                "the data no longer fits checkpoint {}",
                checkpoint.path.display()
            ));
        }
        let model = checkpoint.model(&config, &device)?;
        let optimizer = checkpoint.optimizer(new_optimizer(&config.optimizer))?;
        let learner = Learner::new(model, optimizer, &config.optimizer);
        let step = checkpoint.state.step;
        Self::with_learner(run, config, library, &device, learner, step)
    }

    fn with_learner(
        run: RunDir,
        config: Config,
        library: Arc<Library>,
        device: &Device,
        learner: Learner,
        step: u64,
    ) -> Result<Self, Report> {
        let tensors = Arc::new(WardrobeTensors::new(library.clone(), dimensions(&library), device));
        let validation = ValidationSet::new(&library, &config);
        let schedule = Schedule::new(&config);
        let config = Arc::new(config);
        Ok(Self { run, config, library, schedule, tensors, validation, learner, step, skipped_in_a_row: 0 })
    }

    /// Steps done.
    pub fn step(&self) -> u64 {
        self.step
    }
    /// The schedule.
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }
    /// The configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }
    /// The configuration, shared.
    pub fn shared_config(&self) -> Arc<Config> {
        self.config.clone()
    }
    /// The wardrobe.
    pub fn library(&self) -> &Arc<Library> {
        &self.library
    }
    /// The constant tensors of the wardrobe.
    pub fn tensors(&self) -> &Arc<WardrobeTensors> {
        &self.tensors
    }
    /// One optimiser step on `scene`, started at `start` after waiting `waited` for it.
    ///
    /// # Errors
    /// When too many steps in a row had no finite gradient.
    pub fn step_on(
        &mut self,
        scene: &PreparedScene,
        at: &ScheduleAt,
        start: Instant,
        waited: Duration,
    ) -> Result<StepRecord, Report> {
        let stage = self.schedule.stages()[at.stage].clone();
        let outcome = self
            .learner
            .step(&self.tensors, scene, stage.trains, at.learning_rate)
            .map_err(Report::new)
            .wrap_err_with(|| format!("step {}", self.step + 1))?;
        self.step += 1;
        self.guard(&outcome)?;
        let (raw, weighted) = sums(scene, &outcome);
        Ok(StepRecord {
            step: self.step,
            stage: stage.name,
            layers: scene.garments.len(),
            pose_scale: at.pose_scale,
            loss: outcome.loss,
            raw,
            weighted,
            grad_norm: outcome.gradient_norm,
            lr: at.learning_rate,
            seconds: start.elapsed().as_secs_f64(),
            wait_seconds: waited.as_secs_f64(),
        })
    }

    fn guard(&mut self, outcome: &StepOutcome) -> Result<(), Report> {
        if !outcome.skipped {
            self.skipped_in_a_row = 0;
            return Ok(());
        }
        self.skipped_in_a_row += 1;
        tracing::warn!(step = self.step, loss = outcome.loss, "loss or gradient is not finite, step skipped");
        if self.skipped_in_a_row < MAX_SKIPPED {
            return Ok(());
        }
        Err(miette!(
            help = "continue from the last checkpoint with a lower learning rate",
            "loss or gradient was not finite in {MAX_SKIPPED} steps in a row, the last one step {}",
            self.step
        ))
    }

    /// Scores the fixed validation scenes.
    ///
    /// # Errors
    /// When a scene cannot be draped.
    pub fn validate(&self) -> Result<ValidationReport, Report> {
        Ok(self.validation.score(&self.library, &self.networks())?)
    }

    /// Draws the sample picture of the current step and returns its path.
    ///
    /// # Errors
    /// When it cannot be drawn or written.
    pub fn draw_sample(&self) -> Result<PathBuf, Report> {
        let path = self.run.sample(self.step);
        let count = self.config.output.sample_scenes;
        samples::draw(&self.library, &self.validation, &self.networks(), count, &path)?;
        Ok(path)
    }

    /// Saves a checkpoint and returns its folder.
    ///
    /// # Errors
    /// When it cannot be written; earlier checkpoints are untouched.
    pub fn save(&self) -> Result<PathBuf, Report> {
        let checkpoint = Checkpoint::save(
            &self.run,
            &self.config,
            state(&self.library, self.step),
            self.learner.model(),
            self.learner.optimizer(),
            self.config.output.keep_checkpoints,
        )?;
        Ok(checkpoint.path)
    }

    fn networks(&self) -> Networks<'_> {
        Networks::new(self.learner.model().valid(), &self.tensors)
    }
}

fn dimensions(library: &Library) -> Dimensions {
    state(library, 0).dimensions()
}

/// What a checkpoint of networks for `library` says about itself at `step`.
pub(crate) fn state(library: &Library, step: u64) -> CheckpointState {
    let joints: Vec<String> =
        library.joints().indices.iter().map(|&j| library.body.joint_names[j].clone()).collect();
    let pose_features = joints.len() * library.poses.features_per_joint();
    CheckpointState::new(step, joints, library.shape_count, pose_features)
}

/// Raw and weighted energies, summed over garments and pairs, mean over bodies.
fn sums(
    scene: &PreparedScene,
    outcome: &StepOutcome,
) -> (BTreeMap<&'static str, f64>, BTreeMap<&'static str, f64>) {
    let (mut raw, mut weighted) = (BTreeMap::new(), BTreeMap::new());
    let share = 1.0 / scene.bodies.len() as f64;
    for (body, value) in scene.bodies.iter().zip(outcome.scenes.iter().map(|s| s.value())) {
        let energy = &body.energy;
        let weights =
            energy.garments.iter().map(|g| &g.weights).chain(energy.layers.iter().map(|l| &l.weights));
        for (values, weights) in value.garments.iter().chain(&value.layers).zip(weights) {
            for term in Term::ALL {
                if let Some(v) = values[term] {
                    *raw.entry(term.name()).or_insert(0.0) += v * share;
                    *weighted.entry(term.name()).or_insert(0.0) += v * weights[term] * share;
                }
            }
        }
    }
    (raw, weighted)
}
