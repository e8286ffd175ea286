//! Table 3: what several layers cost each garment, and how many vertices violate the layer order before and after the
//! post-process.

use super::{Estimate, Evaluator, Metric, Proportion, Ratio, Section, Table, drape_by};
use crate::inference::Draped;
use crate::run::report::table::{Column, number, percent, percent_with_interval, plain, proportion};
use crate::run::validation::Method;
use crate::system::single_threaded::map_single_threaded;
use clothcombo_physics::contact::resolve::{Certificate, Resolved};
use clothcombo_physics::energy::{Term, TermMap};
use miette::{IntoDiagnostic, Report};
use serde_json::{Value, json};

/// Estimated before the post-process. Strain (J): mean over the garments of an outfit, which are no independent scenes.
/// Violations: share of outer vertices, by the closest surface point.
const BEFORE_POST_PROCESS: [Metric<LayeredOutfit>; 5] = [
    ("strain_of_single_garments", |outfit| mean(outfit.strain.iter().map(|[single, _]| *single))),
    ("strain_in_outfit", |outfit| mean(outfit.strain.iter().map(|[_, layered]| *layered))),
    ("order_violations_of_single_garments", |outfit| outfit.violations_of_single_garments),
    ("order_violations", |outfit| outfit.before.order_violations),
    ("layer_pairs", |outfit| outfit.before.layer_triangle_pairs as f64),
];

/// Estimated after it. Time per garment, means of outfits, each on one thread.
pub const AFTER_POST_PROCESS: [Metric<Resolved>; 2] = [
    ("order_violations", |resolved| resolved.certificate.order_violations),
    ("milliseconds", |resolved| mean(resolved.garments.iter().map(|g| 1e3 * g.time.as_secs_f64()))),
];

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len();
    values.sum::<f64>() / count as f64
}

struct LayeredOutfit {
    is_feasible: bool,
    /// Strain of every garment by itself and in the outfit (J).
    strain: Vec<[f64; 2]>,
    violations_of_single_garments: f64,
    before: Certificate,
    /// If it went through the post-process.
    after: Option<Resolved>,
}

/// Numbers of layers, and how many outfits have them: all, and those that go through the post-process.
fn outfits(evaluator: &Evaluator<'_>) -> impl Iterator<Item = (usize, [usize; 2])> {
    let counts = evaluator.counts;
    (1..=6)
        .map(move |layers| (layers, counts.layered))
        .chain([7, 8, 12].map(|layers| (layers, counts.many_layers)))
}

pub fn scene_count(evaluator: &Evaluator<'_>) -> usize {
    outfits(evaluator).map(|(_, [scenes, _])| scenes).sum()
}

/// Random outfits of all sets, by their number of layers.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    let results = outfits(evaluator).map(|(layers, counts)| evaluate(evaluator, layers, counts));
    let results = results.collect::<Result<Vec<_>, _>>()?;
    let text = "Training, validation and test garments in random order, in held-out windows, on bodies of random shape.";
    let tables = vec![strain_table(&results), order_table(&results)];
    Ok(vec![Section::new("layers", "Layers (Table 3)", text, results, tables)])
}

/// Drapes `scenes` random outfits of `layers` garments, and resolves the first `resolved` of them.
fn evaluate(
    evaluator: &Evaluator<'_>,
    layers: usize,
    [scenes, resolved]: [usize; 2],
) -> Result<Value, Report> {
    let Evaluator { model, networks, post_process, settings, .. } = evaluator;
    let outfit = |index: usize| -> Result<LayeredOutfit, Report> {
        let scene = model.prepare(&model.sample_outfit([100 + layers, index], layers))?;
        let drapes = drape_by(networks, &[Method::SingleGarments, Method::Network], &scene)?;
        let energy = &scene.bodies[0].energy;
        let raw = |draped: &Draped| energy.raw(&draped.posed, &draped.canonical).garments;
        let strain = |raw: &TermMap<Option<f64>>| raw[Term::Strain].unwrap_or(0.0);
        let single_garments = post_process.of(&scene, &drapes[0].posed);
        let draped = post_process.of(&scene, &drapes[1].posed);
        let outfit = LayeredOutfit {
            is_feasible: draped.is_feasible(),
            strain: raw(&drapes[0])
                .iter()
                .zip(&raw(&drapes[1]))
                .map(|(s, l)| [strain(s), strain(l)])
                .collect(),
            violations_of_single_garments: single_garments.certificate().into_diagnostic()?.order_violations,
            before: draped.certificate().into_diagnostic()?,
            after: (index < resolved).then(|| draped.resolved(settings)).transpose()?,
        };
        evaluator.scene_done();
        Ok(outfit)
    };
    let outfits = map_single_threaded((0..scenes).collect(), outfit)?;
    let all: Vec<&LayeredOutfit> = outfits.iter().collect();
    let feasible: Vec<&LayeredOutfit> = outfits.iter().filter(|outfit| outfit.is_feasible).collect();
    let mut result = statistics(layers, &all);
    result["layers"] = json!(layers);
    result["feasible"] = statistics(layers, &feasible);
    Ok(result)
}

fn statistics(layers: usize, outfits: &[&LayeredOutfit]) -> Value {
    let resolved: Vec<&Resolved> = outfits.iter().filter_map(|outfit| outfit.after.as_ref()).collect();
    let strain_of = |layer: usize, which: usize| -> Vec<f64> {
        outfits.iter().map(|outfit| outfit.strain[layer][which]).collect()
    };
    let ratio = |layer: usize| Ratio::of(&strain_of(layer, 1), &strain_of(layer, 0));
    let median_ratio = |layer: usize| {
        let ratios = outfits.iter().map(|outfit| outfit.strain[layer][1] / outfit.strain[layer][0]);
        Estimate::of(ratios).spread.median
    };
    json!({
        "scenes": outfits.len(),
        // Those that went through the post-process.
        "resolved": resolved.len(),
        // Strain of each layer over that of the single garment, innermost first; and median over the outfits of the
        // ratio of each.
        "strain": (0..layers).map(ratio).collect::<Vec<_>>(),
        "strain_median": (0..layers).map(median_ratio).collect::<Vec<_>>(),
        "before": Estimate::of_metrics(outfits, &BEFORE_POST_PROCESS),
        "after": Estimate::of_metrics(&resolved, &AFTER_POST_PROCESS),
        // No intersection with the body or between garments, before and after the post-process.
        "intersection_free": [
            Proportion::new(outfits.iter().map(|outfit| outfit.before.is_clear())),
            Proportion::new(resolved.iter().map(|r| r.certificate.is_clear())),
        ],
        // Rise of the strain energy by the post-process, median share.
        "strain_added": Estimate::of(resolved.iter().filter_map(|r| r.certificate.strain_added)).spread.median,
    })
}

/// Rows of tables with their names: a second one for a number of layers of which some orders are feasible and some are not.
fn named_rows(result: &Value) -> Vec<Value> {
    let row = |outfits: &Value, kind: &str| {
        let mut row = outfits.clone();
        row["name"] = json!(format!("M = {}{kind}", result["layers"]));
        if row["resolved"] == 0 {
            row["after"] = Value::Null;
            row["intersection_free"][1] = Value::Null;
            row["strain_added"] = Value::Null;
        }
        row
    };
    let mut rows = vec![row(result, "")];
    let feasible = &result["feasible"];
    if feasible["scenes"] != 0 && feasible["scenes"] != result["scenes"] {
        rows.push(row(feasible, ", feasible orders"));
    }
    rows
}

/// The paper's Table 3: rows M = 1 to 6.
const PAPER_TABLE_3: [&[f64]; 6] = [
    &[1.0],
    &[1.10, 1.29],
    &[1.16, 1.28, 1.33],
    &[1.32, 1.47, 1.43, 1.83],
    &[1.40, 1.63, 1.45, 1.69, 2.07],
    &[1.61, 1.46, 1.44, 1.63, 1.72, 2.65],
];

fn strain_table(results: &[Value]) -> Table {
    let most =
        results.iter().filter_map(|result| result["strain"].as_array()).map(Vec::len).max().unwrap_or(0);
    let layers = (1..=most).map(|layer| layer.to_string());
    let mut table = Table {
        title: "Strain of each layer, innermost first, over the single garment".into(),
        note: "Ratio of means (median of the ratios); after the networks, before the post-process. Training has at most 6 layers. Feasible orders: \
               only the outfits without legs over cloth that hangs between them."
            .into(),
        head: ["layers M".to_owned()].into_iter().chain(layers).collect(),
        rows: Vec::new(),
    };
    for (result, paper) in
        results.iter().zip(PAPER_TABLE_3.into_iter().map(Some).chain(std::iter::repeat(None)))
    {
        for row in named_rows(result) {
            let ratios = row["strain"].as_array().into_iter().flatten();
            let medians = row["strain_median"].as_array().into_iter().flatten();
            let cells = ratios.zip(medians);
            let cells =
                cells.map(|(ratio, median)| format!("{} ({})", number(&ratio["of_means"]), number(median)));
            table = table.with_row([plain(&row["name"])].into_iter().chain(cells));
        }
        if let Some(paper) = paper {
            let name = format!("paper, M = {}", paper.len());
            table = table.with_row([name].into_iter().chain(paper.iter().map(|v| format!("{v:.2}"))));
        }
    }
    table
}

fn order_table(results: &[Value]) -> Table {
    let rows: Vec<Value> = results.iter().flat_map(named_rows).collect();
    let columns: [Column<'_>; 13] = [
        ("layers M", "/name", plain),
        ("outfits", "/scenes", plain),
        ("strain of a single garment [J]", "/before/strain_of_single_garments/mean", number),
        ("in the outfit [J]", "/before/strain_in_outfit/mean", number),
        (
            "layer-order violations, single garments [%]",
            "/before/order_violations_of_single_garments/mean",
            percent,
        ),
        ("untangled [%]", "/before/order_violations", percent_with_interval),
        ("pairs between garments", "/before/layer_pairs/mean", number),
        ("intersection-free", "/intersection_free/0", proportion),
        ("post-processed outfits", "/resolved", plain),
        ("layer-order violations then [%]", "/after/order_violations", percent_with_interval),
        ("intersection-free then", "/intersection_free/1", proportion),
        ("strain added, median [%]", "/strain_added", percent),
        ("post-process per garment [ms], median", "/after/milliseconds/median", number),
    ];
    Table::new("Order and contact of the layers", &rows, &columns).with_note(
        "Layer-order violations: share of outer vertices within 5 cm of an inner layer that lie under its closest surface point. \
         Intersection-free: no pair of triangles intersects exactly, with the body or between garments, outside of pinched regions. Feasible \
         orders: the outfits without legs over cloth that hangs between them, which must intersect at the crotch. In brackets: 95 % intervals of \
         the mean, and of the share in %. Time: outfits in parallel, each on one thread.",
    )
}
