//! `clothcombo eval`: the paper's tables on the user's data, speed against error, stability, pictures.
//!
//! Scenes are a pure function of the seed, the question and their number ([`crate::dataset::sample_evaluation`]): two models of the same
//! data are asked about the same bodies in the same clothes.

mod embeddings;
mod estimate;
mod extremes;
mod gallery;
mod layers;
mod methods;
mod numerics;
mod page;
mod pareto;
mod sections;
mod sets;
mod sizes;
mod subject;
mod table;
mod times;
mod variants;

pub use embeddings::EmbeddingStudy;
pub use estimate::{Estimate, Proportion, Ratio};
pub use extremes::Extreme;
pub use gallery::Picture;
pub use layers::LayerCount;
pub use methods::{CategoryResult, Comparison, MethodResult, Methods};
pub use numerics::NumericalChoice;
pub use page::{Page, Section};
pub use pareto::{Pareto, Point, Sample};
pub use sets::{DataSet, GarmentSet, Sets};
pub use sizes::Sizes;
pub use subject::Subject;
pub use table::Table;
pub use times::Times;
pub use variants::Variant;

use clothcombo_physics::contact::resolve::ResolveSettings;
use miette::Report;
use serde::Serialize;
use variants::VariantQuestion;

/// A further model, with what it is called.
pub struct Other {
    /// Its name in tables.
    pub name: String,
    /// The model and its data.
    pub subject: Subject,
}

/// Everything that was found.
#[derive(Serialize)]
pub struct Study {
    /// How many scenes every question got.
    pub sizes: Sizes,
    /// Seed of the scenes.
    pub seed: u64,
    /// What is in which set.
    pub sets: Sets,
    /// Table 2: every set of garments and poses by itself.
    pub methods: Vec<Methods>,
    /// Table 1: training garments, and test garments.
    pub embeddings: Vec<EmbeddingStudy>,
    /// Table 3.
    pub layers: Vec<LayerCount>,
    /// Table 4, if there are ablations; the model itself first.
    pub ablations: Vec<Variant>,
    /// Garment-specific models, each after the model itself on the same garment.
    pub specific: Vec<[Variant; 2]>,
    /// Table 5.
    pub times: Times,
    /// Speed against error.
    pub pareto: Pareto,
    /// Precision, eigenpairs, distance to the body.
    pub numerics: Vec<NumericalChoice>,
    /// Far outside of what was trained on.
    pub extremes: Vec<Extreme>,
    /// Pictures.
    #[serde(skip)]
    pub pictures: Vec<Picture>,
}

/// Told of progress: steps done of all, and what is measured now.
pub type Progress<'a> = &'a (dyn Fn(Option<&str>, usize) + Sync);

/// Asks `subject` everything. `ablations` are models trained with a part left out on the same data; `specific` ones were
/// trained on a single garment that `subject` knows too. `progress` is called with the name of every part and the number of
/// all steps as it begins, and with `None` after each step.
///
/// # Errors
/// When a scene cannot be draped, or a chart not drawn.
pub fn study(
    subject: &Subject,
    ablations: &[Other],
    specific: &[Other],
    sizes: Sizes,
    progress: Progress<'_>,
) -> Result<Study, Report> {
    let variant_count = if ablations.is_empty() { 0 } else { ablations.len() + 1 } + 2 * specific.len();
    let dataset = &subject.dataset;
    let (method_questions, embedding_questions) = (sizes.methods(dataset), sizes.embeddings(dataset));
    let single_garments = method_questions.iter().chain(&embedding_questions).map(|q| q.scenes).sum();
    let steps = sizes.progress_steps(single_garments, variant_count);
    let settings = ResolveSettings { steps: sizes.way_steps, ..ResolveSettings::default() };
    let begin = |part: &str| progress(Some(part), steps);
    let done = || progress(None, steps);

    begin("Table 2: methods");
    let mut methods = Vec::new();
    for question in &method_questions {
        methods.push(methods::ask(subject, question, &done)?);
    }

    begin("Table 1: embeddings");
    let mut embeddings = Vec::new();
    for question in &embedding_questions {
        embeddings.push(embeddings::ask(subject, question, &done)?);
    }

    begin("Table 3: layers");
    let mut layers = Vec::new();
    for count in (1..=6).chain([7, 8, 12]) {
        let scenes = if count <= 6 { sizes.layered } else { sizes.many_layers };
        layers.push(layers::ask(subject, 100 + count, count, scenes, &settings, &done)?);
    }

    begin("Table 4: ablations");
    let mut found = Vec::new();
    if !ablations.is_empty() {
        let question = VariantQuestion { number: 5, garments: None, layers: [1, 4], scenes: sizes.variants };
        found.push(variants::ask(subject, "this model", &question, &done)?);
        for other in ablations {
            found.push(variants::ask(&other.subject, &other.name, &question, &done)?);
        }
    }
    let mut pairs = Vec::new();
    for (i, other) in specific.iter().enumerate() {
        let garments = &other.subject.dataset.garments;
        let names: Vec<String> = (0..garments.len()).map(|g| garments.info(g).name.clone()).collect();
        let question = VariantQuestion {
            number: 200 + i,
            garments: Some(&names),
            layers: [1, 1],
            scenes: sizes.variants,
        };
        pairs.push([
            variants::ask(subject, &format!("this model on {}", names.join(", ")), &question, &done)?,
            variants::ask(&other.subject, &other.name, &question, &done)?,
        ]);
    }

    begin("Table 5: times");
    let times = times::ask(subject, 6, sizes.times, &settings, &done)?;
    begin("speed against error");
    let pareto = pareto::ask(subject, 7, sizes.pareto, &settings, &done)?;
    begin("numerical choices");
    let numerics = numerics::ask(subject, 14, sizes.pareto)?;
    begin("stability");
    let extremes = extremes::ask(subject, 8, sizes.extremes, &settings, &done)?;
    begin("pictures");
    let pictures = if sizes.gallery { gallery::draw(subject, 9, &done)? } else { Vec::new() };
    Ok(Study {
        sizes,
        seed: subject.config.validation_seed(),
        sets: Sets::of(subject),
        methods,
        embeddings,
        layers,
        ablations: found,
        specific: pairs,
        times,
        pareto,
        numerics,
        extremes,
        pictures,
    })
}
