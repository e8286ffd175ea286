//! Prepares the scene of the next step on another thread while this one computes.

use super::draw::{Plan, draw_training};
use super::prepare::{PreparedScene, prepare};
use crate::config::Config;
use crate::drape::{DrapeError, WardrobeTensors};
use crate::schedule::Schedule;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;

/// Scenes in step order. Dropping it ends the thread.
pub struct Prefetch {
    receiver: Option<Receiver<Result<PreparedScene, DrapeError>>>,
    worker: Option<JoinHandle<()>>,
}

impl Prefetch {
    /// Starts preparing from `first_step` on, at most `ahead` scenes in advance.
    ///
    /// # Errors
    /// When the system refuses another thread.
    pub fn start(
        tensors: Arc<WardrobeTensors>,
        config: Arc<Config>,
        first_step: u64,
        ahead: usize,
    ) -> std::io::Result<Self> {
        let (sender, receiver) = sync_channel(ahead.max(1));
        let worker = std::thread::Builder::new().name("prepare-scenes".into()).spawn(move || {
            let schedule = Schedule::new(&config);
            let library = tensors.library();
            for step in first_step..schedule.total_steps() {
                let at = schedule.at(step);
                let plan = Plan { stage: &config.stages[at.stage], progress: at.stage_progress };
                let draw = draw_training(library, config.seed, step, plan);
                let scene = prepare(library, &config.losses, draw, at.run_progress)
                    .map_err(DrapeError::from)
                    .and_then(|scene| tensors.warm(&scene).map(|()| scene));
                let failed = scene.is_err();
                if sender.send(scene).is_err() || failed {
                    return; // the trainer stopped early, or is about to
                }
            }
        })?;
        Ok(Self { receiver: Some(receiver), worker: Some(worker) })
    }

    /// The next scene; `None` after the last step.
    pub fn next_scene(&self) -> Option<Result<PreparedScene, DrapeError>> {
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
