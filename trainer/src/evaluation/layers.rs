//! Table 3: what several layers cost each garment, and how many vertices violate the layer order before and after the post-process.

use super::certificates::{Counts, OutfitResult};
use super::table::{percent_with_interval, share_text};
use super::{Estimate, Evaluator, Metric, Proportion, Ratio, Section, Table, drape_by, number, percent};
use crate::inference::Draped;
use crate::run::validation::Method;
use crate::system::single_threaded::map_single_threaded;
use clothcombo_physics::energy::{Term, TermMap};
use miette::{IntoDiagnostic, Report};
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;

/// Outfits of one number of layers.
#[derive(Serialize)]
struct LayerResult {
    /// Number of garments M.
    layers: usize,
    #[serde(flatten)]
    all: OutfitStatistics,
    /// Of those in a feasible order.
    feasible: OutfitStatistics,
}

/// Statistics of outfits of as many layers each.
#[derive(Serialize)]
struct OutfitStatistics {
    scenes: usize,
    /// How many of them went through the post-process.
    resolved: usize,
    /// Strain of each layer in the outfit over that of the single garment, innermost first.
    strain: Vec<Ratio>,
    /// Median over the outfits of the ratio of each.
    strain_median: Vec<f64>,
    /// See [`BEFORE`].
    #[serde(flatten)]
    before: BTreeMap<&'static str, Estimate>,
    /// See [`AFTER`].
    #[serde(flatten)]
    after: BTreeMap<&'static str, Estimate>,
    /// Outfits without an intersection with the body or between garments: all before the post-process, those that went
    /// through it after it.
    intersection_free: [Proportion; 2],
    /// Rise of the strain energy by the post-process, median share.
    strain_added: f64,
}

/// Estimated before the post-process. Strain (J): mean over the garments of an outfit, which are no independent scenes. Violations:
/// share of outer vertices, by the closest surface point.
const BEFORE: [Metric<Outfit>; 5] = [
    ("strain_of_single_garments", |outfit| mean(outfit.strain.iter().map(|[single, _]| *single))),
    ("strain_in_outfit", |outfit| mean(outfit.strain.iter().map(|[_, layered]| *layered))),
    ("order_violations_of_single_garments", |outfit| outfit.violations_of_single_garments),
    ("order_violations", |outfit| outfit.before.order_violations),
    ("layer_pairs", |outfit| outfit.before.layer_triangle_pairs as f64),
];

/// Estimated after it. Time per garment, means of outfits, each on one thread.
const AFTER: [Metric<OutfitResult>; 2] = [
    ("order_violations_resolved", |result| result.after.order_violations),
    ("post_process_milliseconds", |result| mean(result.milliseconds.iter().copied())),
];

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len();
    values.sum::<f64>() / count as f64
}

struct Outfit {
    is_feasible: bool,
    /// Strain of every garment by itself and in the outfit (J).
    strain: Vec<[f64; 2]>,
    violations_of_single_garments: f64,
    before: Counts,
    /// If it went through the post-process.
    result: Option<OutfitResult>,
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
    Ok(vec![Section {
        key: "layers",
        numbers: json!(results),
        title: "Layers (Table 3)",
        text: "Training, validation and test garments in random order, in held-out windows, on bodies of random shape.".into(),
        tables: vec![strain_table(&results), order_table(&results)],
        ..Section::default()
    }])
}

/// Drapes `scenes` random outfits of `layers` garments, and resolves the first `resolved` of them.
fn evaluate(
    evaluator: &Evaluator<'_>,
    layers: usize,
    [scenes, resolved]: [usize; 2],
) -> Result<LayerResult, Report> {
    let Evaluator { model, networks, post_process, settings, .. } = evaluator;
    let outfit = |index: usize| -> Result<Outfit, Report> {
        let scene = model.prepare(&model.sample_outfit([100 + layers, index], layers))?;
        let drapes = drape_by(networks, &[Method::SingleGarments, Method::Network], &scene)?;
        let energy = &scene.bodies[0].energy;
        let raw = |draped: &Draped| energy.raw(&draped.posed, &draped.canonical).garments;
        let strain = |raw: &TermMap<Option<f64>>| raw[Term::Strain].unwrap_or(0.0);
        let single_garments = post_process.of(&scene, &drapes[0].posed);
        let draped = post_process.of(&scene, &drapes[1].posed);
        let result = match index < resolved {
            true => Some(OutfitResult::new(index, &draped, settings)?.0),
            false => None,
        };
        let outfit = Outfit {
            is_feasible: draped.is_wearable(),
            strain: raw(&drapes[0])
                .iter()
                .zip(&raw(&drapes[1]))
                .map(|(s, l)| [strain(s), strain(l)])
                .collect(),
            violations_of_single_garments: single_garments.certificate().into_diagnostic()?.order_violations,
            before: match &result {
                Some(result) => result.before,
                None => draped.counts().into_diagnostic()?,
            },
            result,
        };
        evaluator.scene_done();
        Ok(outfit)
    };
    let outfits = map_single_threaded((0..scenes).collect(), None, outfit)?;
    let all: Vec<&Outfit> = outfits.iter().collect();
    let feasible: Vec<&Outfit> = outfits.iter().filter(|outfit| outfit.is_feasible).collect();
    let [all, feasible] = [all, feasible].map(|outfits| OutfitStatistics::of(layers, &outfits));
    Ok(LayerResult { layers, all, feasible })
}

impl OutfitStatistics {
    fn of(layers: usize, outfits: &[&Outfit]) -> Self {
        let results: Vec<&OutfitResult> =
            outfits.iter().filter_map(|outfit| outfit.result.as_ref()).collect();
        let strain_of = |layer: usize, which: usize| -> Vec<f64> {
            outfits.iter().map(|outfit| outfit.strain[layer][which]).collect()
        };
        let median_ratio = |layer: usize| {
            let ratios = outfits.iter().map(|outfit| outfit.strain[layer][1] / outfit.strain[layer][0]);
            Estimate::of(ratios).spread.median
        };
        Self {
            scenes: outfits.len(),
            resolved: results.len(),
            strain: (0..layers).map(|l| Ratio::of(&strain_of(l, 1), &strain_of(l, 0))).collect(),
            strain_median: (0..layers).map(median_ratio).collect(),
            before: Estimate::of_metrics(outfits, &BEFORE),
            after: Estimate::of_metrics(&results, &AFTER),
            intersection_free: [
                Proportion::new(outfits.iter().map(|outfit| outfit.before.is_clear())),
                Proportion::new(results.iter().map(|result| result.after.is_clear())),
            ],
            strain_added: Estimate::of(results.iter().filter_map(|r| r.strain_added)).spread.median,
        }
    }
}

impl LayerResult {
    /// What its rows in a table are called, and stand for: a second one where some orders are feasible and some are not.
    fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        let all = (format!("M = {}", self.layers), &self.all);
        let differs = (1..self.all.scenes).contains(&self.feasible.scenes);
        let feasible = differs.then(|| (format!("M = {}, feasible orders", self.layers), &self.feasible));
        [all].into_iter().chain(feasible)
    }
}

/// The paper's Table 3: rows M = 1 to 6.
const PAPER: [&[f64]; 6] = [
    &[1.0],
    &[1.10, 1.29],
    &[1.16, 1.28, 1.33],
    &[1.32, 1.47, 1.43, 1.83],
    &[1.40, 1.63, 1.45, 1.69, 2.07],
    &[1.61, 1.46, 1.44, 1.63, 1.72, 2.65],
];

fn strain_table(results: &[LayerResult]) -> Table {
    let most = results.iter().map(|result| result.layers).max().unwrap_or(0);
    let mut strain = Table {
        title: "Strain of each layer, innermost first, over the single garment".into(),
        note: "Ratio of means (median of the ratios); after the networks, before the post-process. Training has at most 6 layers. Feasible orders: \
               only the outfits without legs over cloth that hangs between them."
            .into(),
        head: ["layers M".to_owned()].into_iter().chain((1..=most).map(|layer| layer.to_string())).collect(),
        rows: Vec::new(),
    };
    for result in results {
        for (name, outfits) in result.rows() {
            let ratios = outfits.strain.iter().zip(&outfits.strain_median);
            let cells = ratios.map(|(r, median)| format!("{} ({})", number(r.of_means), number(*median)));
            strain = strain.with_row([name].into_iter().chain(cells));
        }
        if let Some(paper) = PAPER.get(result.layers - 1) {
            let name = format!("paper, M = {}", result.layers);
            strain = strain.with_row([name].into_iter().chain(paper.iter().map(|v| format!("{v:.2}"))));
        }
    }
    strain
}

type Row<'a> = (String, &'a OutfitStatistics);

fn order_table(results: &[LayerResult]) -> Table {
    let rows: Vec<Row<'_>> = results.iter().flat_map(LayerResult::rows).collect();
    let mean = |o: &OutfitStatistics, metric: &str| o.before[metric].spread.mean;
    let resolved = |row: &Row<'_>, cell: &dyn Fn(&OutfitStatistics) -> String| match row.1.resolved {
        0 => "–".to_owned(),
        _ => cell(row.1),
    };
    Table::new(
        "Order and contact of the layers",
        &rows,
        &[
            ("layers M", &|(name, _)| name.clone()),
            ("outfits", &|(_, o)| o.scenes.to_string()),
            ("strain of a single garment [J]", &|(_, o)| number(mean(o, "strain_of_single_garments"))),
            ("in the outfit [J]", &|(_, o)| number(mean(o, "strain_in_outfit"))),
            ("layer-order violations, single garments [%]", &|(_, o)| {
                percent(mean(o, "order_violations_of_single_garments"))
            }),
            ("untangled [%]", &|(_, o)| percent_with_interval(&o.before["order_violations"])),
            ("pairs between garments", &|(_, o)| number(mean(o, "layer_pairs"))),
            ("intersection-free", &|(_, o)| share_text(&o.intersection_free[0])),
            ("post-processed outfits", &|(_, o)| o.resolved.to_string()),
            ("layer-order violations then [%]", &|row| {
                resolved(row, &|o| percent_with_interval(&o.after["order_violations_resolved"]))
            }),
            ("intersection-free then", &|row| resolved(row, &|o| share_text(&o.intersection_free[1]))),
            ("strain added, median [%]", &|row| resolved(row, &|o| percent(o.strain_added))),
            ("post-process per garment [ms], median", &|row| {
                resolved(row, &|o| number(o.after["post_process_milliseconds"].spread.median))
            }),
        ],
    )
    .with_note(
        "Layer-order violations: share of outer vertices within 5 cm of an inner layer that lie under its closest surface point. \
         Intersection-free: no pair of triangles intersects exactly, with the body or between garments, outside of pinched regions. Feasible \
         orders: the outfits without legs over cloth that hangs between them, which must intersect at the crotch. In brackets: 95 % intervals of \
         the mean, and of the share in %. Time: outfits in parallel, each on one thread.",
    )
}
