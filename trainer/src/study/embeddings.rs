//! Table 1: what the networks make of a garment with a wrong embedding.

use super::methods::{MethodResult, Question};
use super::subject::{Measured, Subject};
use super::table::{Table, number};
use crate::drape::{DrapeError, OnBody, drape_on};
use crate::scene::PreparedScene;
use burn::tensor::{Int, Tensor};
use clothcombo_model::GarmentEmbedding;
use clothcombo_physics::energy::Term;
use serde::Serialize;

const KINDS: [&str; 3] = ["correct", "different", "zero"];

/// The three kinds of embedding over the scenes of one question.
#[derive(Clone, Debug, Serialize)]
pub struct EmbeddingStudy {
    /// What it is about.
    pub title: String,
    /// Number of scenes.
    pub scenes: usize,
    /// Correct, of another garment, and zero.
    pub kinds: Vec<MethodResult>,
}

/// Asks `question` with correct and wrong embeddings. The other garment is of another category where there is one; vertex i
/// of V takes the embedding of its vertex i V'/V.
///
/// # Errors
/// When a scene cannot be draped.
pub fn ask(
    subject: &Subject,
    question: &Question<'_>,
    done: &(dyn Fn() + Sync),
) -> Result<EmbeddingStudy, DrapeError> {
    let draws = question.draws(subject);
    let wardrobe = &subject.library.wardrobe;
    let embed = |garment: usize| -> Result<GarmentEmbedding, DrapeError> {
        Ok(subject.model.encode(subject.tensors.garment(garment, &*wardrobe.garment(garment)?)?.as_ref()))
    };
    let other = |garment: usize| {
        let category = wardrobe.card(garment).category;
        let turn = (1..wardrobe.len()).map(|step| (garment + step) % wardrobe.len());
        turn.clone()
            .find(|&g| wardrobe.card(g).category != category)
            .or(turn.clone().next())
            .unwrap_or(garment)
    };
    let drape = |scene: &PreparedScene| {
        let garment = scene.draw.garments[0];
        let (outfit, (body, start)) =
            (subject.tensors.outfit(scene)?, subject.tensors.body(&scene.bodies[0])?);
        let correct = embed(garment)?;
        let zero =
            GarmentEmbedding { vertex: correct.vertex.zeros_like(), garment: correct.garment.zeros_like() };
        let different = resampled(embed(other(garment))?, correct.vertex.dims()[0]);
        [correct, different, zero]
            .into_iter()
            .map(|embedding| {
                let embeddings = subject.model.pack(&outfit, &[embedding])?;
                let (outfit, body) = (&outfit, &body);
                let on_body = OnBody { scene, outfit, embeddings: &embeddings, body, start: start.clone() };
                Ok(drape_on(&subject.model, &on_body).0)
            })
            .collect()
    };
    let measured = subject.measure(&draws, done, drape)?;
    let of = |kind: usize| measured.iter().map(|m| &m[kind]).collect::<Vec<&Measured>>();
    Ok(EmbeddingStudy {
        title: question.title.clone(),
        scenes: draws.len(),
        kinds: KINDS.into_iter().enumerate().map(|(i, kind)| MethodResult::new(kind, &of(i))).collect(),
    })
}

/// The same embedding for `count` vertices.
fn resampled(embedding: GarmentEmbedding, count: usize) -> GarmentEmbedding {
    let own = embedding.vertex.dims()[0];
    let rows: Vec<i32> = (0..count).map(|i| (i * own / count.max(1)) as i32).collect();
    let rows = Tensor::<1, Int>::from_ints(rows.as_slice(), &embedding.vertex.device());
    GarmentEmbedding { vertex: embedding.vertex.select(0, rows), garment: embedding.garment }
}

/// The paper's Table 1.
const PAPER: [(&str, [&str; 3]); 4] = [
    ("strain", ["0.899", "2.77e14", "179"]),
    ("bending", ["0.081", "5.5e5", "0.116"]),
    ("collision, weighted", ["0.57", "109", "187"]),
    ("gravity", ["-0.623", "-0.553", "-0.57"]),
];

impl EmbeddingStudy {
    /// As a table with the paper's numbers.
    pub fn table(&self) -> Table {
        let mut table = Table::new(
            format!("{}: energies [J] with correct and wrong embeddings, {} scenes", self.title, self.scenes),
            &["energy", "correct", "different", "zero", "paper: correct", "paper: different", "paper: zero"],
        )
        .with_note("Means over the scenes (medians); every garment draped alone.");
        let terms = [Term::Strain, Term::Bending, Term::BodyCollision, Term::Gravity];
        for ((name, paper), term) in PAPER.into_iter().zip(terms) {
            let cell = |kind: &MethodResult| {
                let map = if term == Term::BodyCollision { &kind.weighted } else { &kind.raw };
                let spread = map[term.name()].spread;
                format!("{} ({})", number(spread.mean), number(spread.median))
            };
            let mut row = vec![name.to_owned()];
            row.extend(self.kinds.iter().map(cell));
            row.extend(paper.map(str::to_owned));
            table.rows.push(row);
        }
        table
    }
}
