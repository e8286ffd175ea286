//! What a run folder says about its run, without loading any of its data.

use crate::config::{Config, load};
use crate::dataset::ValidationGroup;
use crate::picture::chart::median_of_last;
use crate::run::checkpoint::{Checkpoint, CheckpointError};
use crate::run::folder::{CONFIG_FILE, RunDir};
use crate::run::lock::RunLock;
use crate::run::observer::History;
use crate::run::report::run_name;
use crate::run::validation::{Method, ratio};
use crate::system::paths::lossy;
use serde::Serialize;
use serde_json::Value;
use std::io;
use std::path::{Path, PathBuf};

/// A run that was found.
#[derive(Clone, Debug, Serialize)]
pub struct FoundRun {
    /// Name of its folder.
    pub name: String,
    /// The folder.
    #[serde(serialize_with = "lossy")]
    pub path: PathBuf,
    /// `"running"`, `"finished"` or `"stopped"`; `"unreadable"` where it is damaged.
    pub state: &'static str,
    /// What its files say.
    #[serde(flatten)]
    pub content: RunContent,
}

/// What the files of a run say.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum RunContent {
    /// How it went.
    Whole(RunSummary),
    /// The configuration or the checkpoints cannot be read.
    Unreadable {
        /// What is wrong.
        error: String,
    },
}

/// A run in a few numbers.
#[derive(Clone, Debug, Serialize)]
pub struct RunSummary {
    /// Steps logged.
    pub step: u64,
    /// Steps of the whole run.
    pub total_steps: u64,
    /// Name of the stage of the last step.
    pub stage: String,
    /// Median loss of the last 100 logged steps.
    pub loss: Option<f64>,
    /// Median time of the last 100 logged steps (s).
    pub seconds_per_step: Option<f64>,
    /// Steps skipped because loss or gradient was not finite.
    pub skipped: usize,
    /// Steps whose gradient norm was far above the usual one.
    pub spikes: usize,
    /// Step of the best validation.
    pub best_step: Option<u64>,
    /// Score of the best validation: mean total loss of the networks, mean over the groups.
    pub best_score: Option<f64>,
    /// Strain of the networks over that of skinning, last validation, single garments.
    pub strain_ratio: Option<f64>,
    /// Share of the vertices inside the body, last validation, single garments.
    pub inside: Option<f64>,
    /// Share of outer vertices that violate the layer order, last validation, layered outfits.
    pub order_violations: Option<f64>,
    /// Step of the newest whole checkpoint.
    pub checkpoint: Option<u64>,
    /// Seed.
    pub seed: u64,
}

impl FoundRun {
    /// Reads `root`; `None` if it is no run, which is a folder with checkpoints or the log of a run in it. A run whose
    /// configuration or checkpoints cannot be read is damaged.
    pub fn read(root: &Path) -> Option<Self> {
        if !MARKS.iter().any(|mark| root.join(mark).exists()) {
            return None;
        }
        let checkpoint = match Checkpoint::open(root) {
            Err(CheckpointError::Missing { .. }) => Ok(None),
            found => found.map(Some),
        };
        let config = load(&root.join(CONFIG_FILE), &[]).map_err(|error| error.to_string());
        let (state, content) = match (config, checkpoint) {
            (Ok(config), Ok(checkpoint)) => {
                let summary = RunSummary::read(root, &config, checkpoint.map(|c| c.state.step));
                (summary.state(root), RunContent::Whole(summary))
            }
            (Err(error), _) => ("unreadable", RunContent::Unreadable { error }),
            (_, Err(error)) => ("unreadable", RunContent::Unreadable { error: error.to_string() }),
        };
        Some(Self { name: run_name(root), path: root.to_owned(), state, content })
    }

    /// Score of the best validation, if there was one.
    pub fn best_score(&self) -> Option<f64> {
        match &self.content {
            RunContent::Whole(run) => run.best_score,
            RunContent::Unreadable { .. } => None,
        }
    }
}

/// What only a run has.
const MARKS: [&str; 3] = ["checkpoints", "lock", "metrics.jsonl"];
/// Logged steps whose median is shown.
const LAST_STEPS: usize = 100;

impl RunSummary {
    /// Reads the run in `root`, whose configuration is `config`; `checkpoint` is the step of its newest whole one.
    fn read(root: &Path, config: &Config, checkpoint: Option<u64>) -> Self {
        let history = History::read(&RunDir::follow(root)).unwrap_or_default();
        let (step, stage) = history.last.clone().unwrap_or_default();
        let (best_step, best_score) = history.best.unzip();
        let mut summary = Self {
            step,
            total_steps: config.total_steps(),
            stage,
            loss: median_of_last(history.points("loss"), LAST_STEPS),
            seconds_per_step: median_of_last(history.points("seconds"), LAST_STEPS),
            skipped: history.skipped.len(),
            spikes: history.spikes.len(),
            best_step,
            best_score,
            strain_ratio: None,
            inside: None,
            order_violations: None,
            checkpoint,
            seed: config.seed,
        };
        // Before the first step there is nothing to compare.
        let validations = history.validations.iter().filter(|(step, _)| *step > 0);
        for group in validations.flat_map(|(_, line)| line["groups"].as_array().into_iter().flatten()) {
            summary.note_group(group);
        }
        summary
    }

    /// Where the run in `root` stands.
    fn state(&self, root: &Path) -> &'static str {
        match RunLock::is_held(root) {
            true => "running",
            false if self.step.max(self.checkpoint.unwrap_or(0)) >= self.total_steps => "finished",
            false => "stopped",
        }
    }

    /// Takes in a group of a validation.
    fn note_group(&mut self, group: &Value) {
        let methods = group["methods"].as_array().map_or(&[][..], Vec::as_slice);
        let (Some(network), Some(skinning)) = (methods.last(), Method::start_of(methods)) else { return };
        if group["group"] == ValidationGroup::Layered.name() {
            self.order_violations = network["order_violations_nearest_vertex"].as_f64();
        } else if group["group"] == ValidationGroup::Single.name() {
            let strain = |m: &Value| m["raw"]["strain"]["mean"].as_f64();
            self.strain_ratio = strain(network).zip(strain(skinning)).and_then(|(a, b)| ratio(a, b));
            self.inside = network["inside"].as_f64();
        }
    }
}

/// All runs in `folder`: the folder itself, if it is a run, else those below it, by name.
///
/// # Errors
/// When the folder cannot be listed.
pub fn find_runs(folder: &Path) -> io::Result<Vec<FoundRun>> {
    // A folder of runs may have one that is called checkpoints.
    if folder.join(CONFIG_FILE).exists()
        && let Some(run) = FoundRun::read(folder)
    {
        return Ok(vec![run]);
    }
    let entries = std::fs::read_dir(folder)?.collect::<Result<Vec<_>, _>>()?;
    let mut paths: Vec<PathBuf> = entries.into_iter().map(|e| e.path()).filter(|p| p.is_dir()).collect();
    paths.sort();
    Ok(paths.iter().filter_map(|p| FoundRun::read(p)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "seed = 1\n[data]\n[[data.garments]]\ngenerate = { count = 2 }\n[[stages]]\nname = \"a\"\ntrains = \"single\"\nsteps = 1\n";

    #[test]
    fn damaged_runs_are_found_and_a_folder_that_is_not_there_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        for (name, config) in [("broken", Some("seed = ")), ("lost", None)] {
            std::fs::create_dir_all(folder.path().join(name).join("checkpoints")).unwrap();
            if let Some(config) = config {
                std::fs::write(folder.path().join(name).join(CONFIG_FILE), config).unwrap();
            }
        }
        let [cut, empty] = ["cut", "damaged/checkpoints/step-00000001"].map(|name| folder.path().join(name));
        [&cut, &empty].iter().for_each(|path| std::fs::create_dir_all(path).unwrap());
        std::fs::write(cut.join("lock"), "process 1\n").unwrap();
        std::fs::write(folder.path().join("damaged").join(CONFIG_FILE), SMALL).unwrap();
        std::fs::create_dir(folder.path().join("no run")).unwrap();
        let runs = find_runs(folder.path()).unwrap();
        assert_eq!(
            runs.iter().map(|run| run.name.as_str()).collect::<Vec<_>>(),
            ["broken", "cut", "damaged", "lost"]
        );
        let json = serde_json::to_value(&runs).unwrap();
        assert!((0..4).all(|i| json[i]["state"] == "unreadable"), "{json}");
        assert!(json[2]["error"].as_str().unwrap().contains("step-00000001: state.json"), "{json}");
        assert!(json[1]["error"].as_str().unwrap().contains("cannot read the configuration"), "{json}");
        assert_eq!(find_runs(&folder.path().join("broken")).unwrap().len(), 1);
        assert!(find_runs(&folder.path().join("no run")).unwrap().is_empty());
        let missing = find_runs(&folder.path().join("missing")).unwrap_err();
        assert_eq!(missing.kind(), io::ErrorKind::NotFound);
    }

    #[cfg(unix)]
    #[test]
    fn a_run_of_any_name_can_be_written_as_json() {
        use std::os::unix::ffi::OsStrExt;
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join(std::ffi::OsStr::from_bytes(b"run-\xff"));
        std::fs::create_dir_all(root.join("checkpoints")).unwrap();
        let broken = FoundRun::read(&root).unwrap();
        assert!(serde_json::to_string(&broken).unwrap().contains("run-\u{fffd}"));
        std::fs::write(root.join(CONFIG_FILE), SMALL).unwrap();
        let whole = FoundRun::read(&root).unwrap();
        assert!(matches!(whole.content, RunContent::Whole(_)), "{whole:?}");
        assert!(serde_json::to_string(&whole).unwrap().contains("run-\u{fffd}"));
    }
}
