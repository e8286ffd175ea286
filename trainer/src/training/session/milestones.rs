//! What happens between steps: reactions to the guard, validation, samples, checkpoints.

use super::Session;
use crate::dataset::PreparedScene;
use crate::run::event::{Observers, StepRecord, TrainEvent, emit};
use crate::training::guard::GuardVerdict;
use crate::training::learner::StepOutput;
use crate::training::schedule::ScheduleAt;
use miette::Report;

impl Session {
    /// Tells about a step that is out of the ordinary, and keeps the scenes of one that was skipped.
    ///
    /// # Errors
    /// When too many steps were skipped, or an incident cannot be written.
    pub fn react(
        &mut self,
        verdict: GuardVerdict,
        record: &StepRecord,
        at: &ScheduleAt,
        (scenes, output): (Vec<PreparedScene>, StepOutput),
        observers: &mut Observers,
    ) -> Result<(), Report> {
        let step = self.step;
        match verdict {
            GuardVerdict::Fine => Ok(()),
            GuardVerdict::Spike { usual } => {
                emit(observers, &TrainEvent::Spike { step, norm: record.grad_norm, usual })
            }
            GuardVerdict::Skipped { count, is_over } => {
                let incident = match self.is_rank_zero() {
                    true => self.keep_incident(at, scenes, output)?,
                    false => None,
                };
                emit(observers, &TrainEvent::Skipped { step, count, file: incident.as_deref() })?;
                if !is_over {
                    return Ok(());
                }
                self.saved_step = step;
                emit(observers, &TrainEvent::GaveUp { step })?;
                Err(self.gave_up(count))
            }
        }
    }

    /// Validates, draws samples and saves checkpoints where they are due. Other processes than the first go on to the next
    /// step, where they wait for it.
    ///
    /// # Errors
    /// When something cannot be computed or written.
    pub fn milestones(
        &mut self,
        at: &ScheduleAt,
        skipped: bool,
        stopping: bool,
        observers: &mut Observers,
    ) -> Result<(), Report> {
        if !self.is_rank_zero() {
            return Ok(());
        }
        let (step, config) = (self.step, self.config.clone());
        let is_due = |every: u64| every > 0 && step % every == 0;
        let mut is_best = false;
        if at.last_of_stage || is_due(config.validation.every) {
            let report = self.validate()?;
            is_best = self.note_validation(&report) && config.output.keep_best;
            emit(observers, &TrainEvent::Validated { step, report: &report, best: self.best })?;
        }
        if at.last_of_stage || is_due(config.output.sample_every) {
            emit(observers, &TrainEvent::SampleDrawn { path: &self.draw_sample()? })?;
        }
        self.owes_checkpoint |= is_due(config.output.checkpoint_every);
        let is_time = self.owes_checkpoint && !skipped;
        if at.last_of_stage || is_time || is_best || stopping {
            self.owes_checkpoint = false;
            emit(observers, &TrainEvent::CheckpointDue)?;
            // A save that failed would fail again.
            self.saved_step = step;
            emit(observers, &TrainEvent::CheckpointSaved { path: &self.save()? })?;
        }
        Ok(())
    }

    /// Saves what was trained since the last checkpoint, after something failed that the networks are not to blame for.
    pub fn rescue(&self) {
        let step = self.step;
        if !self.is_rank_zero() || step <= self.saved_step {
            return;
        }
        match self.save() {
            Ok(path) => tracing::warn!("step {step} is saved as {}: continue with --resume", path.display()),
            Err(error) => tracing::warn!("step {step} could not be saved: {error}"),
        }
    }
}
