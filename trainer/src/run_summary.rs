//! What a run folder says about its run, without loading any of its data.

use crate::checkpoint::Checkpoint;
use crate::config::{Config, load};
use crate::report::run_name;
use crate::run_lock::RunLock;
use serde::Serialize;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// A run in a few numbers.
#[derive(Clone, Debug, Serialize)]
pub struct RunSummary {
    /// Name of its folder.
    pub name: String,
    /// The folder.
    pub path: PathBuf,
    /// `"running"`, `"finished"` or `"stopped"`.
    pub state: &'static str,
    /// Steps logged.
    pub step: u64,
    /// Steps of the whole run.
    pub total_steps: u64,
    /// Name of the stage of the last step.
    pub stage: String,
    /// Median loss of the last 100 logged steps.
    pub loss: Option<f64>,
    /// Median time of the last 100 logged steps [s].
    pub seconds_per_step: Option<f64>,
    /// Steps skipped because loss or gradient was not finite.
    pub skipped: u64,
    /// Step of the best validation.
    pub best_step: Option<u64>,
    /// Score of the best validation: mean total loss of the networks, mean over the groups.
    pub best_score: Option<f64>,
    /// Strain of the networks over that of skinning, last validation, single garments.
    pub strain_ratio: Option<f64>,
    /// Share of the vertices inside the body, last validation, single garments.
    pub inside: Option<f64>,
    /// Share of outer vertices on the wrong side of an inner layer, last validation, layered outfits.
    pub wrong_side: Option<f64>,
    /// Step of the newest whole checkpoint.
    pub checkpoint: Option<u64>,
    /// Seed.
    pub seed: u64,
}

const LAST: usize = 100;

impl RunSummary {
    /// Reads `root`; `None` if it is no run.
    pub fn read(root: &Path) -> Option<Self> {
        let config = load(&root.join("config.toml"), &[]).ok()?;
        if !root.join("checkpoints").is_dir() {
            return None;
        }
        let mut summary = Self::empty(root, &config);
        summary.read_steps(root);
        summary.read_validations(root);
        summary.checkpoint = Checkpoint::open(root).ok().map(|c| c.state.step);
        let done = summary.step.max(summary.checkpoint.unwrap_or(0)) >= summary.total_steps;
        summary.state = match (RunLock::is_held(root), done) {
            (true, _) => "running",
            (false, true) => "finished",
            (false, false) => "stopped",
        };
        Some(summary)
    }

    fn empty(root: &Path, config: &Config) -> Self {
        Self {
            name: run_name(root),
            path: root.to_owned(),
            state: "stopped",
            step: 0,
            total_steps: config.total_steps(),
            stage: String::new(),
            loss: None,
            seconds_per_step: None,
            skipped: 0,
            best_step: None,
            best_score: None,
            strain_ratio: None,
            inside: None,
            wrong_side: None,
            checkpoint: None,
            seed: config.seed,
        }
    }

    fn read_steps(&mut self, root: &Path) {
        let (mut losses, mut times) = (Vec::new(), Vec::new());
        for line in values(&root.join("metrics.jsonl")) {
            let Some(step) = line["step"].as_u64() else { continue };
            self.step = step;
            self.stage = line["stage"].as_str().unwrap_or_default().to_owned();
            self.skipped += u64::from(line["skipped"].as_bool() == Some(true));
            losses.extend(line["loss"].as_f64());
            times.extend(line["seconds"].as_f64());
        }
        self.loss = median(&losses);
        self.seconds_per_step = median(&times);
    }

    fn read_validations(&mut self, root: &Path) {
        for line in values(&root.join("validation.jsonl")) {
            // Before the first step there is nothing to compare.
            let Some(step) = line["step"].as_u64().filter(|step| *step > 0) else { continue };
            let networks: Vec<(&str, &Value, &Value)> = line["groups"]
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(|g| {
                    let methods = g["methods"].as_array()?;
                    let skinning = methods.iter().find(|m| m["method"] == "LBS")?;
                    Some((g["group"].as_str()?, methods.last()?, skinning))
                })
                .collect();
            let totals: Vec<f64> =
                networks.iter().filter_map(|(_, m, _)| m["total"]["mean"].as_f64()).collect();
            let score = totals.iter().sum::<f64>() / totals.len() as f64;
            if score.is_finite() && self.best_score.is_none_or(|best| score < best) {
                (self.best_step, self.best_score) = (Some(step), Some(score));
            }
            for (group, network, skinning) in networks {
                if group.starts_with("layered") {
                    self.wrong_side = network["wrong_side"].as_f64();
                } else if group == "single garments" {
                    let strain = |m: &Value| m["raw"]["strain"]["mean"].as_f64();
                    self.strain_ratio = strain(network).zip(strain(skinning)).map(|(a, b)| a / b);
                    self.inside = network["inside"].as_f64();
                }
            }
        }
    }
}

/// The lines of a log that are whole.
fn values(path: &Path) -> impl Iterator<Item = Value> {
    let file = std::fs::File::open(path).ok();
    let lines = file.into_iter().flat_map(|f| BufReader::new(f).lines().map_while(Result::ok));
    lines.filter_map(|line| serde_json::from_str(&line).ok())
}

/// Median of the last values.
fn median(values: &[f64]) -> Option<f64> {
    let mut last = values[values.len().saturating_sub(LAST)..].to_vec();
    last.sort_by(f64::total_cmp);
    last.get(last.len() / 2).copied()
}

/// All runs in `folder`: the folder itself, if it is a run, else those below it, by name.
pub fn find_runs(folder: &Path) -> Vec<RunSummary> {
    if let Some(run) = RunSummary::read(folder) {
        return vec![run];
    }
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|e| e.path())
        .filter(|p| p.is_dir())
        .collect();
    paths.sort();
    paths.iter().filter_map(|p| RunSummary::read(p)).collect()
}
