//! What the parts of an evaluation share.

use super::drape_metrics::{DrapeMetrics, measure};
use super::model_under_test::ModelUnderTest;
use super::post_processor::PostProcessor;
use super::scene_evaluation::evaluate;
use crate::dataset::{PreparedScene, SceneSample};
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::inference::tensor_store::DrapeError;
use clothcombo_physics::contact::resolve::ResolveSettings;
use serde::Serialize;
use std::path::Path;

/// How many scenes every part gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct SceneCounts {
    /// Single training garments in held-out windows.
    pub(super) single_garments: usize,
    /// Single training garments in validation clips, and the same in test clips.
    pub(super) clips: usize,
    /// Single validation garments in held-out windows.
    pub(super) validation_garments: usize,
    /// Single test garments in held-out windows, and the same in test clips.
    pub(super) test_garments: usize,
    /// The independent ones among them in held-out windows.
    pub(super) independent_garments: usize,
    /// Wrong embeddings, per kind of garment.
    pub(super) embeddings: usize,
    /// Outfits per number of layers up to 6, and how many of them go through the post-process, which takes seconds.
    pub(super) layered: [usize; 2],
    /// The same for 7, 8 and 12 layers.
    pub(super) many_layers: [usize; 2],
    /// Most steps of the post-process on its continuation path from the T-pose.
    pub(super) continuation_steps: usize,
    /// Random outfits whose certificates are counted.
    pub(super) outfits: usize,
    /// Scenes per further model.
    pub(super) variants: usize,
    /// Outfits that are timed.
    pub(super) timed: usize,
    /// Scenes of speed against error: of one garment, and outfits.
    pub(super) pareto: [usize; 2],
    /// Scenes per stress test.
    pub(super) stress_tests: usize,
    /// Whether pictures are drawn.
    pub(super) gallery: bool,
}

impl SceneCounts {
    /// The whole evaluation, or, if `quick`, just enough to see that everything works; with certificates of `outfits` random
    /// outfits.
    pub fn new(quick: bool, outfits: usize) -> Self {
        let count = |full: usize, few: usize| if quick { few } else { full };
        Self {
            single_garments: count(500, 24),
            clips: count(200, 12),
            validation_garments: count(100, 12),
            test_garments: count(200, 12),
            independent_garments: count(120, 6),
            embeddings: count(100, 8),
            layered: [count(24, 2), count(12, 1)],
            many_layers: [count(8, 1), count(2, 1)],
            continuation_steps: count(32, 0),
            outfits,
            variants: count(100, 8),
            timed: count(20, 3),
            pareto: [count(10, 2), count(6, 1)],
            stress_tests: count(3, 1),
            gallery: !quick,
        }
    }
}

/// A further model, with what it is called in tables.
pub struct NamedModel {
    /// Its name.
    pub name: String,
    /// The model and its data.
    pub model: ModelUnderTest,
}

/// Called with the name of every part as it begins, and the number of all scenes; and with `None` after each scene.
pub type Progress<'a> = &'a (dyn Fn(Option<(&str, usize)>) + Sync);

/// A model, its networks and the post-process, and how many scenes it is evaluated on.
pub struct Evaluator<'a> {
    pub model: &'a ModelUnderTest,
    pub networks: &'a Networks<'a>,
    pub post_process: PostProcessor<'a>,
    /// How the post-process runs.
    pub settings: ResolveSettings,
    /// Models trained with a part left out on the same data.
    pub ablations: &'a [NamedModel],
    /// Models trained on a single garment.
    pub specific: &'a [NamedModel],
    pub counts: SceneCounts,
    /// Folder that random outfits are saved under.
    pub meshes: Option<&'a Path>,
    pub progress: Progress<'a>,
}

impl Evaluator<'_> {
    /// Moves the progress on by a scene.
    pub fn scene_done(&self) {
        (self.progress)(None);
    }

    /// Measures the drapes that `drape` makes of scenes of `model`: per scene, per drape.
    pub fn measure(
        &self,
        model: &ModelUnderTest,
        samples: &[SceneSample],
        drape: impl FnMut(&PreparedScene) -> Result<Vec<Draped>, DrapeError>,
    ) -> Result<Vec<Vec<DrapeMetrics>>, DrapeError> {
        let measured = |scene: &PreparedScene, drapes: &[Draped]| {
            let measured = measure(scene, drapes);
            self.scene_done();
            measured
        };
        evaluate(samples, |sample| model.prepare(sample), drape, measured)
    }
}
