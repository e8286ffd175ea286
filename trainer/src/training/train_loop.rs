//! The training loop, top to bottom.

use super::scenes::prefetch;
use crate::run::event::{Observer, TrainEvent};
use crate::system::stop::StopFlag;
use crate::training::guard::Verdict;
use crate::training::process_group::RankPartition;
use crate::training::session::Session;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use std::time::Instant;

/// Trains from the session's step to the end of the schedule, or until `stop` is requested of any process of the run. When
/// something fails that the networks are not to blame for, what was trained since the last checkpoint is saved.
///
/// # Errors
/// When something cannot be written, or the numbers stop being finite.
pub fn train(
    session: &mut Session,
    observers: &mut [Box<dyn Observer>],
    stop: &StopFlag,
) -> Result<(), Report> {
    let mut kept = session.step();
    let result = run(session, observers, stop, &mut kept);
    if result.is_err() && session.is_rank_zero() && session.step() > kept {
        let step = session.step();
        match session.save() {
            Ok(path) => tracing::warn!("step {step} is saved as {}: continue with --resume", path.display()),
            Err(error) => tracing::warn!("step {step} could not be saved: {error}"),
        }
    }
    result
}

/// The loop. `kept`: the last step that needs not be saved any more.
fn run(
    session: &mut Session,
    observers: &mut [Box<dyn Observer>],
    stop: &StopFlag,
    kept: &mut u64,
) -> Result<(), Report> {
    let mut emit = |event: &TrainEvent| observers.iter_mut().try_for_each(|o| o.observe(event));
    let schedule = session.schedule().clone();
    let output = session.config().output.clone();
    let validate_every = session.config().validation.every;
    let first_step = session.step();
    let total_steps = schedule.total_steps();

    emit(&TrainEvent::Started { step: first_step, total_steps })?;
    if first_step == 0 && session.is_rank_zero() {
        emit(&TrainEvent::Validated { step: 0, report: &session.validate()?, best: None })?;
    }
    let (tensors, config) = (session.tensors().clone(), session.shared_config());
    let scenes = prefetch(tensors, config, first_step, session.share())
        .into_diagnostic()
        .wrap_err("cannot start the thread that prepares scenes")?;

    // A checkpoint that is due after a skipped step waits for one that is not: the parameters may be at fault.
    let mut owed = false;
    for step in first_step..total_steps {
        let at = schedule.at(step);
        if at.first_of_stage || step == first_step {
            let stage = &schedule.stages()[at.stage];
            emit(&TrainEvent::StageStarted { name: &stage.name, step, steps: stage.steps })?;
        }
        let start = Instant::now();
        let prepared =
            scenes.next_item().ok_or_else(|| miette!("the thread that prepares scenes ended early"))??;
        let waited = start.elapsed();
        let report = session.step_on(prepared, &at, start, waited, stop)?;
        emit(&TrainEvent::Step(&report.record))?;

        let done = step + 1;
        match report.verdict {
            Verdict::Fine => {}
            Verdict::Spike { usual } => {
                emit(&TrainEvent::Spike { step: done, norm: report.record.grad_norm, usual })?;
            }
            Verdict::Skipped { count, is_over } => {
                emit(&TrainEvent::Skipped { step: done, count, file: report.incident.as_deref() })?;
                if is_over {
                    *kept = done;
                    emit(&TrainEvent::GaveUp { step: done })?;
                    return Err(session.gave_up(count));
                }
            }
        }
        // Alone nobody has to agree: a request that came since counts for this step.
        let stopping = report.stopping || (session.share() == RankPartition::WHOLE && stop.requested());
        let due = |every: u64| every > 0 && done % every == 0;
        // The others go on to the next step, where they wait for the leader.
        if session.is_rank_zero() {
            let mut is_best = false;
            if at.last_of_stage || due(validate_every) {
                let scores = session.validate()?;
                is_best = session.note_validation(&scores) && output.keep_best;
                emit(&TrainEvent::Validated { step: done, report: &scores, best: session.best() })?;
            }
            if at.last_of_stage || due(output.sample_every) {
                emit(&TrainEvent::SampleDrawn { path: &session.draw_sample()? })?;
            }
            owed |= due(output.checkpoint_every);
            let is_time = owed && !matches!(report.verdict, Verdict::Skipped { .. });
            if at.last_of_stage || is_time || is_best || stopping {
                owed = false;
                emit(&TrainEvent::CheckpointDue { step: done })?;
                // A save that failed would fail again.
                *kept = done;
                emit(&TrainEvent::CheckpointSaved { step: done, path: &session.save()? })?;
            }
        }
        if stopping && done < total_steps {
            return emit(&TrainEvent::Interrupted { step: done });
        }
    }
    emit(&TrainEvent::Finished { step: total_steps })
}
