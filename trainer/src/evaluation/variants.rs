//! Table 4 and the garment-specific reference: other models on the same scenes.

use super::{
    DrapeMetrics, Evaluator, ModelUnderTest, NamedModel, PAPER_COLLISION, Section, Table, drape_by, estimates,
};
use crate::dataset::HeldOut;
use crate::inference::tensor_store::DrapeError;
use crate::run::report::table::{Column, mean_and_median, number, percent, plain};
use crate::run::validation::Method;
use clothcombo_physics::energy::Term;
use miette::Report;
use serde_json::{Value, json};

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
        let mut variants = vec![evaluate(evaluator, model, "this model", 5, [1, 4], &model.garments())?];
        for NamedModel { name, model } in ablations {
            variants.push(evaluate(evaluator, model, name, 5, [1, 4], &model.garments())?);
        }
        let note = "Means (medians) over outfits of 1 to 4 garments of all sets in held-out windows, the same for every model; before the \
                    post-process. Layer-order violations by the nearest vertex. Self-collision: (1/N) Σ −log d² (d in m) over pairs of vertices of \
                    one garment that no edge joins, are closer than 0.1 m and both belong to triangles that intersect another triangle of the \
                    garment, summed over the garments; the paper does not print its normalisation, so that its values compare among themselves only.";
        let table =
            PAPER_TABLE_4.into_iter().fold(table("Ablations", &variants), Table::with_row).with_note(note);
        sections.push(Section::new("ablations", "Ablations (Table 4)", "", variants, vec![table]));
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
        let table = table("One model for all garments and one per garment", &pairs.concat())
            .with_note("Means (medians) over the same bodies in held-out windows.");
        let (title, text) = ("Garment-specific models (Table 2)", specific_text(&pairs));
        sections.push(Section::new("specific", title, &text, pairs, vec![table]));
    }
    Ok(sections)
}

/// What the comparison with garment-specific models shows and what not.
fn specific_text(pairs: &[[Value; 2]]) -> String {
    let models = pairs.iter().map(|[general, specific]| {
        format!(
            "{} (width {}, {} steps; the model for all garments has width {})",
            plain(&specific["name"]),
            specific["width"],
            specific["steps"],
            general["width"]
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
) -> Result<Value, DrapeError> {
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
    let collisions = [Term::BodyCollision, Term::LayerCollision].map(|term| model.collision_form(term));
    Ok(json!({
        "name": name,
        "width": model.config.model.width,
        // Of a model that was trained on from another, those of the last part.
        "steps": model.config.total_steps(),
        "result": estimates(Method::Network.name(), &measured.iter().collect::<Vec<_>>()),
        // Weight and margin that all models are measured with.
        "collisions": collisions,
        // Share of outer vertices by the nearest vertex, and triangle pairs between garments; means over the scenes.
        "order_violations_nearest_vertex": mean(&|m| m.score.order.share()),
        "layer_pairs": mean(&|m| m.layers.pairs as f64),
    }))
}

/// The paper's Table 4: strain, bending, collision with the body, collision between garments, self-collision.
const PAPER_TABLE_4: [[&str; 8]; 5] = [
    ["paper: all", "0.985", "0.103", "–", "0.409", "–", "0.138", "0.779"],
    ["paper: without repulsion", "0.978", "0.099", "–", "0.412", "–", "0.155", "0.784"],
    ["paper: without distance", "0.967", "0.097", "–", "0.409", "–", "0.309", "0.778"],
    ["paper: without z_v", "1.115", "0.093", "–", "0.413", "–", "0.377", "0.792"],
    ["paper: without S", "3.43", "0.181", "–", "0.901", "–", "0.312", "0.922"],
];

fn table(title: &str, variants: &[Value]) -> Table {
    let [own, own_layers] =
        [0, 1].map(|i| variants.first().map_or(String::new(), |variant| plain(&variant["collisions"][i])));
    let columns: [Column<'_>; 12] = [
        ("model", "/name", plain),
        ("strain", "/result/raw/strain", mean_and_median),
        ("bending", "/result/raw/bending", mean_and_median),
        (&format!("collision ({own})"), "/result/weighted/body_collision", mean_and_median),
        (&format!("collision ({PAPER_COLLISION})"), "/result/paper_collision", mean_and_median),
        (&format!("layer collision ({own_layers})"), "/result/weighted/layer_collision", mean_and_median),
        (&format!("layer collision ({PAPER_COLLISION})"), "/result/paper_layer_collision", mean_and_median),
        ("self-collision", "/result/self_collision", mean_and_median),
        ("total", "/result/total", mean_and_median),
        ("self-intersecting pairs", "/result/self_pairs", mean_and_median),
        ("pairs between garments", "/layer_pairs", number),
        ("layer-order violations [%]", "/order_violations_nearest_vertex", percent),
    ];
    Table::new(title, variants, &columns)
}
