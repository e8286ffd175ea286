//! Table 1: what the networks make of a garment with a wrong embedding.

use super::{Evaluator, GarmentSet, PAPER_COLLISION, Scenes, Section, Table, estimates};
use crate::dataset::{HeldOut, PreparedScene};
use crate::inference::Draped;
use crate::inference::networks::forward_on;
use crate::inference::on_body::OnBody;
use crate::inference::tensor_store::DrapeError;
use crate::run::report::table::{Column, mean_and_median, plain};
use burn::tensor::{Int, Tensor};
use clothcombo_model::{GarmentEmbedding, Mode};
use clothcombo_physics::energy::Term;
use miette::Report;
use serde_json::{Value, json};

const EMBEDDING_KINDS: [&str; 3] = ["correct", "different", "zero"];

fn scenes(evaluator: &Evaluator<'_>) -> Vec<Scenes> {
    let sets = [(3, GarmentSet::Training), (4, GarmentSet::Test)];
    Scenes::of(
        evaluator,
        &sets.map(|(stream, set)| (stream, set, HeldOut::Windows, evaluator.counts.embeddings)),
    )
}

pub fn scene_count(evaluator: &Evaluator<'_>) -> usize {
    scenes(evaluator).iter().map(|scenes| scenes.count).sum()
}

/// The three kinds of embedding on every set.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    let sets =
        scenes(evaluator).iter().map(|scenes| evaluate(evaluator, scenes)).collect::<Result<Vec<_>, _>>()?;
    let text = "What the forward pass alone makes, which compares with the paper: a drape is accepted only as far as that lowers \
                the energy, which hides what a wrong embedding does.";
    let tables = sets.iter().map(table).collect();
    Ok(vec![Section::new("embeddings", "Embeddings (Table 1)", text, sets, tables)])
}

/// One set. The other garment is of another category where there is one; vertex i of V takes the embedding
/// of its vertex i V'/V.
fn evaluate(evaluator: &Evaluator<'_>, scenes: &Scenes) -> Result<Value, DrapeError> {
    let model = evaluator.model;
    let garments = &model.dataset.garments;
    let embed = |garment: usize| -> Result<GarmentEmbedding, DrapeError> {
        Ok(model.model.encode(model.tensors.garment(garment, &*garments.garment(garment)?)?.as_ref()))
    };
    let other = |garment: usize| {
        let category = garments.info(garment).category;
        let mut others = (1..garments.len()).map(|step| (garment + step) % garments.len());
        let next = others.clone().next().unwrap_or(garment);
        others.find(|&g| garments.info(g).category != category).unwrap_or(next)
    };
    let drape = |scene: &PreparedScene| {
        let garment = scene.sample.garments[0];
        let (outfit, (body, start)) = (model.tensors.outfit(scene)?, model.tensors.body(&scene.bodies[0])?);
        let correct = embed(garment)?;
        let zero =
            GarmentEmbedding { vertex: correct.vertex.zeros_like(), garment: correct.garment.zeros_like() };
        let different = resampled(embed(other(garment))?, correct.vertex.dims()[0]);
        let kinds = [correct, different, zero];
        let drape = |embedding: &GarmentEmbedding| -> Result<Draped, DrapeError> {
            let embeddings = model.model.pack(&outfit, std::slice::from_ref(embedding), Mode::Layered)?;
            let (outfit, body, start) = (&outfit, &body, start.clone());
            let on_body = OnBody { scene, outfit, embeddings: &embeddings, body, start };
            Ok(forward_on(&model.model, &on_body, Mode::Layered).1)
        };
        kinds.iter().map(drape).collect()
    };
    let measured = evaluator.measure(model, &scenes.samples(evaluator), drape)?;
    let of_kind = |kind: usize| measured.iter().map(|drapes| &drapes[kind]).collect::<Vec<_>>();
    let kinds: Vec<Value> =
        EMBEDDING_KINDS.iter().enumerate().map(|(kind, name)| estimates(name, &of_kind(kind))).collect();
    Ok(json!({
        "title": scenes.set.title(&model.dataset),
        "set": scenes.set,
        "scenes": scenes.count,
        // Weight and margin as the model's configuration has them.
        "collision": model.collision_form(Term::BodyCollision),
        "kinds": kinds,
    }))
}

/// The same embedding for `count` vertices.
fn resampled(embedding: GarmentEmbedding, count: usize) -> GarmentEmbedding {
    let own = embedding.vertex.dims()[0];
    let rows: Vec<i32> = (0..count).map(|i| (i * own / count.max(1)) as i32).collect();
    let rows = Tensor::<1, Int>::from_ints(rows.as_slice(), &embedding.vertex.device());
    GarmentEmbedding { vertex: embedding.vertex.select(0, rows), garment: embedding.garment }
}

/// The paper's Table 1.
const PAPER_TABLE_1: [[&str; 6]; 3] = [
    ["paper: correct", "0.899", "0.081", "–", "0.57", "-0.623"],
    ["paper: different", "2.77e14", "5.5e5", "–", "109", "-0.553"],
    ["paper: zero", "179", "0.116", "–", "187", "-0.57"],
];

fn table(set: &Value) -> Table {
    let columns: [Column<'_>; 6] = [
        ("energy", "/method", plain),
        ("strain", "/raw/strain", mean_and_median),
        ("bending", "/raw/bending", mean_and_median),
        (&format!("collision ({})", plain(&set["collision"])), "/weighted/body_collision", mean_and_median),
        (&format!("collision ({PAPER_COLLISION})"), "/paper_collision", mean_and_median),
        ("gravity", "/raw/gravity", mean_and_median),
    ];
    let rows = set["kinds"].as_array().expect("a list");
    let title = format!(
        "{}: energies [J] with correct and wrong embeddings, {} scenes",
        plain(&set["title"]),
        set["scenes"]
    );
    let table = PAPER_TABLE_1.into_iter().fold(Table::new(title, rows, &columns), Table::with_row);
    table
        .transposed()
        .with_note("Means over the scenes (medians); single garments, by the forward pass alone.")
}
