//! Prepares the scenes of the next step on another thread while this one computes.

use super::draw::{Plan, draw_training};
use super::error::LibraryError;
use super::library::Library;
use super::prepare::{PreparedScene, prepare};
use crate::config::Config;
use crate::drape::{DrapeError, WardrobeTensors};
use crate::schedule::Schedule;
use crate::world::Share;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;

/// Draws and prepares the scenes of `step` that are in `share`, as its stage asks for.
///
/// # Errors
/// When a garment cannot be read.
pub fn prepare_step(
    library: &Library,
    config: &Config,
    schedule: &Schedule,
    step: u64,
    share: Share,
) -> Result<Vec<PreparedScene>, LibraryError> {
    let at = schedule.at(step);
    let stage = &config.stages[at.stage];
    let plan = Plan { stage, progress: at.stage_progress };
    let scenes = (0..stage.accumulate).filter(|scene| share.has(*scene));
    let draws = scenes.map(|i| draw_training(library, config.seed, step, i, plan));
    draws.map(|draw| prepare(library, &config.losses, draw, at.run_progress)).collect()
}

/// Scenes in step order. Dropping it ends the thread.
pub struct Prefetch {
    receiver: Option<Receiver<Result<Vec<PreparedScene>, DrapeError>>>,
    worker: Option<JoinHandle<()>>,
}

impl Prefetch {
    /// Starts preparing the scenes in `share` from `first_step` on, those of at most `ahead` steps in advance.
    ///
    /// # Errors
    /// When the system refuses another thread.
    pub fn start(
        tensors: Arc<WardrobeTensors>,
        config: Arc<Config>,
        first_step: u64,
        ahead: usize,
        share: Share,
    ) -> std::io::Result<Self> {
        let (sender, receiver) = sync_channel(ahead.max(1));
        let worker = std::thread::Builder::new().name("prepare-scenes".into()).spawn(move || {
            let schedule = Schedule::new(&config);
            let library = tensors.library();
            for step in first_step..schedule.total_steps() {
                let scenes = prepare_step(library, &config, &schedule, step, share)
                    .map_err(DrapeError::from)
                    .and_then(|scenes| {
                        let eigen_count = config.model.eigen_count;
                        scenes.iter().try_for_each(|s| tensors.warm(s, eigen_count)).map(|()| scenes)
                    });
                let failed = scenes.is_err();
                if sender.send(scenes).is_err() || failed {
                    return; // the trainer stopped early, or is about to
                }
            }
        })?;
        Ok(Self { receiver: Some(receiver), worker: Some(worker) })
    }

    /// The scenes of the next step; `None` after the last step.
    pub fn next_step(&self) -> Option<Result<Vec<PreparedScene>, DrapeError>> {
        self.receiver.as_ref()?.recv().ok()
    }
}

impl Drop for Prefetch {
    fn drop(&mut self) {
        self.receiver = None; // unblocks a worker waiting to send
        if let Some(worker) = self.worker.take()
            && let Err(panic) = worker.join()
            && !std::thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}
