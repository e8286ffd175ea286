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
mod table;
mod timing;
mod validation;
mod variants;

pub use evaluator::{NamedModel, Progress, SceneCounts};
pub use model_under_test::ModelUnderTest;
pub use page::Page;
pub use timing::median_ms;
pub use validation::ValidationSet;

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
use table::Table;

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
struct Part {
    /// What `--only` calls it.
    key: &'static str,
    name: &'static str,
    /// Number of its scenes.
    scenes: fn(&Evaluator<'_>) -> usize,
    /// What it finds.
    sections: fn(&Evaluator<'_>) -> Result<Vec<Section>, Report>,
}

const PARTS: [Part; 11] = [
    Part { key: "sets", name: "sets", scenes: |_| 0, sections: sets::sections },
    Part {
        key: "methods",
        name: "Table 2: methods",
        scenes: methods::scene_count,
        sections: methods::sections,
    },
    Part {
        key: "embeddings",
        name: "Table 1: embeddings",
        scenes: embeddings::scene_count,
        sections: embeddings::sections,
    },
    Part { key: "layers", name: "Table 3: layers", scenes: layers::scene_count, sections: layers::sections },
    Part {
        key: "certificates",
        name: "certificates of random outfits",
        scenes: |e| e.counts.outfits,
        sections: certificates::sections,
    },
    Part {
        key: "ablations",
        name: "Table 4: ablations",
        scenes: variants::scene_count,
        sections: variants::sections,
    },
    Part {
        key: "times",
        name: "Table 5: times",
        scenes: |e| e.counts.timed,
        sections: drape_times::sections,
    },
    Part {
        key: "pareto",
        name: "speed against error",
        scenes: pareto::scene_count,
        sections: pareto::sections,
    },
    Part { key: "numerics", name: "numerical choices", scenes: |_| 0, sections: numerics::sections },
    Part {
        key: "stress",
        name: "stress tests",
        scenes: stress_tests::scene_count,
        sections: stress_tests::sections,
    },
    Part { key: "gallery", name: "pictures", scenes: gallery::picture_count, sections: gallery::sections },
];

/// Names of the parts of an evaluation, in their order.
pub const PART_KEYS: [&str; PARTS.len()] = {
    let mut keys = [""; PARTS.len()];
    let mut part = 0;
    while part < PARTS.len() {
        keys[part] = PARTS[part].key;
        part += 1;
    }
    keys
};

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
        let parts = || PARTS.iter().filter(|part| is_wanted(part.key));
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
