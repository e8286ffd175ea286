//! What a run has logged so far, read back and kept up to date: the source of curves and report.

use crate::run::event::{Observer, StepRecord, TrainEvent};
use crate::run::folder::RunDir;
use crate::run::validation::Method;
use clothcombo_physics::energy::Term;
use miette::{IntoDiagnostic, Report};
use serde_json::Value;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::rc::Rc;

/// Quantities of a step besides the energies.
const SCALARS: [&str; 8] = [
    "loss",
    "grad_norm",
    "lr",
    "seconds",
    "wait_seconds",
    "forward_seconds",
    "backward_seconds",
    "update_seconds",
];

/// Curves of a run.
#[derive(Default)]
pub struct History {
    /// Steps of the curves, by quantity: the raw energies and [`SCALARS`].
    points: BTreeMap<&'static str, Vec<(f64, f64)>>,
    /// Raw energies of the skinning that the networks start from, mean per scene, by validation group and term.
    pub baselines: BTreeMap<(String, &'static str), f64>,
    /// Validations: step and report, as in `validation.jsonl`.
    pub validations: Vec<(u64, Value)>,
    /// Step and score of the best one.
    pub best: Option<(u64, f64)>,
    /// Steps that were skipped.
    pub skipped: Vec<u64>,
    /// Steps with an unusually large gradient, and its norm.
    pub spikes: Vec<(u64, f64)>,
    /// Sample pictures, oldest first.
    pub samples: Vec<PathBuf>,
    /// The last step seen, and the name of its stage.
    pub last: Option<(u64, String)>,
}

/// A history that several observers look at.
pub type SharedHistory = Rc<RefCell<History>>;

impl History {
    /// What the logs of `run` hold.
    ///
    /// # Errors
    /// When a log exists but cannot be read.
    pub fn read(run: &RunDir) -> Result<Self, Report> {
        let mut history = Self::default();
        for line in lines(run.metrics())? {
            let Some(step) = line["step"].as_u64() else { continue };
            let at = step as f64;
            for name in StepRecord::term_names() {
                history.push(name, at, line["raw"][name].as_f64());
            }
            for name in SCALARS {
                history.push(name, at, line[name].as_f64());
            }
            if line["skipped"].as_bool() == Some(true) {
                history.skipped.push(step);
            }
            if line["spike"].as_bool() == Some(true) {
                history.spikes.push((step, line["grad_norm"].as_f64().unwrap_or(f64::INFINITY)));
            }
            history.last = Some((step, line["stage"].as_str().unwrap_or_default().to_owned()));
        }
        for line in lines(run.validation())? {
            history.best = best_so_far(&line);
            history.note_validation(line["step"].as_u64().unwrap_or(0), line);
        }
        let pictures = std::fs::read_dir(run.samples()).into_iter().flatten().flatten().map(|e| e.path());
        history.samples = pictures.filter(|p| p.extension().is_some_and(|e| e == "png")).collect();
        history.samples.sort();
        Ok(history)
    }

    /// The curve of a quantity: (step, value).
    pub fn points(&self, name: &str) -> &[(f64, f64)] {
        self.points.get(name).map_or(&[], Vec::as_slice)
    }

    fn push(&mut self, name: &'static str, step: f64, value: Option<f64>) {
        if let Some(value) = value {
            self.points.entry(name).or_default().push((step, value));
        }
    }

    fn note_validation(&mut self, step: u64, report: Value) {
        if self.baselines.is_empty() {
            for group in report["groups"].as_array().into_iter().flatten() {
                let methods = group["methods"].as_array().map_or(&[][..], Vec::as_slice);
                let Some(baseline) = Method::start_of(methods) else { continue };
                let name = group["group"].as_str().unwrap_or_default();
                for term in Term::ALL.into_iter().map(Term::name) {
                    if let Some(value) = baseline["raw"][term]["mean"].as_f64() {
                        self.baselines.insert((name.to_owned(), term), value);
                    }
                }
            }
        }
        self.validations.push((step, report));
    }
}

/// Step and score of the best validation so far, by a line of `validation.jsonl`.
pub fn best_so_far(line: &Value) -> Option<(u64, f64)> {
    let best = &line["best"];
    best["step"].as_u64().zip(best["score"].as_f64())
}

fn lines(path: PathBuf) -> Result<Vec<Value>, Report> {
    match std::fs::read_to_string(path) {
        Ok(text) => Ok(text.lines().filter_map(|l| serde_json::from_str(l).ok()).collect()),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(e) => Err(e).into_diagnostic(),
    }
}

/// Keeps a [`History`] up to date; it comes before the observers that look at it.
pub struct HistoryObserver(pub SharedHistory);

impl Observer for HistoryObserver {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), Report> {
        let mut guard = self.0.borrow_mut();
        let history = &mut *guard;
        match event {
            TrainEvent::Step(record) => {
                let step = record.step as f64;
                record.raw.iter().for_each(|(name, value)| history.push(name, step, Some(*value)));
                let scalars = [
                    record.loss,
                    record.grad_norm,
                    record.lr,
                    record.seconds,
                    record.wait_seconds,
                    record.forward_seconds,
                    record.backward_seconds,
                    record.update_seconds,
                ];
                SCALARS.into_iter().zip(scalars).for_each(|(name, v)| history.push(name, step, Some(v)));
                if record.spike {
                    history.spikes.push((record.step, record.grad_norm));
                }
                match &mut history.last {
                    Some((last, stage)) if *stage == record.stage => *last = record.step,
                    last => *last = Some((record.step, record.stage.clone())),
                }
            }
            TrainEvent::Validated { step, report, best } => {
                history.best = best.map(|best| (best.step, best.score.0));
                history.note_validation(*step, serde_json::to_value(report).into_diagnostic()?);
            }
            TrainEvent::Skipped { step, .. } => history.skipped.push(*step),
            TrainEvent::SampleDrawn { path } => {
                history.samples.retain(|p| p != path);
                history.samples.push(path.to_path_buf());
            }
            _ => {}
        }
        Ok(())
    }
}
