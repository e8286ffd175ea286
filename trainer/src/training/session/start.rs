//! How a run begins: anew, from a trained model, or from a checkpoint.

use super::Session;
use super::data_change::changed_data;
use crate::config::Config;
use crate::dataset::Dataset;
use crate::evaluation::ValidationSet;
use crate::inference::tensor_store::TensorStore;
use crate::run::checkpoint::{Checkpoint, CheckpointState, TrainedModel};
use crate::run::difference::{differing_keys, listed};
use crate::run::folder::RunDir;
use crate::run::memory::largest_tensor;
use crate::run::observer::moved;
use crate::system::device::{check_largest, name};
use crate::training::average::Average;
use crate::training::guard::Guard;
use crate::training::learner::{Learner, new_optimizer};
use crate::training::schedule::Schedule;
use burn::module::Module;
use burn::tensor::Device;
use clothcombo_model::ClothCombo;
use miette::{IntoDiagnostic, Report};
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

impl Session {
    /// A new run on `device` (named without automatic differentiation).
    ///
    /// # Errors
    /// When the networks cannot be made, or the model they start from does not fit.
    pub fn new(run: RunDir, config: Config, dataset: Arc<Dataset>, device: &Device) -> Result<Self, Report> {
        check_largest(device, largest_tensor(&config, &dataset.sizes(&config.data)))?;
        let device = device.clone().autodiff();
        let model = match &config.init_from {
            None => ClothCombo::new(&config.model, &dataset.dimensions(), config.seed, &device)
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
                trained.start_of(&config, &dataset, &device)?
            }
        };
        let average = (config.optimizer.ema_decay > 0.0)
            .then(|| Average::new(model.valid(), config.optimizer.ema_decay));
        let learner = Learner::fresh(model, &config.optimizer);
        let start = CheckpointState::of(&dataset, 0).on_device(&name(&device));
        Ok(Self::assemble(run, config, dataset, &device, learner, average, &start))
    }

    /// The run in `run`, from `checkpoint` on.
    ///
    /// # Errors
    /// When the checkpoint was made with other data or networks.
    pub fn resume(
        run: RunDir,
        config: Config,
        dataset: Arc<Dataset>,
        device: &Device,
        checkpoint: &Checkpoint,
    ) -> Result<Self, Report> {
        check_largest(device, largest_tensor(&config, &dataset.sizes(&config.data)))?;
        let device = device.clone().autodiff();
        let found = &checkpoint.state;
        let changed_data = changed_data(checkpoint, &dataset, run.allowed())?;
        if !changed_data.is_empty() {
            let changes = listed(changed_data.iter().map(|change| &change.text));
            tracing::warn!("the run goes on with other data:{changes}");
        }
        if found.device_name() != name(&device) {
            tracing::warn!("device: {}", moved(found.device_name(), &name(&device)));
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
        let is_comparable = changed_data.is_empty()
            && !changed.iter().any(|key| scores.iter().any(|part| key.starts_with(part)));
        let best = found.best.filter(|_| is_comparable);
        // What was changed may have fixed what went wrong before.
        let is_unchanged = changed.is_empty() && changed_data.is_empty();
        let incidents = if is_unchanged { found.incidents.clone() } else { Vec::new() };
        let found = CheckpointState { best, incidents, ..found.clone() };
        Ok(Self::assemble(run, config, dataset, &device, learner, average, &found))
    }

    fn assemble(
        run: RunDir,
        config: Config,
        dataset: Arc<Dataset>,
        device: &Device,
        learner: Learner,
        average: Option<Average>,
        state: &CheckpointState,
    ) -> Self {
        let earlier_device = Some(state.device_name()).filter(|earlier| *earlier != name(device));
        Self {
            earlier_device: earlier_device.map(str::to_owned),
            device: device.clone(),
            tensors: Arc::new(TensorStore::new(dataset.clone(), dataset.dimensions(), device)),
            validation: ValidationSet::new(&dataset, &config),
            schedule: Schedule::new(&config),
            guard: Guard::new(config.guard.clone(), &state.incidents),
            best: state.best,
            step: state.step,
            saved_step: state.step,
            owes_checkpoint: false,
            config: Arc::new(config),
            run,
            dataset,
            learner,
            average,
            group: Rc::default(),
        }
    }
}
