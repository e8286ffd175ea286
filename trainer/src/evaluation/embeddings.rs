//! Table 1: what the networks make of a garment with a wrong embedding.

use super::table::mean_and_median;
use super::{Estimate, Evaluator, GarmentSet, MethodResult, PAPER_COLLISION, Scenes, Section, Table};
use crate::dataset::{HeldOut, PreparedScene};
use crate::inference::Draped;
use crate::inference::contact_features::LayerInteraction;
use crate::inference::networks::{OnBody, drape_on};
use crate::inference::tensor_store::DrapeError;
use burn::tensor::{Int, Tensor};
use clothcombo_model::{ClothCombo, GarmentEmbedding, Mode};
use clothcombo_physics::energy::Term;
use miette::Report;
use serde_json::{Value, json};

const KINDS: [&str; 3] = ["correct", "different", "zero"];

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
    let results =
        scenes(evaluator).iter().map(|scenes| evaluate(evaluator, scenes)).collect::<Result<Vec<_>, _>>()?;
    let (numbers, tables): (Vec<Value>, Vec<Table>) = results.into_iter().unzip();
    Ok(vec![Section {
        key: "embeddings",
        numbers: json!(numbers),
        title: "Embeddings (Table 1)",
        text: "The networks without corrections compare with the paper: corrections see where the cloth lies and are accepted as far as they \
               lower the energy, which repairs what a wrong embedding does."
            .into(),
        tables,
        ..Section::default()
    }])
}

/// Numbers and table of one set. The other garment is of another category where there is one; vertex i of V takes the embedding
/// of its vertex i V'/V.
fn evaluate(evaluator: &Evaluator<'_>, scenes: &Scenes) -> Result<(Value, Table), DrapeError> {
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
    // Corrections would hide what a wrong embedding does.
    let mut models = vec![model.model.clone().with_correction_steps(0)];
    if model.config.model.corrections > 0 {
        models.push(model.model.clone());
    }
    let drape = |scene: &PreparedScene| {
        let garment = scene.sample.garments[0];
        let (outfit, (body, start)) = (model.tensors.outfit(scene)?, model.tensors.body(&scene.bodies[0])?);
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
    let measured = evaluator.measure(model, &scenes.samples(evaluator), drape)?;
    let result = |drape: usize| {
        let of_kind: Vec<_> = measured.iter().map(|drapes| &drapes[drape]).collect();
        MethodResult::new(KINDS[drape % KINDS.len()], &of_kind)
    };
    let results: Vec<MethodResult> = (0..models.len() * KINDS.len()).map(result).collect();
    let (kinds, corrected) = results.split_at(KINDS.len());
    let title = scenes.set.title(&model.dataset);
    let collision = model.collision_form(Term::BodyCollision);
    let numbers = json!({
        "title": title,
        "set": scenes.set,
        "scenes": scenes.count,
        "collision": collision,
        "kinds": kinds,
        // Empty for a model without corrections.
        "corrected": corrected,
    });
    let title = format!("{title}: energies [J] with correct and wrong embeddings, {} scenes", scenes.count);
    Ok((numbers, table(title, &collision, [kinds, corrected])))
}

/// The same embedding for `count` vertices.
fn resampled(embedding: GarmentEmbedding, count: usize) -> GarmentEmbedding {
    let own = embedding.vertex.dims()[0];
    let rows: Vec<i32> = (0..count).map(|i| (i * own / count.max(1)) as i32).collect();
    let rows = Tensor::<1, Int>::from_ints(rows.as_slice(), &embedding.vertex.device());
    GarmentEmbedding { vertex: embedding.vertex.select(0, rows), garment: embedding.garment }
}

/// An energy, and what the paper's Table 1 has for correct, different and zero.
type Row<'a> = (&'a str, &'a dyn Fn(&MethodResult) -> Estimate, [&'a str; 3]);

/// With the paper's numbers.
fn table(title: String, collision: &str, [kinds, corrected]: [&[MethodResult]; 2]) -> Table {
    let own = format!("collision ({collision})");
    let paper = format!("collision ({PAPER_COLLISION})");
    let rows: [Row<'_>; 5] = [
        ("strain", &|kind| *kind.raw(Term::Strain), ["0.899", "2.77e14", "179"]),
        ("bending", &|kind| *kind.raw(Term::Bending), ["0.081", "5.5e5", "0.116"]),
        (&own, &|kind| *kind.weighted(Term::BodyCollision), ["–"; 3]),
        (&paper, &|kind| *kind.metric("paper_collision"), ["0.57", "109", "187"]),
        ("gravity", &|kind| *kind.raw(Term::Gravity), ["-0.623", "-0.553", "-0.57"]),
    ];
    let mut table = Table::new(title, &rows, &[("energy", &|(energy, ..)| (*energy).to_owned())]).with_note(
        "Means over the scenes (medians); single garments, by the networks without corrections and, in further columns, with.",
    );
    for (group, kinds) in [("", kinds), ("with corrections: ", corrected)] {
        for kind in kinds {
            let cells = rows.iter().map(|(_, value, _)| mean_and_median(&value(kind)));
            table.add_column(&format!("{group}{}", kind.method), cells);
        }
    }
    for (i, kind) in KINDS.iter().enumerate() {
        table.add_column(&format!("paper: {kind}"), rows.iter().map(|(.., paper)| paper[i].to_owned()));
    }
    table
}
