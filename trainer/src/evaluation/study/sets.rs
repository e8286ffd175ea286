//! The sets of garments and poses that an evaluation keeps apart: what was trained on, what validation looked at, and the test
//! set, which no run reads.

use super::subject::Subject;
use super::table::Table;
use crate::dataset::{Dataset, HeldOut, SplitNames};
use serde::Serialize;

/// Garments of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum GarmentSet {
    /// Trained on.
    Training,
    /// Never trained on; scored by every validation of the run.
    Validation,
    /// Read by no run.
    Test,
    /// Those of the test garments that come neither from this project's generator nor from helper meshes of the body, as many
    /// of the training garments do.
    IndependentTest,
}

impl GarmentSet {
    /// All kinds, in the order of the report.
    pub const ALL: [Self; 4] = [Self::Training, Self::Validation, Self::Test, Self::IndependentTest];

    /// Name in titles.
    fn name(self) -> &'static str {
        match self {
            Self::Training => "Training garments",
            Self::Validation => "Validation garments",
            Self::Test => "Test garments",
            Self::IndependentTest => "Independent test garments",
        }
    }

    /// The garments, as indices into the wardrobe.
    pub fn garments(self, dataset: &Dataset) -> Vec<usize> {
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

/// Name in titles.
fn name_of_poses(poses: HeldOut, dataset: &Dataset) -> &'static str {
    match poses {
        HeldOut::Windows if dataset.poses.frame_counts().is_none() => "sampled poses",
        HeldOut::Windows => "held-out windows",
        HeldOut::ValidationClips => "validation clips",
        HeldOut::TestClips => "test clips",
    }
}

/// Garments of one kind in poses of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct DataSet {
    /// The garments.
    pub garments: GarmentSet,
    /// The poses.
    pub poses: HeldOut,
}

impl DataSet {
    /// What it is called.
    pub fn title(self, dataset: &Dataset) -> String {
        format!("{}, {}", self.garments.name(), name_of_poses(self.poses, dataset))
    }

    /// Its garments; none where there are none of its poses.
    pub fn pool(self, dataset: &Dataset) -> Vec<usize> {
        if dataset.poses.has(self.poses) { self.garments.garments(dataset) } else { Vec::new() }
    }
}

/// What is in the sets of a model's data.
#[derive(Clone, Debug, Serialize)]
pub struct Sets {
    /// Garments and clips of every set by name.
    #[serde(flatten)]
    pub split: SplitNames,
    /// The test garments that come neither from the generator nor from helper meshes.
    pub independent_test_garments: Vec<String>,
    /// Time between a held-out window and the nearest frame that was trained on [s]; none where poses are sampled.
    pub held_out_margin: Option<f64>,
}

impl Sets {
    /// Of the data of `subject`.
    pub fn of(subject: &Subject) -> Self {
        let dataset = &subject.dataset;
        let independent = GarmentSet::IndependentTest.garments(dataset);
        Self {
            split: dataset.split_names(),
            independent_test_garments: independent
                .into_iter()
                .map(|garment| dataset.garments.info(garment).name.clone())
                .collect(),
            held_out_margin: dataset.poses.frame_counts().map(|_| subject.config.data.poses.held_out_margin),
        }
    }

    /// As a table.
    pub fn table(&self) -> Table {
        let mut table = Table::new("What is in which set", &["set", "number", "read by", "which"]);
        let split = &self.split;
        let run = "every validation of the run (choice of the best checkpoint, pictures)";
        let mut row = |set: &str, names: &[String], read_by: &str, listed: bool| {
            let which = if listed { names.join(", ") } else { String::new() };
            table.rows.push(vec![set.into(), names.len().to_string(), read_by.into(), which]);
        };
        row("training garments", &split.training_garments, "training, validation", false);
        row("validation garments", &split.validation_garments, run, true);
        row("test garments", &split.test_garments, "this evaluation only", true);
        row(
            "independent test garments (of the test garments, those that are neither generated nor cut from helper meshes)",
            &self.independent_test_garments,
            "this evaluation only",
            true,
        );
        if let Some(margin) = self.held_out_margin {
            let windows: Vec<String> = split
                .validation_windows
                .iter()
                .map(|window| format!("{} {:.1}–{:.1} s", window.clip, window.seconds[0], window.seconds[1]))
                .collect();
            row("training clips", &split.training_clips, "training", true);
            let name = match margin > 0.0 {
                true => format!(
                    "held-out windows of the training clips, {margin} s from the nearest frame that was trained on"
                ),
                false => "held-out windows of the training clips; the frames next to them were trained on"
                    .to_owned(),
            };
            row(&name, &windows, run, true);
            row("validation clips", &split.validation_clips, run, true);
            row("test clips", &split.test_clips, "this evaluation only", true);
        }
        table
    }
}
