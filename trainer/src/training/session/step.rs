//! One step of a run.

use super::Session;
use crate::config::Injected;
use crate::dataset::PreparedScene;
use crate::run::checkpoint::Checkpoint;
use crate::run::event::StepRecord;
use crate::system::stop::StopFlag;
use crate::training::guard::Verdict;
use crate::training::incident::{Circumstances, Incident, spoil_position};
use crate::training::learner::{Computed, StepOutcome};
use crate::training::process_group::RankPartition;
use crate::training::scenes::prepare_step;
use crate::training::schedule::ScheduleAt;
use crate::training::step_summary::StepSummary;
use clothcombo_model::{gradient_bucket, gradients_of_bucket};
use miette::{Report, WrapErr, miette};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// What one step left.
pub struct StepReport {
    /// Its line in the log.
    pub record: StepRecord,
    /// What the guard makes of it.
    pub verdict: Verdict,
    /// The scene as a file, if the step was skipped and is one of the first.
    pub incident: Option<PathBuf>,
    /// Whether this or another process was asked to stop.
    pub stopping: bool,
}

impl Session {
    /// One optimiser step on `scenes`, this process's share of the step's, started at `start` after waiting `waited` for
    /// them.
    ///
    /// # Errors
    /// When a scene cannot be computed here or in another process, or an incident not be written.
    pub fn step_on(
        &mut self,
        mut scenes: Vec<PreparedScene>,
        at: &ScheduleAt,
        start: Instant,
        waited: Duration,
        stop: &StopFlag,
    ) -> Result<StepReport, Report> {
        let mut computed = self.compute(&mut scenes, at, self.step + 1)?;
        let stopping = self.world.meet(stop.requested())?;
        let stage = &self.schedule.stages()[at.stage];
        let mut summary = StepSummary::of(&scenes, &computed, stage.accumulate);
        if self.world.is_shared() {
            let exchange = Instant::now();
            summary = StepSummary::joined(&self.world.gather(&summary.to_row()));
            computed.loss = summary.loss;
            computed.largest_norm = summary.largest_norm;
            let bucket = gradient_bucket(self.learner.model(), &computed.gradients);
            computed.gradients = gradients_of_bucket(self.learner.model(), &self.world.sum(bucket));
            computed.times.update += exchange.elapsed();
        }
        let mut outcome = self.learner.update(computed, stage.trains, at.learning_rate);
        self.step += 1;
        if let (Some(average), false) = (&mut self.average, outcome.skipped) {
            let update = Instant::now();
            average.update(self.learner.model(), self.step);
            outcome.times.update += update.elapsed();
        }
        let verdict = self.guard.watch(self.step, outcome.gradient_norm, outcome.skipped);
        let record = StepRecord {
            step: self.step,
            stage: stage.name.clone(),
            layers: summary.layers,
            pose_scale: at.pose_scale,
            loss: outcome.loss,
            raw: summary.raw,
            weighted: summary.weighted,
            grad_norm: outcome.gradient_norm,
            lr: at.learning_rate,
            seconds: start.elapsed().as_secs_f64(),
            wait_seconds: waited.as_secs_f64(),
            forward_seconds: outcome.times.forward.as_secs_f64(),
            backward_seconds: outcome.times.backward.as_secs_f64(),
            update_seconds: outcome.times.update.as_secs_f64(),
            skipped: outcome.skipped,
            spike: matches!(verdict, Verdict::Spike { .. }),
        };
        let incident = match outcome.skipped && self.is_rank_zero() {
            true => self.keep_incident(at, scenes, outcome)?,
            false => None,
        };
        Ok(StepReport { record, verdict, incident, stopping })
    }

    /// Loss and gradients of `scenes`, some or all of those of `step` (counted from 1).
    fn compute(
        &mut self,
        scenes: &mut [PreparedScene],
        at: &ScheduleAt,
        step: u64,
    ) -> Result<Computed, Report> {
        let stage = &self.schedule.stages()[at.stage];
        let injected = self.config.guard.injected(step);
        if injected == Some(Injected::Position) {
            spoil_position(scenes);
        }
        let spoil = injected == Some(Injected::Gradient);
        self.learner
            .compute(&self.tensors, scenes, stage.accumulate, stage.trains, spoil)
            .map_err(Report::new)
            .wrap_err_with(|| format!("step {step}"))
    }

    /// Writes the scenes of a skipped step, unless enough are kept already.
    fn keep_incident(
        &mut self,
        at: &ScheduleAt,
        mut scenes: Vec<PreparedScene>,
        mut outcome: StepOutcome,
    ) -> Result<Option<PathBuf>, Report> {
        let folder = self.run.incidents();
        let is_scene = |e: &std::fs::DirEntry| e.path().extension().is_some_and(|x| x == "json");
        let kept = std::fs::read_dir(&folder).into_iter().flatten().flatten().filter(is_scene).count();
        // After a resume a step may fail again: the same scene once more.
        let again = folder.join(format!("step-{}.json", self.step)).exists();
        if kept >= self.config.guard.kept_incidents && !again {
            return Ok(None);
        }
        let injected = self.config.guard.injected(self.step);
        if self.world.is_shared() {
            // The scene at fault may be another process's: all of them once more, the step having changed nothing.
            let step = self.step - 1;
            scenes = prepare_step(&self.dataset, &self.config, &self.schedule, step, RankPartition::WHOLE)?;
            outcome = StepOutcome { scenes: self.compute(&mut scenes, at, self.step)?.scenes, ..outcome };
        }
        let around = Circumstances {
            config: &self.config,
            dataset: &self.dataset,
            step: self.step,
            at,
            injected,
            model: self.learner.model(),
        };
        Ok(Some(Incident::write(&folder, &around, &scenes, &outcome)?))
    }

    /// The error of a run that gave up after `count` incidents, pointing to the last checkpoint.
    pub fn gave_up(&self, count: usize) -> Report {
        // Parameters are good if the step after them was.
        let good = self.guard.first_of_last_incidents().saturating_sub(2);
        let last = match Checkpoint::open_until(self.run.root(), good) {
            Ok(checkpoint) => format!("the last good checkpoint is {}", checkpoint.path.display()),
            Err(_) => "no checkpoint had been written before they began".into(),
        };
        miette!(
            help = format!(
                "`clothcombo replay {}/step-N.json` shows the terms at fault; resume from the checkpoint with a lower \
                    learning rate and --allow-config-change stages",
                self.run.incidents().display()
            ),
            "loss or gradient was not finite in {count} of the last {} steps, the last one step {}; {last}",
            self.config.guard.window,
            self.step
        )
    }
}
