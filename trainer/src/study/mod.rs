//! `clothcombo eval`: the paper's tables on the user's data, speed against error, stability, pictures.
//!
//! Scenes are a pure function of the seed, the question and their number ([`crate::scene::draw_study`]): two models of the same
//! data are asked about the same bodies in the same clothes.

mod embeddings;
mod estimate;
mod extremes;
mod gallery;
mod layers;
mod methods;
mod page;
mod pareto;
mod subject;
mod table;
mod times;
mod variants;

pub use embeddings::EmbeddingStudy;
pub use estimate::{Estimate, Ratio};
pub use extremes::Extreme;
pub use gallery::Picture;
pub use layers::LayerCount;
pub use methods::{CategoryResult, Comparison, MethodResult, Methods};
pub use page::{Page, Section};
pub use pareto::{Pareto, Point, Sample};
pub use subject::Subject;
pub use table::Table;
pub use times::Times;
pub use variants::Variant;

use crate::picture::{draw_lines, png_bytes};
use crate::scene::Unseen;
use clothcombo_physics::contact::resolve::ResolveSettings;
use methods::Question;
use miette::{IntoDiagnostic, Report};
use serde::Serialize;
use variants::VariantQuestion;

/// How many scenes every question gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Sizes {
    /// Single garments in poses held out of the trained clips.
    pub single: usize,
    /// Single garments in clips never trained on.
    pub unseen_clips: usize,
    /// Garments never trained on.
    pub unseen_garments: usize,
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
        unseen_clips: 200,
        unseen_garments: 200,
        embeddings: 100,
        layered: [24, 6],
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
        unseen_clips: 12,
        unseen_garments: 12,
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

    /// Steps of the progress bar.
    fn progress_steps(&self, variants: usize) -> usize {
        self.single
            + self.unseen_clips
            + self.unseen_garments
            + 2 * self.embeddings
            + 6 * self.layered[0]
            + 3 * self.many_layers[0]
            + variants * self.variants
            + self.times
            + self.pareto
            + extremes::case_count() * self.extremes
            + if self.gallery { gallery::COUNT } else { 0 }
    }
}

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
    /// Table 2: trained garments in held-out poses, in unseen clips, and garments never trained on.
    pub methods: Vec<Methods>,
    /// Table 1: trained garments, and garments never trained on.
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
    let steps = sizes.progress_steps(variant_count);
    let settings = ResolveSettings { steps: sizes.way_steps, ..ResolveSettings::default() };
    let begin = |part: &str| progress(Some(part), steps);
    let done = || progress(None, steps);

    begin("Table 2: methods");
    let split = &subject.library.split;
    let unseen_garments: Vec<usize> = split.test.iter().chain(&split.validation).copied().collect();
    let question = |number, title: &str, pool, unseen, scenes| Question {
        number,
        title: title.into(),
        pool,
        unseen,
        scenes,
    };
    let clips = if subject.library.poses.has_unseen_clips() { sizes.unseen_clips } else { 0 };
    let questions = [
        question(0, "Trained garments, held-out poses", &split.training, Unseen::Poses, sizes.single),
        question(1, "Trained garments, clips never trained on", &split.training, Unseen::Clips, clips),
        question(2, "Garments never trained on", &unseen_garments, Unseen::Poses, sizes.unseen_garments),
    ];
    let mut methods = Vec::new();
    for question in questions.iter().filter(|q| q.scenes > 0 && !q.pool.is_empty()) {
        methods.push(methods::ask(subject, question, &done)?);
    }

    begin("Table 1: embeddings");
    let questions = [
        question(3, "Trained garments", &split.training, Unseen::Poses, sizes.embeddings),
        question(4, "Garments never trained on", &unseen_garments, Unseen::Poses, sizes.embeddings),
    ];
    let mut embeddings = Vec::new();
    for question in questions.iter().filter(|q| !q.pool.is_empty()) {
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
        let wardrobe = &other.subject.library.wardrobe;
        let names: Vec<String> = (0..wardrobe.len()).map(|g| wardrobe.card(g).name.clone()).collect();
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
    begin("stability");
    let extremes = extremes::ask(subject, 8, sizes.extremes, &settings, &done)?;
    begin("pictures");
    let pictures = if sizes.gallery { gallery::draw(subject, 9, &done)? } else { Vec::new() };
    Ok(Study {
        sizes,
        seed: subject.config.validation_seed(),
        methods,
        embeddings,
        layers,
        ablations: found,
        specific: pairs,
        times,
        pareto,
        extremes,
        pictures,
    })
}

impl Study {
    /// The parts of the report, in the order of the paper.
    ///
    /// # Errors
    /// When a chart cannot be drawn.
    pub fn sections(&self) -> Result<Vec<Section>, Report> {
        let section = |title: &str, text: &str, tables: Vec<Table>| Section {
            title: title.into(),
            text: text.into(),
            tables,
            pictures: Vec::new(),
        };
        let methods =
            self.methods.iter().enumerate().flat_map(|(i, methods)| methods.tables(i == 0)).collect();
        let mut sections = vec![
            section(
                "Networks and skinning (Table 2)",
                "LBS of rest is the paper's baseline: smoothed nearest weights, body shape ignored. LBS adds shape transfer, where the networks start.",
                methods,
            ),
            section("Embeddings (Table 1)", "", self.embeddings.iter().map(EmbeddingStudy::table).collect()),
            section(
                "Layers (Table 3)",
                "Garments of the whole wardrobe in random order, shapes and poses never trained on.",
                layers::tables(&self.layers),
            ),
        ];
        if !self.ablations.is_empty() {
            let note = "Means (medians) over outfits of 1 to 4 garments, the same for every model; before the post-process. Wrong side by the nearest vertex.";
            let table = variants::table("Ablations", note, &self.ablations, true);
            sections.push(section("Ablations (Table 4)", "", vec![table]));
        }
        if !self.specific.is_empty() {
            let all: Vec<Variant> = self.specific.iter().flatten().cloned().collect();
            let note = "Means (medians) over the same bodies; a garment-specific model was trained by the same program on this garment alone.";
            let table =
                variants::table("One model for all garments beside one per garment", note, &all, false);
            sections.push(section("Garment-specific models (Table 2)", "", vec![table]));
        }
        sections.push(section("Time per phase (Table 5)", "", vec![self.times.table()]));
        let mut pareto = section("Speed against error", "", vec![self.pareto.table()]);
        let chart = draw_lines("Speed against error", &self.pareto.panels()).into_diagnostic()?;
        pareto.pictures.push((
            "pareto.png".into(),
            "Medians; down and to the left is better.".into(),
            png_bytes(&chart).into_diagnostic()?,
        ));
        sections.push(pareto);
        sections.push(section("Stability", "", vec![extremes::table(&self.extremes)]));
        if !self.pictures.is_empty() {
            let mut gallery = section(
                "Gallery",
                "After the post-process. Names in the legend stand for garments, colours without names for layers from inner to outer.",
                Vec::new(),
            );
            for picture in &self.pictures {
                let file = format!("{}.png", picture.name);
                gallery.pictures.push((
                    file,
                    picture.caption.clone(),
                    png_bytes(&picture.image).into_diagnostic()?,
                ));
            }
            sections.push(gallery);
        }
        Ok(sections)
    }
}
