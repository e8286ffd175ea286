//! Table 1: what the networks make of a garment with a wrong embedding.

use super::estimate::Estimate;
use super::methods::{MethodResult, Question};
use super::sets::DataSet;
use super::subject::{Measured, PAPER_COLLISION, Subject};
use super::table::{Table, mean_and_median};
use crate::dataset::PreparedScene;
use crate::inference::Draped;
use crate::inference::contact_features::LayerInteraction;
use crate::inference::networks::{OnBody, drape_on};
use crate::inference::tensor_store::DrapeError;
use burn::tensor::{Int, Tensor};
use clothcombo_model::{ClothCombo, GarmentEmbedding, Mode};
use clothcombo_physics::energy::Term;
use serde::Serialize;

const KINDS: [&str; 3] = ["correct", "different", "zero"];

/// The three kinds of embedding over the scenes of one question.
#[derive(Clone, Debug, Serialize)]
pub struct EmbeddingStudy {
    /// What it is about.
    pub title: String,
    /// The garments and poses.
    pub set: DataSet,
    /// Number of scenes.
    pub scenes: usize,
    /// Weight and margin of the collision as the model's configuration has it.
    pub collision: String,
    /// Correct, of another garment, and zero: the networks without corrections. Corrections see where the cloth lies
    /// and are accepted from skinning on as far as they lower the energy: they would hide what a wrong embedding does.
    pub kinds: Vec<MethodResult>,
    /// The same with the correction networks; empty for a model that has none.
    pub corrected: Vec<MethodResult>,
}

/// Asks `question` with correct and wrong embeddings. The other garment is of another category where there is one; vertex i
/// of V takes the embedding of its vertex i V'/V.
///
/// # Errors
/// When a scene cannot be draped.
pub fn ask(
    subject: &Subject,
    question: &Question,
    done: &(dyn Fn() + Sync),
) -> Result<EmbeddingStudy, DrapeError> {
    let draws = question.draws(subject);
    let garments = &subject.dataset.garments;
    let embed = |garment: usize| -> Result<GarmentEmbedding, DrapeError> {
        Ok(subject.model.encode(subject.tensors.garment(garment, &*garments.garment(garment)?)?.as_ref()))
    };
    let other = |garment: usize| {
        let category = garments.info(garment).category;
        let turn = (1..garments.len()).map(|step| (garment + step) % garments.len());
        turn.clone()
            .find(|&g| garments.info(g).category != category)
            .or(turn.clone().next())
            .unwrap_or(garment)
    };
    let mut models = vec![subject.model.clone().with_correction_steps(0)];
    if subject.config.model.corrections > 0 {
        models.push(subject.model.clone());
    }
    let drape = |scene: &PreparedScene| {
        let garment = scene.sample.garments[0];
        let (outfit, (body, start)) =
            (subject.tensors.outfit(scene)?, subject.tensors.body(&scene.bodies[0])?);
        let correct = embed(garment)?;
        let zero =
            GarmentEmbedding { vertex: correct.vertex.zeros_like(), garment: correct.garment.zeros_like() };
        let different = resampled(embed(other(garment))?, correct.vertex.dims()[0]);
        let kinds = [correct, different, zero];
        let drape = |(model, embedding): (&ClothCombo, &GarmentEmbedding)| -> Result<Draped, DrapeError> {
            let embeddings = model.pack(&outfit, std::slice::from_ref(embedding), Mode::Layered)?;
            let (outfit, body) = (&outfit, &body);
            let on_body = OnBody { scene, outfit, embeddings: &embeddings, body, start: start.clone() };
            Ok(drape_on(model, &on_body, LayerInteraction::Together).0)
        };
        models.iter().flat_map(|model| kinds.iter().map(move |kind| (model, kind))).map(drape).collect()
    };
    let measured = subject.measure(&draws, done, drape)?;
    let of = |drape: usize| measured.iter().map(|m| &m[drape]).collect::<Vec<&Measured>>();
    let results = |model: usize| -> Vec<MethodResult> {
        let drapes = (0..KINDS.len()).map(|kind| of(model * KINDS.len() + kind));
        KINDS.into_iter().zip(drapes).map(|(name, drapes)| MethodResult::new(name, &drapes)).collect()
    };
    Ok(EmbeddingStudy {
        title: question.set.title(&subject.dataset),
        set: question.set,
        scenes: draws.len(),
        collision: subject.collision_form(Term::BodyCollision),
        kinds: results(0),
        corrected: if models.len() > 1 { results(1) } else { Vec::new() },
    })
}

/// The same embedding for `count` vertices.
fn resampled(embedding: GarmentEmbedding, count: usize) -> GarmentEmbedding {
    let own = embedding.vertex.dims()[0];
    let rows: Vec<i32> = (0..count).map(|i| (i * own / count.max(1)) as i32).collect();
    let rows = Tensor::<1, Int>::from_ints(rows.as_slice(), &embedding.vertex.device());
    GarmentEmbedding { vertex: embedding.vertex.select(0, rows), garment: embedding.garment }
}

/// The paper's Table 1: correct, different, zero.
const STRAIN: [&str; 3] = ["0.899", "2.77e14", "179"];
const BENDING: [&str; 3] = ["0.081", "5.5e5", "0.116"];
const COLLISION: [&str; 3] = ["0.57", "109", "187"];
const GRAVITY: [&str; 3] = ["-0.623", "-0.553", "-0.57"];

impl EmbeddingStudy {
    /// As a table with the paper's numbers.
    pub fn table(&self) -> Table {
        let of = |what: &str| KINDS.map(|kind| format!("{what}{kind}"));
        let mut head = vec!["energy".to_owned()];
        head.extend(of(""));
        if !self.corrected.is_empty() {
            head.extend(of("with corrections: "));
        }
        head.extend(of("paper: "));
        let mut table = Table::new(
            format!("{}: energies [J] with correct and wrong embeddings, {} scenes", self.title, self.scenes),
            &head.iter().map(String::as_str).collect::<Vec<_>>(),
        )
        .with_note("Means over the scenes (medians); every garment draped alone, by the networks without corrections and, beside them, with.");
        let own = format!("collision ({})", self.collision);
        let paper = format!("collision ({PAPER_COLLISION})");
        let raw = |term: Term| move |kind: &MethodResult| kind.raw[term.name()];
        let rows: [(&str, &dyn Fn(&MethodResult) -> Estimate, [&str; 3]); 5] = [
            ("strain", &raw(Term::Strain), STRAIN),
            ("bending", &raw(Term::Bending), BENDING),
            (&own, &|kind| kind.weighted[Term::BodyCollision.name()], ["–"; 3]),
            (&paper, &|kind| kind.paper_collision, COLLISION),
            ("gravity", &raw(Term::Gravity), GRAVITY),
        ];
        for (name, value, paper) in rows {
            let mut row = vec![name.to_owned()];
            row.extend(self.kinds.iter().chain(&self.corrected).map(|kind| mean_and_median(&value(kind))));
            row.extend(paper.map(str::to_owned));
            table.rows.push(row);
        }
        table
    }
}
