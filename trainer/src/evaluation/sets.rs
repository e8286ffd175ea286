//! The sets of garments and poses that an evaluation keeps apart: what was trained on, what validation looked at, and the test
//! set, which no run reads.

use super::{Evaluator, Section, Table};
use crate::dataset::{Dataset, HeldOut, SceneSample, round_robin};
use crate::run::report::table::{Column, plain};
use miette::Report;
use serde::Serialize;
use serde_json::json;

/// Garments of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum GarmentSet {
    /// Trained on.
    Training,
    /// Unseen in training; scored by every validation of the run.
    Validation,
    /// Read by no run.
    Test,
    /// Those of the test garments that come neither from this project's generator nor from helper meshes of the body, as many
    /// of the training garments do.
    IndependentTest,
}

impl GarmentSet {
    /// The garments, as indices into the dataset.
    fn garments(self, dataset: &Dataset) -> Vec<usize> {
        let is_independent = |garment: &usize| !dataset.garments.info(*garment).source.is_made_here();
        let split = &dataset.split;
        match self {
            Self::Training => split.training.clone(),
            Self::Validation => split.validation.clone(),
            Self::Test => split.test.clone(),
            Self::IndependentTest => split.test.iter().copied().filter(is_independent).collect(),
        }
    }
}

/// Garments of one kind in poses of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct SceneSet {
    pub garments: GarmentSet,
    pub poses: HeldOut,
}

impl SceneSet {
    /// What it is called.
    pub fn title(self, dataset: &Dataset) -> String {
        let garments = match self.garments {
            GarmentSet::Training => "Training garments",
            GarmentSet::Validation => "Validation garments",
            GarmentSet::Test => "Test garments",
            GarmentSet::IndependentTest => "Independent test garments",
        };
        let poses = match self.poses {
            HeldOut::Windows if dataset.poses.frame_counts().is_none() => "sampled poses",
            HeldOut::Windows => "held-out windows",
            HeldOut::ValidationClips => "validation clips",
            HeldOut::TestClips => "test clips",
        };
        format!("{garments}, {poses}")
    }
}

/// Scenes of one garment each.
pub struct Scenes {
    /// Their random stream.
    stream: usize,
    pub set: SceneSet,
    /// The garments, as indices into the dataset.
    pub pool: Vec<usize>,
    pub count: usize,
}

impl Scenes {
    /// Those of `sets` (random stream, garments, poses, number of scenes) that the data has garments and poses for.
    pub fn of(evaluator: &Evaluator<'_>, sets: &[(usize, GarmentSet, HeldOut, usize)]) -> Vec<Self> {
        let dataset = &evaluator.model.dataset;
        let scenes = |&(stream, garments, poses, count): &(usize, GarmentSet, HeldOut, usize)| {
            let pool = garments.garments(dataset);
            let is_there = dataset.poses.has(poses) && !pool.is_empty() && count > 0;
            is_there.then_some(Self { stream, set: SceneSet { garments, poses }, pool, count })
        };
        sets.iter().filter_map(scenes).collect()
    }

    /// The scenes; garments are round-robin.
    pub fn samples(&self, evaluator: &Evaluator<'_>) -> Vec<SceneSample> {
        let sample = |i: usize| {
            let garment = &self.pool[round_robin(i, self.count, self.pool.len())..][..1];
            evaluator.model.sample([self.stream, i], garment, 1, self.set.poses)
        };
        (0..self.count).map(sample).collect()
    }
}

/// What is in the sets of the model's data.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    let model = evaluator.model;
    let split = model.dataset.split_names();
    let independent = model.names(&GarmentSet::IndependentTest.garments(&model.dataset));
    // Time between a held-out window and the nearest frame that was trained on (s); none where poses are sampled.
    let margin = model.dataset.poses.frame_counts().map(|_| model.config.data.poses.held_out_margin);
    let windows_name = match margin {
        Some(margin) if margin > 0.0 => {
            format!(
                "held-out windows of the training clips, {margin} s from the nearest frame that was trained on"
            )
        }
        _ => "held-out windows of the training clips; the frames next to them were trained on".to_owned(),
    };
    let windows = split.validation_windows.iter();
    let windows: Vec<String> =
        windows.map(|w| format!("{} {:.1}–{:.1} s", w.clip, w.seconds[0], w.seconds[1])).collect();
    let independent_name = "independent test garments (of the test garments, those that are neither generated nor cut from helper meshes)";
    let run = "every validation of the run (choice of the best checkpoint, pictures)";
    let evaluation = "this evaluation only";
    let row = |set: &str, names: &[String], read_by: &str| {
        // The training garments are too many to be listed.
        let which = if set == "training garments" { String::new() } else { names.join(", ") };
        json!({ "set": set, "number": names.len(), "read_by": read_by, "which": which })
    };
    let mut rows = vec![
        row("training garments", &split.training_garments, "training, validation"),
        row("validation garments", &split.validation_garments, run),
        row("test garments", &split.test_garments, evaluation),
        row(independent_name, &independent, evaluation),
    ];
    if margin.is_some() {
        rows.extend([
            row("training clips", &split.training_clips, "training"),
            row(&windows_name, &windows, run),
            row("validation clips", &split.validation_clips, run),
            row("test clips", &split.test_clips, evaluation),
        ]);
    }
    let columns: [Column<'_>; 4] = [
        ("set", "/set", plain),
        ("number", "/number", plain),
        ("read by", "/read_by", plain),
        ("which", "/which", plain),
    ];
    let table = Table::new("What is in which set", &rows, &columns);
    let mut numbers = json!(split);
    numbers["independent_test_garments"] = json!(independent);
    numbers["held_out_margin"] = json!(margin);
    let text = "A run trains on the training set and scores the validation set; only this evaluation reads the test set. Bodies have random shapes \
                within the range of the configuration.";
    Ok(vec![Section::new("sets", "Sets", text, numbers, vec![table])])
}
