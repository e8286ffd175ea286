//! Table 4 and the garment-specific reference: other models on the same scenes.

use super::methods::MethodResult;
use super::subject::{Measured, PAPER_COLLISION, Subject};
use super::table::{Table, mean_and_median, number, percent};
use crate::dataset::HeldOut;
use crate::inference::tensor_store::DrapeError;
use clothcombo_physics::energy::Term;
use serde::Serialize;

/// One model on the scenes.
#[derive(Clone, Debug, Serialize)]
pub struct Variant {
    /// What it is called.
    pub name: String,
    /// Width of its networks, and the steps of its configuration.
    pub width: usize,
    /// See `width`; of a model that was trained on from another, those of the last part.
    pub steps: u64,
    /// What its networks make of the scenes.
    pub result: MethodResult,
    /// Weight and margin of the collision with the body, and of that between garments, that all models are measured with.
    pub collisions: [String; 2],
    /// Share of outer vertices on the wrong side of an inner layer, by the nearest vertex; mean over the scenes.
    pub wrong_side: f64,
    /// Exact pairs between garments, mean over the scenes.
    pub layer_pairs: f64,
}

/// Scenes of `layers` garments called `garments`, all that a model has for `None`.
pub struct VariantQuestion<'a> {
    /// Its number: other numbers are other scenes.
    pub number: usize,
    /// The garments by name.
    pub garments: Option<&'a [String]>,
    /// Fewest and most garments of a scene, in turn.
    pub layers: [usize; 2],
    /// Number of scenes.
    pub scenes: usize,
}

/// Asks one model.
///
/// # Errors
/// When a scene cannot be draped.
pub fn ask(
    subject: &Subject,
    name: &str,
    question: &VariantQuestion<'_>,
    done: &(dyn Fn() + Sync),
) -> Result<Variant, DrapeError> {
    let garments = &subject.dataset.garments;
    let wanted = |g: &usize| question.garments.is_none_or(|names| names.contains(&garments.info(*g).name));
    let pool: Vec<usize> = (0..garments.len()).filter(wanted).collect();
    let [low, high] = question.layers;
    let draw = |index: usize| {
        let layers = low + index % (high - low + 1);
        let at = [question.number, index];
        subject.draw(at, &pool, layers, HeldOut::Windows)
    };
    let draws: Vec<_> = if pool.is_empty() { Vec::new() } else { (0..question.scenes).map(draw).collect() };
    let networks = subject.networks();
    let measured = subject.measure(&draws, done, |scene| Ok(vec![networks.drape(scene)?]))?;
    let all: Vec<&Measured> = measured.iter().map(|methods| &methods[0]).collect();
    let mean = |f: &dyn Fn(&Measured) -> f64| all.iter().map(|m| f(m)).sum::<f64>() / all.len().max(1) as f64;
    Ok(Variant {
        name: name.to_owned(),
        width: subject.config.model.width,
        steps: subject.config.total_steps(),
        collisions: [Term::BodyCollision, Term::LayerCollision].map(|term| subject.collision_form(term)),
        result: MethodResult::new("network", &all),
        wrong_side: mean(&|m| m.score.order.share()),
        layer_pairs: mean(&|m| m.layers.pairs as f64),
    })
}

/// The paper's Table 4: strain, bending, collision with the body, collision between garments, self-collision.
const PAPER: [(&str, [&str; 5]); 5] = [
    ("paper: all", ["0.985", "0.103", "0.409", "0.138", "0.779"]),
    ("paper: without repulsion", ["0.978", "0.099", "0.412", "0.155", "0.784"]),
    ("paper: without distance", ["0.967", "0.097", "0.409", "0.309", "0.778"]),
    ("paper: without z_v", ["1.115", "0.093", "0.413", "0.377", "0.792"]),
    ("paper: without S", ["3.43", "0.181", "0.901", "0.312", "0.922"]),
];

/// As a table; with the paper's ablations where that is what the variants are.
pub fn table(title: &str, note: &str, variants: &[Variant], with_paper: bool) -> Table {
    let [own, own_layers] = variants.first().map(|v| v.collisions.clone()).unwrap_or_default();
    let mut table = Table::new(
        title,
        &[
            "model",
            "strain",
            "bending",
            &format!("collision ({own})"),
            &format!("collision ({PAPER_COLLISION})"),
            &format!("layer collision ({own_layers})"),
            &format!("layer collision ({PAPER_COLLISION})"),
            "self-collision",
            "total",
            "pairs with itself",
            "pairs between garments",
            "wrong side [%]",
        ],
    )
    .with_note(note);
    for v in variants {
        let (raw, weighted) = (&v.result.raw, &v.result.weighted);
        table.rows.push(vec![
            v.name.clone(),
            mean_and_median(&raw[Term::Strain.name()]),
            mean_and_median(&raw[Term::Bending.name()]),
            mean_and_median(&weighted[Term::BodyCollision.name()]),
            mean_and_median(&v.result.paper_collision),
            mean_and_median(&weighted[Term::LayerCollision.name()]),
            mean_and_median(&v.result.paper_layer_collision),
            mean_and_median(&v.result.self_collision),
            mean_and_median(&v.result.total),
            mean_and_median(&v.result.self_pairs),
            number(v.layer_pairs),
            percent(v.wrong_side),
        ]);
    }
    for (name, [strain, bending, body, layers, own]) in PAPER.into_iter().filter(|_| with_paper) {
        let mut row = [name, strain, bending, "–", body, "–", layers, own].map(str::to_owned).to_vec();
        row.resize(table.head.len(), String::new());
        table.rows.push(row);
    }
    table
}
