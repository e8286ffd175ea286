//! What the training loop says while it runs. The loop knows no progress bar, file or picture: observers do.

use crate::run::checkpoint::BestValidation;
use crate::run::validation::ValidationReport;
use clothcombo_physics::energy::Term;
use miette::Report;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// One optimiser step, as it stands in `metrics.jsonl`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StepRecord {
    /// Steps done, this one included (the first step is 1).
    pub step: u64,
    /// Name of the stage.
    pub stage: String,
    /// Garments in the scene.
    pub layers: usize,
    /// Share of the full pose.
    pub pose_scale: f64,
    /// Weighted sum that was minimised, mean over the step's bodies: that of `weighted` and, where
    /// `losses.single_garments` counts, the losses of the single garments.
    pub loss: f64,
    /// Raw energies, summed over garments or pairs, mean over the step's bodies; terms that were not evaluated are
    /// left out.
    pub raw: BTreeMap<&'static str, f64>,
    /// The same, times their weights.
    pub weighted: BTreeMap<&'static str, f64>,
    /// Global norm of the gradient before clipping: with `optimizer.clip = "scene"` the largest of the scenes', with `"step"`
    /// that of their mean.
    pub grad_norm: f64,
    /// Adam's step size.
    pub lr: f64,
    /// Wall-clock time of the step (s).
    pub seconds: f64,
    /// Part of `seconds` spent waiting for the scene to be prepared (s).
    pub wait_seconds: f64,
    /// Part of `seconds` spent in networks and energies (s).
    pub forward_seconds: f64,
    /// Part of `seconds` spent on gradients (s).
    pub backward_seconds: f64,
    /// Part of `seconds` spent on clipping, Adam and the running average (s).
    pub update_seconds: f64,
    /// Whether loss or gradient was not finite and the parameters were left alone.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub skipped: bool,
    /// Whether the gradient norm was far above the usual one: a spike, as the guard defines it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub spike: bool,
}

impl StepRecord {
    /// Names of all terms, in the order pictures show them.
    pub fn term_names() -> impl Iterator<Item = &'static str> {
        Term::ALL.into_iter().map(|t| t.name())
    }
}

/// Something that happened in a run.
pub enum TrainEvent<'a> {
    /// Training begins or continues.
    Started {
        /// Steps already done.
        step: u64,
        /// Steps of the whole run.
        total_steps: u64,
    },
    /// A stage begins.
    StageStarted {
        /// Name.
        name: &'a str,
        /// First step.
        step: u64,
        /// Number of steps.
        steps: u64,
    },
    /// A step was done.
    Step(&'a StepRecord),
    /// A gradient norm was far above the usual one.
    Spike {
        /// Steps done.
        step: u64,
        /// The norm before clipping.
        norm: f64,
        /// Median of the norms before.
        usual: f64,
    },
    /// Loss or gradient was not finite; the parameters were left alone.
    Skipped {
        /// Steps done, this one included.
        step: u64,
        /// Skipped steps within the guard's window.
        count: usize,
        /// The scene as a file that can be replayed, if it was written.
        file: Option<&'a Path>,
    },
    /// The validation scenes were scored.
    Validated {
        /// Steps done.
        step: u64,
        /// The scores.
        report: &'a ValidationReport,
        /// The best one after a step so far.
        best: Option<BestValidation>,
    },
    /// A checkpoint is about to be written: logs that must reach as far as it are to be flushed now.
    CheckpointDue,
    /// A checkpoint is complete on disk.
    CheckpointSaved {
        /// Its folder.
        path: &'a Path,
    },
    /// A sample picture was written.
    SampleDrawn {
        /// The file.
        path: &'a Path,
    },
    /// The user asked to stop; a checkpoint has been saved.
    Interrupted {
        /// Steps done.
        step: u64,
    },
    /// Too many steps were not finite; the run ends with an error.
    GaveUp {
        /// Steps done.
        step: u64,
    },
    /// All steps are done.
    Finished {
        /// Steps done.
        step: u64,
    },
}

/// Receives every event of a run, in order.
pub trait Observer {
    /// Takes note of `event`.
    ///
    /// # Errors
    /// When something cannot be written; the run then ends with this error.
    fn observe(&mut self, event: &TrainEvent) -> Result<(), Report>;
}

/// The observers of a run.
pub type Observers = [Box<dyn Observer>];

/// Shows `event` to every observer, in order.
///
/// # Errors
/// The first one of an observer.
pub fn emit(observers: &mut Observers, event: &TrainEvent) -> Result<(), Report> {
    observers.iter_mut().try_for_each(|observer| observer.observe(event))
}
