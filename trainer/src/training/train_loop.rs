//! The training loop, top to bottom.

use super::session::Session;
use crate::run::event::{Observers, TrainEvent, emit};
use crate::system::stop::StopFlag;
use miette::{Report, miette};
use std::time::Instant;

/// Trains from the session's step to the end of the schedule, or until `stop` is requested of any process of the run. When
/// something fails that the networks are not to blame for, what was trained since the last checkpoint is saved.
///
/// # Errors
/// When something cannot be written, or the numbers stop being finite.
pub fn train(session: &mut Session, observers: &mut Observers, stop: &StopFlag) -> Result<(), Report> {
    let result = run(session, observers, stop);
    if result.is_err() {
        session.rescue();
    }
    result
}

fn run(session: &mut Session, observers: &mut Observers, stop: &StopFlag) -> Result<(), Report> {
    let schedule = session.schedule().clone();
    let (first_step, total_steps) = (session.step(), schedule.total_steps());
    emit(observers, &TrainEvent::Started { step: first_step, total_steps })?;
    if first_step == 0 && session.is_rank_zero() {
        emit(observers, &TrainEvent::Validated { step: 0, report: &session.validate()?, best: None })?;
    }
    let prefetched = session.prefetch()?;

    for step in first_step..total_steps {
        let at = schedule.at(step);
        if at.first_of_stage || step == first_step {
            let stage = &schedule.stages()[at.stage];
            emit(observers, &TrainEvent::StageStarted { name: &stage.name, step, steps: stage.steps })?;
        }
        let start = Instant::now();
        let scenes = prefetched.next_item();
        let mut scenes = scenes.ok_or_else(|| miette!("the thread that prepares scenes ended early"))??;
        let waited = start.elapsed();

        let mut output = session.forward_backward(&mut scenes, &at)?;
        let mut stopping = session.barrier(stop)?;
        let mut record = session.all_reduce(&scenes, &mut output, &at);
        session.clip(&mut output);
        session.optimizer_step(&mut output, &at);

        let verdict = session.watch(&mut record, &output, start, waited);
        emit(observers, &TrainEvent::Step(&record))?;
        session.react(verdict, &record, &at, (scenes, output), observers)?;
        // A single process need not agree with others: a request that came since counts for this step.
        stopping |= session.is_single_process() && stop.requested();
        session.milestones(&at, record.skipped, stopping, observers)?;
        if stopping && step + 1 < total_steps {
            return emit(observers, &TrainEvent::Interrupted { step: step + 1 });
        }
    }
    emit(observers, &TrainEvent::Finished { step: total_steps })
}
