//! Evaluation. In: a trained model and a dataset. Out: scores of scenes, tables, figures and pages, of what the losses say and of
//! what can be counted.
//!
//! [`Evaluation`] is what `clothcombo eval` reports: the paper's tables on the user's data, speed against error, stress tests,
//! pictures. Its scenes are a pure function of the seed, their random stream and their number
//! ([`crate::dataset::sample_evaluation`]): two models of the same data get the same garments on the same bodies.

mod certificates;
mod drape_metrics;
mod drape_times;
mod embeddings;
mod equilibrium_error;
mod estimate;
mod evaluator;
mod gallery;
mod layers;
mod methods;
mod model_under_test;
mod numerics;
mod page;
mod pareto;
mod post_processor;
pub mod sample_picture;
mod scene_evaluation;
mod score;
mod sets;
mod stress_tests;
mod timing;
mod validation;
mod variants;

pub use evaluator::{NamedModel, Progress, SceneCounts};
pub use model_under_test::ModelUnderTest;
pub use page::EvaluationPage;
pub use score::weighted_terms;
pub use timing::median_ms;
pub use validation::ValidationSet;

use crate::run::report::table::Table;
use clothcombo_physics::contact::resolve::ResolveSettings;
use drape_metrics::{DrapeMetrics, PAPER_COLLISION, estimates};
use estimate::{Estimate, Metric, Proportion, Ratio};
use evaluator::Evaluator;
use miette::Report;
use page::Section;
use post_processor::PostProcessor;
use scene_evaluation::drape_by;
use serde_json::{Value, json};
use sets::{GarmentSet, Scenes};
use std::path::Path;

/// Everything that was measured of a model.
pub struct Evaluation {
    /// How many scenes every part got.
    counts: SceneCounts,
    /// Seed of the scenes.
    pub seed: u64,
    /// What was found, in the order of the paper.
    pub sections: Vec<Section>,
}

/// A part of an evaluation.
struct EvaluationPart {
    /// What `--only` calls it.
    key: &'static str,
    name: &'static str,
    /// Number of its scenes.
    scenes: fn(&Evaluator<'_>) -> usize,
    /// What it finds.
    sections: fn(&Evaluator<'_>) -> Result<Vec<Section>, Report>,
}

const EVALUATION_PARTS: [EvaluationPart; 11] = [
    part("sets", "sets", |_| 0, sets::sections),
    part("methods", "Table 2: methods", methods::scene_count, methods::sections),
    part("embeddings", "Table 1: embeddings", embeddings::scene_count, embeddings::sections),
    part("layers", "Table 3: layers", layers::scene_count, layers::sections),
    part("certificates", "certificates of random outfits", |e| e.counts.outfits, certificates::sections),
    part("ablations", "Table 4: ablations", variants::scene_count, variants::sections),
    part("times", "Table 5: times", |e| e.counts.timed, drape_times::sections),
    part("pareto", "speed against error", |e| e.counts.pareto.iter().sum(), pareto::sections),
    part("numerics", "numerical choices", |_| 0, numerics::sections),
    part("stress", "stress tests", stress_tests::scene_count, stress_tests::sections),
    part("gallery", "pictures", gallery::picture_count, gallery::sections),
];

const fn part(
    key: &'static str,
    name: &'static str,
    scenes: fn(&Evaluator<'_>) -> usize,
    sections: fn(&Evaluator<'_>) -> Result<Vec<Section>, Report>,
) -> EvaluationPart {
    EvaluationPart { key, name, scenes, sections }
}

/// Names of the parts of an evaluation, in their order.
pub fn part_keys() -> impl Iterator<Item = &'static str> {
    EVALUATION_PARTS.iter().map(|part| part.key)
}

impl Evaluation {
    /// Measures `model` by the parts whose keys `is_wanted`. `ablations` are models trained with a part left out on the same
    /// data; `specific` ones were trained on a single garment that `model` knows too. Random outfits are saved under `meshes`.
    ///
    /// # Errors
    /// When a scene cannot be draped or resolved, or a chart not drawn.
    pub fn run(
        model: &ModelUnderTest,
        ablations: &[NamedModel],
        specific: &[NamedModel],
        counts: SceneCounts,
        meshes: Option<&Path>,
        is_wanted: &dyn Fn(&str) -> bool,
        progress: Progress<'_>,
    ) -> Result<Self, Report> {
        let networks = model.networks();
        let evaluator = Evaluator {
            model,
            networks: &networks,
            post_process: PostProcessor::new(model),
            settings: ResolveSettings { steps: counts.continuation_steps, ..ResolveSettings::default() },
            ablations,
            specific,
            counts,
            meshes,
            progress,
        };
        let parts = || EVALUATION_PARTS.iter().filter(|part| is_wanted(part.key));
        let scenes = parts().map(|part| (part.scenes)(&evaluator)).sum();
        let mut sections = Vec::new();
        for part in parts() {
            progress(Some((part.name, scenes)));
            sections.extend((part.sections)(&evaluator)?);
        }
        Ok(Self { counts, seed: model.config.validation_seed(), sections })
    }

    /// Every number, by part.
    pub fn numbers(&self) -> Value {
        let mut numbers = json!({ "counts": self.counts, "seed": self.seed });
        for section in self.sections.iter().filter(|section| !section.numbers.is_null()) {
            numbers[section.key] = section.numbers.clone();
        }
        numbers
    }
}
