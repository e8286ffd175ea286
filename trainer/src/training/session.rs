//! A run in progress: everything the training loop acts on, and the parts of a step.

use crate::config::Config;
use crate::dataset::Dataset;
use crate::evaluation::ValidationSet;
use crate::evaluation::sample_picture;
use crate::inference::networks::Networks;
use crate::inference::tensor_store::TensorStore;
use crate::run::checkpoint::{BestValidation, Checkpoint, CheckpointState, Snapshot};
use crate::run::folder::RunDir;
use crate::run::memory::MemoryEstimate;
use crate::run::validation::ValidationReport;
use crate::system::device::{is_processor, name};
use crate::system::memory::Memory;
use crate::training::average::Average;
use crate::training::guard::Guard;
use crate::training::learner::Learner;
use crate::training::process_group::ProcessGroup;
use crate::training::schedule::Schedule;
use burn::module::Module;
use burn::tensor::Device;
use miette::{Report, miette};
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;

mod data_change;
mod incidents;
mod milestones;
mod start;
mod step;

/// A run in progress.
pub struct Session {
    run: RunDir,
    config: Arc<Config>,
    dataset: Arc<Dataset>,
    schedule: Schedule,
    tensors: Arc<TensorStore>,
    validation: ValidationSet,
    learner: Learner,
    average: Option<Average>,
    guard: Guard,
    best: Option<BestValidation>,
    step: u64,
    /// The last step that need not be saved any more.
    saved_step: u64,
    /// A checkpoint that was due after a skipped step waits for one that is not: the parameters may be at fault.
    owes_checkpoint: bool,
    group: Rc<ProcessGroup>,
    device: Device,
    /// Name of the device that the run came from, where it is another.
    earlier_device: Option<String>,
}

impl Session {
    /// The same run as one of the processes in `group`.
    ///
    /// # Errors
    /// When they cannot share the scenes of every stage equally.
    pub fn shared_in(mut self, group: Rc<ProcessGroup>) -> Result<Self, Report> {
        let size = group.partition().size;
        match self.schedule.stages().iter().find(|stage| stage.accumulate % size != 0) {
            Some(stage) => Err(miette!(
                help = format!(
                    "set accumulate of every stage to a multiple of the processes: --set stages.0.accumulate={size}"
                ),
                "stage {:?} takes {} outfits per update, which {size} processes cannot share equally",
                stage.name,
                stage.accumulate
            )),
            None => {
                self.group = group;
                Ok(self)
            }
        }
    }

    /// Whether no other process takes part.
    pub fn is_single_process(&self) -> bool {
        !self.group.is_shared()
    }

    /// Whether this process writes and prints.
    pub fn is_rank_zero(&self) -> bool {
        self.group.is_rank_zero()
    }

    /// Steps done.
    pub fn step(&self) -> u64 {
        self.step
    }
    /// The schedule.
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }
    /// The dataset.
    pub fn dataset(&self) -> &Arc<Dataset> {
        &self.dataset
    }
    /// What the device is called that the run computes on.
    pub fn device_name(&self) -> String {
        name(&self.device)
    }
    /// What the device is called that the run was computed on before it moved to this one.
    pub fn earlier_device(&self) -> Option<&str> {
        self.earlier_device.as_deref()
    }
    /// Memory the run is expected to use; `None` where the system does not tell what is in use already.
    pub fn memory_estimate(&self) -> Option<MemoryEstimate> {
        let (sizes, model) = (self.dataset.sizes(&self.config.data), self.learner.model());
        let on_processor = model.devices().iter().all(is_processor);
        let streams = self.config.data.cache.folder.is_some();
        let estimate = MemoryEstimate::new(&self.config, &sizes, model.num_params(), on_processor);
        Some(estimate.after_start(Memory::now()?.resident, streams))
    }
    /// The constant tensors of the garments.
    pub fn tensors(&self) -> &Arc<TensorStore> {
        &self.tensors
    }
    /// Scores the fixed validation scenes.
    ///
    /// # Errors
    /// When a scene cannot be draped.
    pub fn validate(&self) -> Result<ValidationReport, Report> {
        Ok(self.validation.score(&self.dataset, &self.networks())?)
    }

    /// Takes note of a validation at the current step; whether it is the best so far.
    pub fn note_validation(&mut self, report: &ValidationReport) -> bool {
        let Some(score) = report.score() else { return false };
        if self.best.is_some_and(|best| best.score.0 <= score) {
            return false;
        }
        self.best = Some(BestValidation { step: self.step, score: score.into() });
        true
    }

    /// Draws the sample picture of the current step and returns its path.
    ///
    /// # Errors
    /// When it cannot be drawn or written.
    pub fn draw_sample(&self) -> Result<PathBuf, Report> {
        let path = self.run.sample(self.step);
        let count = self.config.output.sample_scenes;
        sample_picture::draw(&self.dataset, &self.validation, &self.networks(), count, &path)?;
        Ok(path)
    }

    /// Saves a checkpoint and returns its folder.
    ///
    /// # Errors
    /// When it cannot be written; earlier checkpoints are untouched.
    pub fn save(&self) -> Result<PathBuf, Report> {
        let mut state = CheckpointState::of(&self.dataset, self.step).on_device(&self.device_name());
        state.best = self.best;
        state.incidents = self.guard.incidents();
        let snapshot = Snapshot {
            model: self.learner.model(),
            average: self.average.as_ref().map(Average::model),
            optimizer: self.learner.optimizer(),
            data: self.dataset.list(),
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
