//! How long a run will take: a few real steps of every stage, timed.

use crate::config::Config;
use crate::dataset::Dataset;
use crate::inference::tensor_store::{DrapeError, TensorStore};
use crate::training::learner::{Learner, StepInput};
use crate::training::process_group::RankPartition;
use crate::training::scenes::prepare_step;
use crate::training::schedule::Schedule;
use burn::tensor::Device;
use clothcombo_model::ClothCombo;
use std::sync::Arc;
use std::time::Instant;

/// Time of the steps of a stage.
#[derive(Clone, Copy, Debug)]
pub struct StageTime {
    /// Steps timed.
    pub steps: u64,
    /// Mean time of a step (s), scenes prepared on another thread beside it.
    pub seconds_per_step: f64,
}

/// Times `steps` steps of every stage, spread over it, with untrained networks, on `device` (named without automatic
/// differentiation). Nothing is written.
///
/// # Errors
/// When a scene cannot be computed.
pub fn time_stages(
    config: &Config,
    dataset: &Arc<Dataset>,
    device: &Device,
    steps: u64,
) -> Result<Vec<StageTime>, DrapeError> {
    let device = device.clone().autodiff();
    let model = ClothCombo::new(&config.model, &dataset.dimensions(), config.seed, &device)?;
    let tensors = TensorStore::new(dataset.clone(), dataset.dimensions(), &device);
    let mut learner = Learner::fresh(model, &config.optimizer);
    let schedule = Schedule::new(config);
    let mut times = Vec::with_capacity(config.stages.len());
    for (first, stage) in schedule.boundaries().into_iter().zip(&config.stages) {
        let timed = steps.min(stage.steps);
        let (mut computing, mut preparing) = (0.0, 0.0);
        // One step more, not timed: the first one makes tensors that the others find.
        for i in 0..=timed {
            let step = first + i.saturating_sub(1) * stage.steps / timed.max(1);
            let start = Instant::now();
            let scenes = prepare_step(dataset, config, &schedule, step, RankPartition::WHOLE)?;
            let prepared = Instant::now();
            // A rate of zero would be no step; this one moves nothing that matters.
            let input = StepInput::whole(&tensors, &scenes, stage.trains);
            learner.train_step(&input, 1e-12)?;
            if i > 0 {
                preparing += (prepared - start).as_secs_f64();
                computing += prepared.elapsed().as_secs_f64();
            }
        }
        // The slower of two threads sets the pace where there are two cores; both share one otherwise.
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let seconds = if cores > 1 { computing.max(preparing) } else { computing + preparing };
        times.push(StageTime { steps: timed, seconds_per_step: seconds / timed.max(1) as f64 });
    }
    Ok(times)
}
