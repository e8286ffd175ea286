//! A run in progress: everything the training loop acts on.

use crate::average::Average;
use crate::checkpoint::{Best, Checkpoint, CheckpointState, Snapshot, TrainedModel};
use crate::config::{Config, Injected};
use crate::drape::{Networks, WardrobeTensors};
use crate::evaluate::{ValidationReport, ValidationSet};
use crate::event::StepRecord;
use crate::guard::{Guard, Verdict};
use crate::incident::{Circumstances, Incident, spoil_position};
use crate::learner::{Computed, Learner, StepOutcome, new_optimizer};
use crate::memory::{MemoryEstimate, estimate};
use crate::run_dir::{RunDir, differing_keys};
use crate::samples;
use crate::scene::{Library, PreparedScene, is_fingerprint, prepare_step};
use crate::schedule::{Schedule, ScheduleAt};
use crate::step_summary::StepSummary;
use crate::stop::StopFlag;
use crate::world::{Share, World, WorldError};
use burn::module::Module;
use burn::tensor::Device;
use clothcombo_model::{ClothCombo, Dimensions, gradient_bucket, gradients_of_bucket};
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A run in progress.
pub struct Session {
    run: RunDir,
    config: Arc<Config>,
    library: Arc<Library>,
    schedule: Schedule,
    tensors: Arc<WardrobeTensors>,
    validation: ValidationSet,
    learner: Learner,
    average: Option<Average>,
    guard: Guard,
    best: Option<Best>,
    step: u64,
    world: Rc<World>,
}

/// What one step left.
pub struct StepReport {
    /// Its line in the log.
    pub record: StepRecord,
    /// What the guard makes of it.
    pub verdict: Verdict,
    /// The scene as a file, if the step was skipped and is one of the first.
    pub incident: Option<PathBuf>,
    /// Whether this or another process was asked to stop.
    pub stopping: bool,
}

impl Session {
    /// A new run on `device` (named without automatic differentiation).
    ///
    /// # Errors
    /// When the networks cannot be made, or the model they start from does not fit.
    pub fn new(run: RunDir, config: Config, library: Arc<Library>, device: &Device) -> Result<Self, Report> {
        let device = device.clone().autodiff();
        let model = match &config.init_from {
            None => ClothCombo::new(&config.model, &dimensions(&library), config.seed, &device)
                .into_diagnostic()?,
            Some(path) => {
                let trained = TrainedModel::open(Path::new(path))?;
                if trained.config.seed == config.seed {
                    tracing::warn!(
                        "{path} was trained with seed {}, too: its scenes come again; set another seed (and \
                         validation.seed to this one, to score the same scenes)",
                        config.seed
                    );
                }
                trained.start_of(&config, &library, &device)?
            }
        };
        let average = (config.optimizer.ema_decay > 0.0)
            .then(|| Average::new(model.valid(), config.optimizer.ema_decay));
        let learner = Learner::new(model, new_optimizer(&config.optimizer), &config.optimizer);
        let start = state(&library, 0);
        Ok(Self::assemble(run, config, library, &device, learner, average, &start))
    }

    /// The run in `run`, from `checkpoint` on.
    ///
    /// # Errors
    /// When the checkpoint was made with other data or networks.
    pub fn resume(
        run: RunDir,
        config: Config,
        library: Arc<Library>,
        device: &Device,
        checkpoint: &Checkpoint,
    ) -> Result<Self, Report> {
        let device = device.clone().autodiff();
        let expected = state(&library, 0);
        let found = &checkpoint.state;
        let dimensions = |s: &CheckpointState| (s.joints.clone(), s.shape_count, s.pose_features);
        let same_data =
            found.data == expected.data || !found.data.as_ref().is_some_and(|d| is_fingerprint(d));
        if dimensions(found) != dimensions(&expected) || !same_data {
            return Err(miette!(
                help = "the body, garments or motions have changed since the run was started; restore them, or start a new run",
                "the data no longer fits checkpoint {}",
                checkpoint.path.display()
            ));
        }
        let model = checkpoint.trained_model(&config, &device)?;
        let average = match config.optimizer.ema_decay {
            decay if decay > 0.0 => {
                let kept = checkpoint.average(&config, &device)?;
                Some(Average::new(kept.unwrap_or_else(|| model.clone()).valid(), decay))
            }
            _ => None,
        };
        let optimizer = checkpoint.optimizer(new_optimizer(&config.optimizer))?;
        let learner = Learner::new(model, optimizer, &config.optimizer);
        // A score of other losses or scenes cannot be beaten by one of these.
        let scores = ["losses", "validation", "data", "seed"];
        let changed = differing_keys(&checkpoint.config()?, &config);
        let is_comparable = !changed.iter().any(|key| scores.iter().any(|part| key.starts_with(part)));
        let best = found.best.filter(|_| is_comparable);
        let found = CheckpointState { best, ..found.clone() };
        Ok(Self::assemble(run, config, library, &device, learner, average, &found))
    }

    fn assemble(
        run: RunDir,
        config: Config,
        library: Arc<Library>,
        device: &Device,
        learner: Learner,
        average: Option<Average>,
        state: &CheckpointState,
    ) -> Self {
        Self {
            tensors: Arc::new(WardrobeTensors::new(library.clone(), dimensions(&library), device)),
            validation: ValidationSet::new(&library, &config),
            schedule: Schedule::new(&config),
            guard: Guard::new(config.guard.clone(), &state.incidents),
            best: state.best,
            step: state.step,
            config: Arc::new(config),
            run,
            library,
            learner,
            average,
            world: Rc::default(),
        }
    }

    /// The same run as one of the processes in `world`.
    ///
    /// # Errors
    /// When they cannot share the scenes of every stage equally.
    pub fn shared_in(mut self, world: Rc<World>) -> Result<Self, WorldError> {
        let size = world.share().size;
        match self.schedule.stages().iter().find(|stage| stage.accumulate % size != 0) {
            Some(stage) => Err(WorldError::UnequalShares {
                stage: stage.name.clone(),
                accumulate: stage.accumulate,
                size,
            }),
            None => {
                self.world = world;
                Ok(self)
            }
        }
    }

    /// Which scenes of a step this process computes.
    pub fn share(&self) -> Share {
        self.world.share()
    }

    /// Whether this process writes and prints.
    pub fn leads(&self) -> bool {
        self.world.leads()
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
    /// Memory the run is expected to use; `None` where the system does not tell what is in use already.
    pub fn memory_estimate(&self) -> Option<MemoryEstimate> {
        estimate(&self.config, &self.library, self.learner.model().num_params())
    }
    /// The constant tensors of the wardrobe.
    pub fn tensors(&self) -> &Arc<WardrobeTensors> {
        &self.tensors
    }
    /// One optimiser step on `scenes`, this process's share of the step's, started at `start` after waiting `waited` for
    /// them.
    ///
    /// # Errors
    /// When a scene cannot be computed here or in another process, or an incident not be written.
    pub fn step_on(
        &mut self,
        mut scenes: Vec<PreparedScene>,
        at: &ScheduleAt,
        start: Instant,
        waited: Duration,
        stop: &StopFlag,
    ) -> Result<StepReport, Report> {
        let mut computed = self.compute(&mut scenes, at, self.step + 1)?;
        let stopping = self.world.meet(stop.requested())?;
        let stage = &self.schedule.stages()[at.stage];
        let mut summary = StepSummary::of(&scenes, computed.loss, &computed.scenes, stage.accumulate);
        if self.world.is_shared() {
            let exchange = Instant::now();
            summary = StepSummary::joined(&self.world.gather(&summary.to_row()));
            computed.loss = summary.loss;
            let bucket = gradient_bucket(self.learner.model(), &computed.gradients);
            computed.gradients = gradients_of_bucket(self.learner.model(), &self.world.sum(bucket));
            computed.times.update += exchange.elapsed();
        }
        let mut outcome = self.learner.update(computed, stage.trains, at.learning_rate);
        self.step += 1;
        if let (Some(average), false) = (&mut self.average, outcome.skipped) {
            let update = Instant::now();
            average.update(self.learner.model(), self.step);
            outcome.times.update += update.elapsed();
        }
        let verdict = self.guard.watch(self.step, outcome.gradient_norm, outcome.skipped);
        let record = StepRecord {
            step: self.step,
            stage: stage.name.clone(),
            layers: summary.layers,
            pose_scale: at.pose_scale,
            loss: outcome.loss,
            raw: summary.raw,
            weighted: summary.weighted,
            grad_norm: outcome.gradient_norm,
            lr: at.learning_rate,
            seconds: start.elapsed().as_secs_f64(),
            wait_seconds: waited.as_secs_f64(),
            forward_seconds: outcome.times.forward.as_secs_f64(),
            backward_seconds: outcome.times.backward.as_secs_f64(),
            update_seconds: outcome.times.update.as_secs_f64(),
            skipped: outcome.skipped,
        };
        let incident = match outcome.skipped && self.leads() {
            true => self.keep_incident(at, scenes, outcome)?,
            false => None,
        };
        Ok(StepReport { record, verdict, incident, stopping })
    }

    /// Loss and gradients of `scenes`, some or all of those of `step` (counted from 1).
    fn compute(
        &mut self,
        scenes: &mut [PreparedScene],
        at: &ScheduleAt,
        step: u64,
    ) -> Result<Computed, Report> {
        let stage = &self.schedule.stages()[at.stage];
        let injected = self.config.guard.injected(step);
        if injected == Some(Injected::Position) {
            spoil_position(scenes);
        }
        let spoil = injected == Some(Injected::Gradient);
        self.learner
            .compute(&self.tensors, scenes, stage.accumulate, stage.trains, spoil)
            .map_err(Report::new)
            .wrap_err_with(|| format!("step {step}"))
    }

    /// Writes the scenes of a skipped step, unless enough are kept already.
    fn keep_incident(
        &mut self,
        at: &ScheduleAt,
        mut scenes: Vec<PreparedScene>,
        mut outcome: StepOutcome,
    ) -> Result<Option<PathBuf>, Report> {
        let folder = self.run.incidents();
        let is_scene = |e: &std::fs::DirEntry| e.path().extension().is_some_and(|x| x == "json");
        let kept = std::fs::read_dir(&folder).into_iter().flatten().flatten().filter(is_scene).count();
        // After a resume a step may fail again: the same scene once more.
        let again = folder.join(format!("step-{}.json", self.step)).exists();
        if kept >= self.config.guard.kept_incidents && !again {
            return Ok(None);
        }
        let injected = self.config.guard.injected(self.step);
        if self.world.is_shared() {
            // The scene at fault may be another process's: all of them once more, the step having changed nothing.
            let step = self.step - 1;
            scenes = prepare_step(&self.library, &self.config, &self.schedule, step, Share::WHOLE)?;
            outcome = StepOutcome { scenes: self.compute(&mut scenes, at, self.step)?.scenes, ..outcome };
        }
        let around = Circumstances {
            config: &self.config,
            library: &self.library,
            step: self.step,
            at,
            injected,
            model: self.learner.model(),
        };
        Ok(Some(Incident::write(&folder, &around, &scenes, &outcome)?))
    }

    /// The error of a run that gave up after `count` incidents, pointing to the last checkpoint.
    pub fn gave_up(&self, count: usize) -> Report {
        let last = match Checkpoint::open(self.run.root()) {
            Ok(checkpoint) => format!("the last good checkpoint is {}", checkpoint.path.display()),
            Err(_) => "no checkpoint had been written yet".into(),
        };
        miette!(
            help = format!(
                "`clothcombo replay {}/step-N.json` shows the terms at fault; resume from the checkpoint with a lower \
                    learning rate and --allow-config-change stages",
                self.run.incidents().display()
            ),
            "loss or gradient was not finite in {count} of the last {} steps, the last one step {}; {last}",
            self.config.guard.window,
            self.step
        )
    }

    /// Scores the fixed validation scenes.
    ///
    /// # Errors
    /// When a scene cannot be draped.
    pub fn validate(&self) -> Result<ValidationReport, Report> {
        Ok(self.validation.score(&self.library, &self.networks())?)
    }

    /// Takes note of a validation at the current step; whether it is the best so far.
    pub fn note_validation(&mut self, report: &ValidationReport) -> bool {
        let Some(score) = report.score() else { return false };
        if self.best.is_some_and(|best| best.score.0 <= score) {
            return false;
        }
        self.best = Some(Best { step: self.step, score: score.into() });
        true
    }

    /// The best validation so far.
    pub fn best(&self) -> Option<Best> {
        self.best
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
        let mut state = state(&self.library, self.step);
        state.best = self.best;
        state.incidents = self.guard.incidents();
        let snapshot = Snapshot {
            model: self.learner.model(),
            average: self.average.as_ref().map(Average::model),
            optimizer: self.learner.optimizer(),
        };
        Ok(Checkpoint::save(&self.run, &self.config, state, &snapshot)?.path)
    }

    /// The networks as they are used: averaged, where the run keeps an average.
    fn networks(&self) -> Networks<'_> {
        let model = match &self.average {
            Some(average) => average.model().clone(),
            None => self.learner.model().valid(),
        };
        Networks::new(model, &self.tensors)
    }
}

/// Input sizes of networks for `library`.
pub fn dimensions(library: &Library) -> Dimensions {
    state(library, 0).dimensions()
}

/// What a checkpoint of networks for `library` says about itself at `step`.
pub(crate) fn state(library: &Library, step: u64) -> CheckpointState {
    let joints: Vec<String> =
        library.joints().indices.iter().map(|&j| library.body.joint_names[j].clone()).collect();
    let pose_features = joints.len() * library.poses.features_per_joint();
    let mut state = CheckpointState::new(step, joints, library.shape_count, pose_features);
    state.data = Some(library.fingerprint().to_owned());
    state
}
