//! How many scenes every question of an evaluation gets, and which sets of the data are asked about.

use super::extremes;
use super::gallery;
use super::methods::Question;
use super::sets::{DataSet, GarmentSet};
use crate::dataset::{Dataset, HeldOut};
use serde::Serialize;

/// How many scenes every question gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Sizes {
    /// Single training garments in held-out windows.
    pub single: usize,
    /// Single training garments in validation clips, and the same in test clips.
    pub clips: usize,
    /// Single validation garments in held-out windows.
    pub validation_garments: usize,
    /// Single test garments in held-out windows, and the same in test clips.
    pub test_garments: usize,
    /// The independent ones among them in held-out windows.
    pub independent_garments: usize,
    /// Wrong embeddings, per kind of garment.
    pub embeddings: usize,
    /// Outfits per number of layers up to 6, and how many of them go through the post-process, which takes seconds.
    pub layered: [usize; 2],
    /// The same for 7, 8 and 12 layers.
    pub many_layers: [usize; 2],
    /// Most steps of the post-process on the way from the T-pose.
    pub way_steps: usize,
    /// Scenes per further model.
    pub variants: usize,
    /// Outfits that are timed.
    pub times: usize,
    /// Scenes of speed against error.
    pub pareto: usize,
    /// Scenes per extreme case.
    pub extremes: usize,
    /// Whether pictures are drawn.
    pub gallery: bool,
}

impl Sizes {
    /// The whole evaluation.
    pub const FULL: Self = Self {
        single: 500,
        clips: 200,
        validation_garments: 100,
        test_garments: 200,
        independent_garments: 120,
        embeddings: 100,
        layered: [24, 12],
        many_layers: [8, 2],
        way_steps: 32,
        variants: 100,
        times: 20,
        pareto: 10,
        extremes: 3,
        gallery: true,
    };
    /// Enough to see that everything works.
    pub const QUICK: Self = Self {
        single: 24,
        clips: 12,
        validation_garments: 12,
        test_garments: 12,
        independent_garments: 6,
        embeddings: 8,
        layered: [2, 1],
        many_layers: [1, 1],
        way_steps: 0,
        variants: 8,
        times: 3,
        pareto: 2,
        extremes: 1,
        gallery: false,
    };

    /// Steps of the progress bar, of which the questions about single garments take so many.
    pub(super) fn progress_steps(&self, single_garments: usize, variants: usize) -> usize {
        single_garments
            + 6 * self.layered[0]
            + 3 * self.many_layers[0]
            + variants * self.variants
            + self.times
            + self.pareto
            + extremes::case_count() * self.extremes
            + if self.gallery { gallery::COUNT } else { 0 }
    }

    /// Table 2: every set by itself, since only the last ones were read by no run. Numbers stay with their set, so that its
    /// scenes stay the same.
    pub(super) fn methods(&self, dataset: &Dataset) -> Vec<Question> {
        use GarmentSet::{IndependentTest, Test, Training, Validation};
        use HeldOut::{TestClips, ValidationClips, Windows};
        let questions = [
            (0, Training, Windows, self.single),
            (1, Training, ValidationClips, self.clips),
            (10, Training, TestClips, self.clips),
            (11, Validation, Windows, self.validation_garments),
            (2, Test, Windows, self.test_garments),
            (12, IndependentTest, Windows, self.independent_garments),
            (13, Test, TestClips, self.test_garments),
        ];
        Self::asked(&questions, dataset)
    }

    /// Table 1.
    pub(super) fn embeddings(&self, dataset: &Dataset) -> Vec<Question> {
        let garments = [(3, GarmentSet::Training), (4, GarmentSet::Test)];
        Self::asked(&garments.map(|(number, set)| (number, set, HeldOut::Windows, self.embeddings)), dataset)
    }

    /// Those that the data has garments and poses for.
    fn asked(questions: &[(usize, GarmentSet, HeldOut, usize)], dataset: &Dataset) -> Vec<Question> {
        let question = |&(number, garments, poses, scenes): &(usize, GarmentSet, HeldOut, usize)| {
            Question::new(number, DataSet { garments, poses }, scenes, dataset)
        };
        questions.iter().filter_map(question).collect()
    }
}
