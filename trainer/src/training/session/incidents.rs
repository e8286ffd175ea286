//! Steps whose loss or gradient is not finite: what is kept of them, and the end of a run that has too many.

use super::Session;
use crate::dataset::PreparedScene;
use crate::run::checkpoint::Checkpoint;
use crate::training::incident::{Circumstances, Incident};
use crate::training::learner::StepOutput;
use crate::training::process_group::RankPartition;
use crate::training::scenes::prepare_step;
use crate::training::schedule::ScheduleAt;
use miette::{Report, miette};
use std::path::PathBuf;

impl Session {
    /// Writes the scenes of a skipped step, unless enough are kept already.
    pub(super) fn keep_incident(
        &mut self,
        at: &ScheduleAt,
        mut scenes: Vec<PreparedScene>,
        mut output: StepOutput,
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
        if self.group.is_shared() {
            // The scene at fault may be another process's: all of them once more, the step having changed nothing.
            let step = self.step - 1;
            scenes = prepare_step(&self.dataset, &self.config, &self.schedule, step, RankPartition::WHOLE)?;
            output.scenes = self.compute(&mut scenes, at, self.step)?.scenes;
        }
        let around = Circumstances {
            config: &self.config,
            dataset: &self.dataset,
            step: self.step,
            at,
            injected,
            model: self.learner.model(),
        };
        Ok(Some(Incident::write(&folder, &around, &scenes, &output)?))
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
