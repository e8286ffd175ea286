//! Table 4 and the garment-specific reference: other models on the same scenes.

use super::methods::MethodResult;
use super::subject::{Measured, Subject};
use super::table::{Table, number, percent};
use crate::drape::DrapeError;
use crate::scene::Unseen;
use clothcombo_physics::energy::Term;
use serde::Serialize;

/// One model on the scenes.
#[derive(Clone, Debug, Serialize)]
pub struct Variant {
    /// What it is called.
    pub name: String,
    /// What its networks make of the scenes.
    pub result: MethodResult,
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
    let wardrobe = &subject.library.wardrobe;
    let wanted = |g: &usize| question.garments.is_none_or(|names| names.contains(&wardrobe.card(*g).name));
    let pool: Vec<usize> = (0..wardrobe.len()).filter(wanted).collect();
    let [low, high] = question.layers;
    let draw = |index: usize| {
        let layers = low + index % (high - low + 1);
        let at = [question.number, index];
        subject.draw(at, &pool, layers, Unseen::Poses)
    };
    let draws: Vec<_> = if pool.is_empty() { Vec::new() } else { (0..question.scenes).map(draw).collect() };
    let networks = subject.networks();
    let measured = subject.measure(&draws, done, |scene| Ok(vec![networks.drape(scene)?]))?;
    let all: Vec<&Measured> = measured.iter().map(|methods| &methods[0]).collect();
    let mean = |f: &dyn Fn(&Measured) -> f64| all.iter().map(|m| f(m)).sum::<f64>() / all.len().max(1) as f64;
    Ok(Variant {
        name: name.to_owned(),
        result: MethodResult::new("network", &all),
        wrong_side: mean(&|m| m.score.order.share()),
        layer_pairs: mean(&|m| m.layers.pairs as f64),
    })
}

/// The paper's Table 4: all losses, without repulsion, distance, vertex embedding, skinning network.
const PAPER: [(&str, [&str; 4]); 5] = [
    ("paper: all", ["0.985", "0.103", "0.409", "0.138"]),
    ("paper: without repulsion", ["0.978", "0.099", "0.412", "0.155"]),
    ("paper: without distance", ["0.967", "0.097", "0.409", "0.309"]),
    ("paper: without z_v", ["1.115", "0.093", "0.413", "0.377"]),
    ("paper: without S", ["3.43", "0.181", "0.901", "0.312"]),
];

/// As a table; with the paper's ablations where that is what the variants are.
pub fn table(title: &str, note: &str, variants: &[Variant], with_paper: bool) -> Table {
    let mut table = Table::new(
        title,
        &[
            "model",
            "strain",
            "bending",
            "collision, weighted",
            "layer collision, weighted",
            "total",
            "pairs with itself",
            "pairs between garments",
            "wrong side [%]",
        ],
    )
    .with_note(note);
    for v in variants {
        let cell = |e: &super::estimate::Estimate| {
            format!("{} ({})", number(e.spread.mean), number(e.spread.median))
        };
        let (raw, weighted) = (&v.result.raw, &v.result.weighted);
        table.rows.push(vec![
            v.name.clone(),
            cell(&raw[Term::Strain.name()]),
            cell(&raw[Term::Bending.name()]),
            cell(&weighted[Term::BodyCollision.name()]),
            cell(&weighted[Term::LayerCollision.name()]),
            cell(&v.result.total),
            cell(&v.result.self_pairs),
            number(v.layer_pairs),
            percent(v.wrong_side),
        ]);
    }
    for (name, values) in PAPER.iter().filter(|_| with_paper) {
        let mut row = vec![(*name).to_owned()];
        row.extend(values.map(str::to_owned));
        row.resize(table.head.len(), String::new());
        table.rows.push(row);
    }
    table
}
