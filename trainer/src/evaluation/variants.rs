//! Table 4 and the garment-specific reference: other models on the same scenes.

use super::table::mean_and_median;
use super::{
    DrapeMetrics, Evaluator, MethodResult, ModelUnderTest, NamedModel, PAPER_COLLISION, Section, Table,
    drape_by, number, percent,
};
use crate::dataset::HeldOut;
use crate::inference::tensor_store::DrapeError;
use crate::run::validation::Method;
use clothcombo_physics::energy::Term;
use miette::Report;
use serde::Serialize;
use serde_json::json;

/// One model on the scenes.
#[derive(Clone, Serialize)]
struct VariantResult {
    name: String,
    /// Width of its networks.
    width: usize,
    /// Steps of its configuration; of a model that was trained on from another, those of the last part.
    steps: u64,
    result: MethodResult,
    /// Weight and margin of the collision with the body, and of that between garments, that all models are measured with.
    collisions: [String; 2],
    /// Share of outer vertices that violate the layer order, by the nearest vertex; mean over the scenes.
    order_violations: f64,
    /// Intersecting triangle pairs between garments, mean over the scenes.
    layer_pairs: f64,
}

pub fn scene_count(evaluator: &Evaluator<'_>) -> usize {
    let Evaluator { ablations, specific, counts, .. } = evaluator;
    let models = if ablations.is_empty() { 0 } else { ablations.len() + 1 } + 2 * specific.len();
    models * counts.variants
}

/// Ablations and garment-specific models, where there are some.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    let Evaluator { model, ablations, specific, .. } = *evaluator;
    let mut sections = Vec::new();
    if !ablations.is_empty() {
        let pool = |model: &ModelUnderTest| model.garments();
        let mut variants = vec![evaluate(evaluator, model, "this model", 5, [1, 4], &pool(model))?];
        for NamedModel { name, model } in ablations {
            variants.push(evaluate(evaluator, model, name, 5, [1, 4], &pool(model))?);
        }
        let note = "Means (medians) over outfits of 1 to 4 garments of all sets in held-out windows, the same for every model; before the \
                    post-process. Layer-order violations by the nearest vertex. Self-collision: (1/N) Σ −log d² (d in m) over pairs of vertices of \
                    one garment that no edge joins, are closer than 0.1 m and both belong to triangles that intersect another triangle of the \
                    garment, summed over the garments; the paper does not print its normalisation, so that its values compare among themselves only.";
        let table = table("Ablations", &variants).with_note(note);
        sections.push(Section {
            key: "ablations",
            numbers: json!(variants),
            title: "Ablations (Table 4)",
            tables: vec![PAPER.into_iter().fold(table, Table::with_row)],
            ..Section::default()
        });
    }
    if !specific.is_empty() {
        let mut pairs = Vec::new();
        for (i, NamedModel { name, model: other }) in specific.iter().enumerate() {
            let names = other.names(&other.garments());
            let is_known = |garment: &usize| names.contains(&model.dataset.garments.info(*garment).name);
            let own: Vec<usize> = model.garments().into_iter().filter(is_known).collect();
            let general = format!("this model on {}", names.join(", "));
            pairs.push([
                evaluate(evaluator, model, &general, 200 + i, [1, 1], &own)?,
                evaluate(evaluator, other, name, 200 + i, [1, 1], &other.garments())?,
            ]);
        }
        let table = table("One model for all garments and one per garment", &pairs.concat());
        sections.push(Section {
            key: "specific",
            numbers: json!(pairs),
            title: "Garment-specific models (Table 2)",
            text: specific_text(&pairs),
            tables: vec![table.with_note("Means (medians) over the same bodies in held-out windows.")],
            ..Section::default()
        });
    }
    Ok(sections)
}

/// What the comparison with garment-specific models shows and what not.
fn specific_text(pairs: &[[VariantResult; 2]]) -> String {
    let models = pairs.iter().map(|[general, specific]| {
        format!(
            "{} (width {}, {} steps; the model for all garments has width {})",
            specific.name, specific.width, specific.steps, general.width
        )
    });
    format!(
        "The paper trains SNUG for each of six garments; its model for all garments is a little worse than those. Here: {}. They are models of \
         this program (the same networks and losses) that were trained on one garment each, not SNUG. The table shows whether the model for all \
         garments is behind a model of that size and training on that garment. It does not show what a garment-specific model of the same size and \
         training would reach, nor how the comparison varies over garments.",
        models.collect::<Vec<_>>().join("; ")
    )
}

/// Drapes scenes of random stream `stream`, of `low` to `high` garments of `pool`, round-robin, by `model`.
fn evaluate(
    evaluator: &Evaluator<'_>,
    model: &ModelUnderTest,
    name: &str,
    stream: usize,
    [low, high]: [usize; 2],
    pool: &[usize],
) -> Result<VariantResult, DrapeError> {
    let sample =
        |index: usize| model.sample([stream, index], pool, low + index % (high - low + 1), HeldOut::Windows);
    let count = if pool.is_empty() { 0 } else { evaluator.counts.variants };
    let samples: Vec<_> = (0..count).map(sample).collect();
    let networks = model.networks();
    let drape = |scene: &_| drape_by(&networks, &[Method::Network], scene);
    let measured = evaluator.measure(model, &samples, drape)?.concat();
    let mean = |value: &dyn Fn(&DrapeMetrics) -> f64| {
        measured.iter().map(value).sum::<f64>() / measured.len().max(1) as f64
    };
    Ok(VariantResult {
        name: name.to_owned(),
        width: model.config.model.width,
        steps: model.config.total_steps(),
        collisions: [Term::BodyCollision, Term::LayerCollision].map(|term| model.collision_form(term)),
        order_violations: mean(&|m| m.score.order.share()),
        layer_pairs: mean(&|m| m.layers.pairs as f64),
        result: MethodResult::new(Method::Network.name(), &measured.iter().collect::<Vec<_>>()),
    })
}

/// The paper's Table 4: strain, bending, collision with the body, collision between garments, self-collision.
const PAPER: [[&str; 8]; 5] = [
    ["paper: all", "0.985", "0.103", "–", "0.409", "–", "0.138", "0.779"],
    ["paper: without repulsion", "0.978", "0.099", "–", "0.412", "–", "0.155", "0.784"],
    ["paper: without distance", "0.967", "0.097", "–", "0.409", "–", "0.309", "0.778"],
    ["paper: without z_v", "1.115", "0.093", "–", "0.413", "–", "0.377", "0.792"],
    ["paper: without S", "3.43", "0.181", "–", "0.901", "–", "0.312", "0.922"],
];

fn table(title: &str, variants: &[VariantResult]) -> Table {
    let [own, own_layers] = variants.first().map(|v| v.collisions.clone()).unwrap_or_default();
    let metric = |v: &VariantResult, name: &str| mean_and_median(v.result.metric(name));
    let weighted = |v: &VariantResult, term: Term| mean_and_median(v.result.weighted(term));
    Table::new(
        title,
        variants,
        &[
            ("model", &|v| v.name.clone()),
            ("strain", &|v| mean_and_median(v.result.raw(Term::Strain))),
            ("bending", &|v| mean_and_median(v.result.raw(Term::Bending))),
            (&format!("collision ({own})"), &|v| weighted(v, Term::BodyCollision)),
            (&format!("collision ({PAPER_COLLISION})"), &|v| metric(v, "paper_collision")),
            (&format!("layer collision ({own_layers})"), &|v| weighted(v, Term::LayerCollision)),
            (&format!("layer collision ({PAPER_COLLISION})"), &|v| metric(v, "paper_layer_collision")),
            ("self-collision", &|v| metric(v, "self_collision")),
            ("total", &|v| metric(v, "total")),
            ("self-intersecting pairs", &|v| metric(v, "self_pairs")),
            ("pairs between garments", &|v| number(v.layer_pairs)),
            ("layer-order violations [%]", &|v| percent(v.order_violations)),
        ],
    )
}
