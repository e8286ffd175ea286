//! What a run has logged so far, read back and kept up to date: the source of curves and report.

use crate::run::event::{Observer, StepRecord, TrainEvent};
use crate::run::folder::RunDir;
use crate::run::validation::Method;
use miette::{IntoDiagnostic, Report};
use serde_json::Value;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind};
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
    /// Validations: step and line of `validation.jsonl`.
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
    /// When a log exists but cannot be opened.
    pub fn read(run: &RunDir) -> Result<Self, Report> {
        let mut history = Self::default();
        lines(run.metrics())?.for_each(|line| history.note_step(&line));
        lines(run.validation())?.for_each(|line| history.note_validation(line));
        let pictures = std::fs::read_dir(run.samples()).into_iter().flatten().flatten().map(|e| e.path());
        history.samples = pictures.filter(|p| p.extension().is_some_and(|e| e == "png")).collect();
        history.samples.sort();
        Ok(history)
    }

    /// The curve of a quantity: (step, value).
    pub fn points(&self, name: &str) -> &[(f64, f64)] {
        self.points.get(name).map_or(&[], Vec::as_slice)
    }

    /// Takes in a line of `metrics.jsonl`.
    fn note_step(&mut self, line: &Value) {
        let Some(step) = line["step"].as_u64() else { return };
        let energies = StepRecord::term_names().map(|name| (name, &line["raw"][name]));
        for (name, value) in energies.chain(SCALARS.map(|name| (name, &line[name]))) {
            if let Some(value) = value.as_f64() {
                self.points.entry(name).or_default().push((step as f64, value));
            }
        }
        if line["skipped"] == true {
            self.skipped.push(step);
        }
        if line["spike"] == true {
            self.spikes.push((step, line["grad_norm"].as_f64().unwrap_or(f64::INFINITY)));
        }
        self.last = Some((step, line["stage"].as_str().unwrap_or_default().to_owned()));
    }

    /// Takes in a line of `validation.jsonl`.
    fn note_validation(&mut self, line: Value) {
        let best = &line["best"];
        self.best = best["step"].as_u64().zip(best["score"].as_f64());
        if self.baselines.is_empty() {
            for group in line["groups"].as_array().into_iter().flatten() {
                let methods = group["methods"].as_array().map_or(&[][..], Vec::as_slice);
                let Some(baseline) = Method::start_of(methods) else { continue };
                let name = group["group"].as_str().unwrap_or_default();
                for term in StepRecord::term_names() {
                    if let Some(value) = baseline["raw"][term]["mean"].as_f64() {
                        self.baselines.insert((name.to_owned(), term), value);
                    }
                }
            }
        }
        self.validations.push((line["step"].as_u64().unwrap_or(0), line));
    }
}

/// The lines of a log that are whole, one after the other; none where it is not there.
fn lines(path: PathBuf) -> Result<impl Iterator<Item = Value>, Report> {
    let file = match File::open(path) {
        Ok(file) => Some(BufReader::new(file)),
        Err(e) if e.kind() == ErrorKind::NotFound => None,
        Err(e) => return Err(e).into_diagnostic(),
    };
    let lines = file.into_iter().flat_map(|file| file.split(b'\n').map_while(Result::ok));
    Ok(lines.filter_map(|line| serde_json::from_slice(&line).ok()))
}

/// Keeps a [`History`] up to date; it comes before the observers that look at it.
pub struct HistoryObserver(pub SharedHistory);

impl Observer for HistoryObserver {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), Report> {
        let mut history = self.0.borrow_mut();
        match event {
            TrainEvent::Step(record) => history.note_step(&serde_json::to_value(record).into_diagnostic()?),
            TrainEvent::Validated { step, report, best } => {
                history.note_validation(report.line(*step, *best));
            }
            TrainEvent::SampleDrawn { path } => {
                history.samples.retain(|p| p != path);
                history.samples.push(path.to_path_buf());
            }
            _ => {}
        }
        Ok(())
    }
}
