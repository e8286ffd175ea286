//! The parts of one step: forward and backward, exchange between processes, clip, optimiser step, guard.

use super::Session;
use crate::config::Injected;
use crate::dataset::PreparedScene;
use crate::run::event::StepRecord;
use crate::system::stop::StopFlag;
use crate::training::guard::GuardVerdict;
use crate::training::incident::spoil_position;
use crate::training::learner::{StepInput, StepOutput};
use crate::training::process_group::FailedElsewhere;
use crate::training::scenes::{Scenes, prefetch};
use crate::training::schedule::ScheduleAt;
use clothcombo_model::{gradient_bucket, gradients_of_bucket};
use miette::{IntoDiagnostic, Report, WrapErr};
use std::time::{Duration, Instant};

impl Session {
    /// The scenes of this process from the next step on.
    ///
    /// # Errors
    /// When the system refuses another thread.
    pub fn prefetch(&self) -> Result<Scenes, Report> {
        prefetch(self.tensors.clone(), self.config.clone(), self.step, self.group.partition())
            .into_diagnostic()
            .wrap_err("cannot start the thread that prepares scenes")
    }

    /// Loss and gradients of `scenes`, this process's part of the next step.
    ///
    /// # Errors
    /// When a scene cannot be computed.
    pub fn forward_backward(
        &mut self,
        scenes: &mut [PreparedScene],
        at: &ScheduleAt,
    ) -> Result<StepOutput, Report> {
        self.compute(scenes, at, self.step + 1)
    }

    /// Loss and gradients of `scenes`, some or all of those of `step` (counted from 1).
    pub(super) fn compute(
        &mut self,
        scenes: &mut [PreparedScene],
        at: &ScheduleAt,
        step: u64,
    ) -> Result<StepOutput, Report> {
        let stage = &self.schedule.stages()[at.stage];
        let injected = self.config.guard.injected(step);
        if injected == Some(Injected::Position) {
            spoil_position(scenes);
        }
        let input = StepInput {
            tensors: &self.tensors,
            scenes,
            total: stage.accumulate,
            trains: stage.trains,
            spoil_gradient: injected == Some(Injected::Gradient),
        };
        self.learner.forward_backward(&input).map_err(Report::new).wrap_err_with(|| format!("step {step}"))
    }

    /// Waits for all processes; whether any of them was asked to stop.
    ///
    /// # Errors
    /// When another process failed.
    pub fn barrier(&self, stop: &StopFlag) -> Result<bool, FailedElsewhere> {
        self.group.barrier(stop.requested())
    }

    /// Makes `output` that of the whole step, the sum over all processes, and returns its record.
    pub fn all_reduce(
        &self,
        scenes: &[PreparedScene],
        output: &mut StepOutput,
        at: &ScheduleAt,
    ) -> StepRecord {
        let stage = &self.schedule.stages()[at.stage];
        let mut record = StepRecord::of(scenes, output, stage.accumulate);
        if self.group.is_shared() {
            let start = Instant::now();
            record = StepRecord::joined(&self.group.gather(&record.to_row()));
            output.loss = record.loss;
            output.gradient_norm = record.grad_norm;
            let bucket = gradient_bucket(self.learner.model(), &output.gradients);
            output.gradients = gradients_of_bucket(self.learner.model(), &self.group.sum(bucket));
            output.times.update += start.elapsed();
        }
        StepRecord {
            step: self.step + 1,
            stage: stage.name.clone(),
            pose_scale: at.pose_scale,
            lr: at.learning_rate,
            ..record
        }
    }

    /// Clips the gradient of the whole step.
    pub fn clip(&self, output: &mut StepOutput) {
        self.learner.clip(output);
    }

    /// The optimiser step, and that of the running average.
    pub fn optimizer_step(&mut self, output: &mut StepOutput, at: &ScheduleAt) {
        self.learner.step(output, self.schedule.stages()[at.stage].trains, at.learning_rate);
        self.step += 1;
        if let (Some(average), false) = (&mut self.average, output.skipped) {
            let start = Instant::now();
            average.update(self.learner.model(), self.step);
            output.times.update += start.elapsed();
        }
    }

    /// Completes the record of a step that began at `start` and waited `waited` for its scenes; what the guard makes of it.
    pub fn watch(
        &mut self,
        record: &mut StepRecord,
        output: &StepOutput,
        start: Instant,
        waited: Duration,
    ) -> GuardVerdict {
        let verdict = self.guard.watch(self.step, output.gradient_norm, output.skipped);
        record.grad_norm = output.gradient_norm;
        record.seconds = start.elapsed().as_secs_f64();
        record.wait_seconds = waited.as_secs_f64();
        record.forward_seconds = output.times.forward.as_secs_f64();
        record.backward_seconds = output.times.backward.as_secs_f64();
        record.update_seconds = output.times.update.as_secs_f64();
        record.skipped = output.skipped;
        record.spike = matches!(verdict, GuardVerdict::Spike { .. });
        verdict
    }
}
