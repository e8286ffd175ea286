//! `curves.png`: every loss over the steps, against the baseline that has learned nothing.

use crate::config::Config;
use crate::evaluate::Method;
use crate::event::{Observer, StepRecord, TrainEvent};
use crate::picture::{Series, StageBoundary, draw_curves, save_png};
use crate::run_dir::RunDir;
use crate::scene::ValidationGroup;
use crate::schedule::Schedule;
use clothcombo_physics::energy::Term;
use miette::{IntoDiagnostic, Report};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// What the dashed lines show.
const BASELINE: Method = Method::StartSkinning;

/// Terms whose baseline is taken from a validation group: layer terms from the layered outfits, the others from single
/// garments.
fn terms_of(group: &str) -> impl Iterator<Item = &'static str> {
    let layered = group == ValidationGroup::Layered.name();
    let wanted = layered || group == ValidationGroup::Single.name();
    Term::ALL.into_iter().filter(move |t| wanted && t.is_layer_term() == layered).map(Term::name)
}

/// Draws the curves of a run whenever a checkpoint is saved.
pub struct CurvesObserver {
    path: PathBuf,
    stages: Vec<StageBoundary>,
    points: BTreeMap<&'static str, Vec<(f64, f64)>>,
    baselines: BTreeMap<&'static str, f64>,
    drawn_at: u64,
}

impl CurvesObserver {
    /// Continues the curves of `run` from what its logs hold.
    ///
    /// # Errors
    /// When the logs exist but cannot be read.
    pub fn new(run: &RunDir, config: &Config) -> Result<Self, Report> {
        let schedule = Schedule::new(config);
        let stages = schedule
            .boundaries()
            .into_iter()
            .zip(schedule.stages())
            .map(|(step, stage)| StageBoundary { step: step as f64, name: stage.name.clone() })
            .collect();
        let mut curves = Self {
            path: run.curves(),
            stages,
            points: BTreeMap::new(),
            baselines: BTreeMap::new(),
            drawn_at: u64::MAX,
        };
        curves.read_back(run)?;
        Ok(curves)
    }

    fn read_back(&mut self, run: &RunDir) -> Result<(), Report> {
        let read = |path: PathBuf| match std::fs::read_to_string(path) {
            Ok(text) => Ok(text),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
            Err(e) => Err(e),
        };
        let lines = |text: String| -> Vec<serde_json::Value> {
            text.lines().filter_map(|l| serde_json::from_str(l).ok()).collect()
        };
        for line in lines(read(run.metrics()).into_diagnostic()?) {
            let Some(step) = line["step"].as_f64() else { continue };
            for name in StepRecord::term_names() {
                if let Some(v) = line["raw"][name].as_f64() {
                    self.points.entry(name).or_default().push((step, v));
                }
            }
            for name in ["loss", "grad_norm"] {
                if let Some(v) = line[name].as_f64() {
                    self.points.entry(name).or_default().push((step, v));
                }
            }
        }
        if let Some(first) = lines(read(run.validation()).into_diagnostic()?).first() {
            for group in first["groups"].as_array().into_iter().flatten() {
                let Some(methods) = group["methods"].as_array() else { continue };
                let Some(baseline) = methods.iter().find(|m| m["method"] == BASELINE.name()) else {
                    continue;
                };
                for name in terms_of(group["group"].as_str().unwrap_or_default()) {
                    if let Some(v) = baseline["raw"][name]["mean"].as_f64() {
                        self.baselines.insert(name, v);
                    }
                }
            }
        }
        Ok(())
    }

    fn draw(&self) -> Result<(), Report> {
        let series = |name: &'static str, unit: &str| Series {
            name: name.to_owned(),
            unit: unit.to_owned(),
            points: self.points.get(name).cloned().unwrap_or_default(),
            baseline: self.baselines.get(name).copied(),
        };
        let mut all = vec![series("loss", "weighted J"), series("grad_norm", "before clipping")];
        all.extend(StepRecord::term_names().map(|n| series(n, "raw")));
        let picture = draw_curves("Training", &all, &self.stages).into_diagnostic()?;
        save_png(&picture, &self.path).into_diagnostic()
    }
}

impl Observer for CurvesObserver {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), Report> {
        match event {
            TrainEvent::Step(record) => {
                let step = record.step as f64;
                for (name, value) in &record.raw {
                    self.points.entry(name).or_default().push((step, *value));
                }
                self.points.entry("loss").or_default().push((step, record.loss));
                self.points.entry("grad_norm").or_default().push((step, record.grad_norm));
            }
            TrainEvent::Validated { report, .. } if self.baselines.is_empty() => {
                for group in &report.groups {
                    let baseline = group.methods.iter().find(|m| m.method == BASELINE.name());
                    for name in terms_of(group.group) {
                        if let Some(spread) = baseline.and_then(|m| m.raw.get(name)) {
                            self.baselines.insert(name, spread.mean);
                        }
                    }
                }
            }
            TrainEvent::CheckpointSaved { step, .. } if self.drawn_at != *step => {
                self.drawn_at = *step;
                self.draw()?;
            }
            _ => {}
        }
        Ok(())
    }
}
