//! What a run begins with, checked before anything is made: nothing, a trained model, or a checkpoint of its own.

use crate::cli::data_check::check_data;
use crate::cli::loading::load_dataset_for;
use crate::config::Config;
use crate::dataset::{DataCheck, Dataset};
use crate::run::checkpoint::{Checkpoint, CheckpointError, TrainedModel};
use crate::run::difference::AllowedChanges;
use crate::run::error::RunDirError;
use crate::run::folder::RunDir;
use crate::training::process_group::ProcessGroup;
use crate::training::session::Session;
use burn::tensor::Device;
use miette::{Report, miette};
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

/// What a run begins with.
pub(super) enum RunOrigin {
    /// A new run, from a model or from nothing.
    New(Option<Box<TrainedModel>>),
    /// A run that goes on, from a checkpoint or, killed before its first, from the start.
    Resumed(RunDir, Option<Box<Checkpoint>>),
}

impl RunOrigin {
    /// What the run in `root` begins with. `resume` goes on with it, from the checkpoint there if one is named; the values of the
    /// keys `allowed` may differ then.
    ///
    /// # Errors
    /// When the folder, the model or the checkpoint cannot be used. Only the lock of an existing run has been touched then.
    pub fn find(
        resume: Option<Option<&Path>>,
        allowed: &[String],
        root: &Path,
        config: &Config,
        group: &ProcessGroup,
    ) -> Result<Self, Report> {
        let Some(path) = resume else {
            if group.is_rank_zero() {
                RunDir::check_free(root)?;
            }
            return Ok(Self::New(start_model(config)?.map(Box::new)));
        };
        let run = match group.is_rank_zero() {
            true => RunDir::resume(root, config, allowed)?,
            false => {
                let unknown = |key| RunDirError::UnknownKey { key };
                RunDir::follow(root).allowing(AllowedChanges::new(allowed, &[config]).map_err(unknown)?)
            }
        };
        let checkpoint = newest_or_none(path.unwrap_or(root))?;
        match &checkpoint {
            Some(checkpoint) => check_steps(root, checkpoint, config)?,
            None => drop(start_model(config)?),
        }
        Ok(Self::Resumed(run, checkpoint.map(Box::new)))
    }

    /// Names of the joints that the networks see, where they are given.
    fn joints(&self) -> Option<&[String]> {
        let state = match self {
            Self::New(Some(model)) => &model.state,
            Self::Resumed(_, Some(checkpoint)) => &checkpoint.state,
            _ => return None,
        };
        (!state.joints.is_empty()).then_some(&state.joints)
    }

    /// Loads the data of `config`, and says what its files look like: nothing where they are those of the checkpoint, which were
    /// checked when its run began.
    ///
    /// # Errors
    /// When it cannot be read or trained on; each garment, clip or body at fault is named.
    pub fn load_data(
        &self,
        config: &Config,
        group: &ProcessGroup,
    ) -> Result<(Arc<Dataset>, Option<DataCheck>), Report> {
        // One process tells; the others fail with it.
        let check = || group.is_rank_zero().then(|| check_data(config)).transpose();
        let Self::Resumed(_, Some(checkpoint)) = self else {
            let check = check()?;
            return Ok((load_dataset_for(config, self.joints())?, check));
        };
        let dataset = load_dataset_for(config, self.joints())?;
        let is_same = checkpoint.state.data.as_deref() == Some(dataset.fingerprint());
        let check = if is_same { None } else { check()? };
        Ok((dataset, check))
    }

    /// Makes the session and, when nothing can be wrong any more, the folder of a new run.
    ///
    /// # Errors
    /// When the networks cannot be made for the data, or the folder cannot be written.
    pub fn begin(
        self,
        root: &Path,
        config: &Config,
        dataset: &Arc<Dataset>,
        device: &Device,
        group: &Rc<ProcessGroup>,
    ) -> Result<(RunDir, Session), Report> {
        let new = |run: RunDir| Session::new(run, config.clone(), dataset.clone(), device);
        match self {
            Self::New(_) => {
                let session = new(RunDir::follow(root))?.shared_in(group.clone())?;
                let run = match group.is_rank_zero() {
                    true => RunDir::create(root, config)?,
                    false => RunDir::follow(root),
                };
                Ok((run, session))
            }
            Self::Resumed(run, checkpoint) => {
                let session = match &checkpoint {
                    Some(c) => Session::resume(run.clone(), config.clone(), dataset.clone(), device, c)?,
                    None => new(run.clone())?,
                };
                let session = session.shared_in(group.clone())?;
                // Every process has read the checkpoint before rank zero moves others aside.
                group.barrier(false)?;
                if group.is_rank_zero() {
                    continue_run(&run, config, checkpoint.as_deref())?;
                }
                Ok((run, session))
            }
        }
    }
}

/// Refuses a run that has more steps than `config` asks for: nothing of it would fit what is asked.
fn check_steps(root: &Path, checkpoint: &Checkpoint, config: &Config) -> Result<(), Report> {
    let (done, asked) = (checkpoint.state.step, config.total_steps());
    if done <= asked {
        return Ok(());
    }
    Err(miette!(
        help = "ask for at least as many steps, resume an earlier checkpoint of it, or start another run",
        "{} has {done} steps, more than the {asked} of the configuration; nothing was changed",
        root.display()
    ))
}

/// The model that `config` starts from, if it names one: opened now, so that a wrong path is said before data is loaded.
fn start_model(config: &Config) -> Result<Option<TrainedModel>, CheckpointError> {
    let Some(path) = &config.init_from else { return Ok(None) };
    let model = TrainedModel::open(Path::new(path)).map_err(|error| match error {
        CheckpointError::Missing { path } => CheckpointError::NoStart { path },
        other => other,
    })?;
    model.check_networks(config)?;
    Ok(Some(model))
}

/// The checkpoint at `path`, or the newest whole one of the run there; `None` where the run was killed before its first.
fn newest_or_none(path: &Path) -> Result<Option<Checkpoint>, CheckpointError> {
    match Checkpoint::open(path) {
        Ok(checkpoint) => Ok(Some(checkpoint)),
        Err(CheckpointError::Missing { .. }) => {
            tracing::warn!("{} holds no checkpoint yet: the run starts anew", path.display());
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

/// Makes `config` the run's own and sets aside what the run did after `checkpoint`, with a warning about each.
fn continue_run(run: &RunDir, config: &Config, checkpoint: Option<&Checkpoint>) -> Result<(), Report> {
    let changed = run.adopt_config(config)?;
    if !changed.is_empty() {
        tracing::warn!("the run goes on with other values of {}", changed.join(", "));
    }
    let abandoned = checkpoint.map_or(Ok(0), |c| c.abandon_later(run))?;
    if abandoned > 0 {
        let folder = run.checkpoints();
        tracing::warn!("{abandoned} later checkpoints are now {}/abandoned-step-…", folder.display());
    }
    Ok(())
}
