//! The scenes of a step, and those of the next steps in advance.

use super::process_group::RankPartition;
use super::schedule::Schedule;
use crate::config::Config;
use crate::dataset::{Dataset, DatasetError, Plan, PreparedScene, SCENES_AHEAD, prepare, sample_training};
use crate::inference::tensor_store::{DrapeError, TensorStore};
use crate::system::prefetch::Prefetch;
use std::sync::Arc;

/// Scenes in step order, prepared on another thread.
pub type Scenes = Prefetch<Vec<PreparedScene>, DrapeError>;

/// Samples and prepares the scenes of `step` that are in `share`, as its stage asks for.
///
/// # Errors
/// When a garment cannot be read.
pub fn prepare_step(
    dataset: &Dataset,
    config: &Config,
    schedule: &Schedule,
    step: u64,
    share: RankPartition,
) -> Result<Vec<PreparedScene>, DatasetError> {
    let at = schedule.at(step);
    let stage = &config.stages[at.stage];
    let plan = Plan { stage, progress: at.stage_progress };
    let scenes = (0..stage.accumulate).filter(|scene| share.has(*scene));
    let samples = scenes.map(|i| sample_training(dataset, config.seed, step, i, plan));
    samples.map(|sample| prepare(dataset, &config.losses, sample, at.run_progress)).collect()
}

/// Starts preparing the scenes in `share` from `first_step` to the end of the schedule, with the tensors of their garments.
///
/// # Errors
/// When the system refuses another thread.
pub fn prefetch(
    tensors: Arc<TensorStore>,
    config: Arc<Config>,
    first_step: u64,
    share: RankPartition,
) -> std::io::Result<Scenes> {
    let schedule = Schedule::new(&config);
    let steps = first_step..schedule.total_steps();
    Prefetch::start("prepare-scenes", steps, SCENES_AHEAD, move |step| {
        let scenes = prepare_step(tensors.dataset(), &config, &schedule, step, share)?;
        scenes.iter().try_for_each(|scene| tensors.warm(scene, config.model.eigen_count))?;
        Ok(scenes)
    })
}
