//! Numbers of many outfits, as tables and as JSON.

use crate::cli::table::{Row, row, table};
use crate::evaluation::certificates::OutfitResult;
use crate::run::spread::Spread;
use clothcombo_physics::contact::resolve::Stage;
use serde::Serialize;
use serde_json::{Value, json};

/// Outfits on a body with fewer pairs in pinched regions before the post-process are called hardly pinched.
const HARDLY_PINCHED: usize = 200;

/// Times within which outfits are clear (s).
const WITHIN: [f64; 5] = [0.1, 1.0, 10.0, 60.0, 600.0];

/// Groups of outfits: key in JSON, name in tables, what belongs to it.
type Group = (&'static str, &'static str, fn(&OutfitResult) -> bool);

const GROUPS: [Group; 5] = [
    ("all", "all", |_| true),
    ("wearable", "in a feasible order", |r| r.is_feasible),
    ("in_one_go", "no path needed", |r| r.steps == 0),
    ("fast_pass", "cleared by the fast pass", |r| r.stage == Stage::FastPass),
    ("hardly_pinched", "on a hardly pinched body", |r| r.before.pinched_pairs < HARDLY_PINCHED),
];

/// All numbers, with every outfit.
pub(super) fn report(results: &[OutfitResult], layers: usize) -> Value {
    let by_layers = (1..=layers).map(|layers| Summary::new(results, |r| r.garments.len() == layers));
    let mut report = json!({
        "by_layers": by_layers.collect::<Vec<_>>(),
        "clear_within": WITHIN
            .map(|seconds| json!({ "seconds": seconds, "share": clear_within(results, seconds) })),
        "failures": failures(results).collect::<Vec<_>>(),
        "outfits": results,
    });
    for (key, _, belongs) in GROUPS {
        report[key] = json!(Summary::new(results, belongs));
    }
    report
}

fn failures(results: &[OutfitResult]) -> impl Iterator<Item = &OutfitResult> {
    results.iter().filter(|r| !r.after.is_clear())
}

/// Share of the outfits that are clear and took no longer.
fn clear_within(results: &[OutfitResult], seconds: f64) -> f64 {
    let clear = results.iter().filter(|r| r.after.is_clear() && time_of(r) <= 1e3 * seconds).count();
    clear as f64 / results.len().max(1) as f64
}

/// The whole time of an outfit, for the body and for certificates too (ms).
fn time_of(result: &OutfitResult) -> f64 {
    result.body_milliseconds + result.milliseconds.iter().sum::<f64>() + result.certificate_milliseconds
}

/// That time shared out to the garments by vertices (ms).
fn per_garment(result: &OutfitResult) -> Vec<f64> {
    let per_vertex = per_vertex(result);
    result.vertices.iter().map(|&vertices| per_vertex * vertices as f64).collect()
}

fn per_8000_vertices(result: &OutfitResult) -> Vec<f64> {
    vec![8000.0 * per_vertex(result); result.vertices.len()]
}

fn per_vertex(result: &OutfitResult) -> f64 {
    time_of(result) / result.vertices.iter().sum::<usize>().max(1) as f64
}

/// A group of outfits: shares of them, and spreads over them.
#[derive(Serialize)]
struct Summary {
    outfits: usize,
    clear_before: f64,
    clear_after: f64,
    clear_of_self_after: f64,
    pinched_after: f64,
    order_violations_after: Option<Spread>,
    order_violations_nearest_vertex_after: Option<Spread>,
    strain_added: Option<Spread>,
    milliseconds_per_garment: Option<Spread>,
    milliseconds_per_8000_vertices: Option<Spread>,
    body_milliseconds: Option<Spread>,
    certificate_milliseconds: Option<Spread>,
    fast_milliseconds_in_vain: Option<Spread>,
    element_tests: Option<Spread>,
    drawn_back: Option<Spread>,
    #[serde(skip)]
    largest_move_mm: Option<Spread>,
}

impl Summary {
    fn new(results: &[OutfitResult], belongs: impl Fn(&OutfitResult) -> bool) -> Self {
        let chosen: Vec<&OutfitResult> = results.iter().filter(|r| belongs(r)).collect();
        let share = |holds: fn(&OutfitResult) -> bool| {
            chosen.iter().filter(|r| holds(r)).count() as f64 / chosen.len().max(1) as f64
        };
        let spread = |values: fn(&OutfitResult) -> Vec<f64>| {
            let all: Vec<f64> = chosen.iter().flat_map(|r| values(r)).collect();
            (!all.is_empty()).then(|| Spread::of(all))
        };
        Self {
            outfits: chosen.len(),
            clear_before: share(|r| r.before.is_clear()),
            clear_after: share(|r| r.after.is_clear()),
            clear_of_self_after: share(|r| r.after.self_triangle_pairs == 0),
            pinched_after: share(|r| r.after.pinched_pairs > 0),
            order_violations_after: spread(|r| vec![r.after.order_violations]),
            order_violations_nearest_vertex_after: spread(|r| vec![r.after.order_violations_nearest_vertex]),
            strain_added: spread(|r| r.strain_added.into_iter().collect()),
            milliseconds_per_garment: spread(per_garment),
            milliseconds_per_8000_vertices: spread(per_8000_vertices),
            body_milliseconds: spread(|r| vec![r.body_milliseconds]),
            certificate_milliseconds: spread(|r| vec![r.certificate_milliseconds]),
            fast_milliseconds_in_vain: spread(|r| match r.stage {
                Stage::FastPass => Vec::new(),
                _ => vec![r.fast_milliseconds],
            }),
            element_tests: spread(|r| vec![r.filter.element_tests as f64]),
            drawn_back: spread(|r| vec![r.filter.drawn_back as f64]),
            largest_move_mm: spread(|r| vec![r.largest_move_mm]),
        }
    }

    fn row(&self, name: String) -> Row {
        let order = self.order_violations_after.map_or(0.0, |s| s.mean);
        let strain = self.strain_added.map_or(0.0, |s| s.median);
        let time = self.milliseconds_per_garment.unwrap_or_default();
        row! {
            "outfits" => name,
            "outfits" => self.outfits,
            "clear %" => 100.0 * self.clear_before,
            "after %" => 100.0 * self.clear_after,
            "self %" => 100.0 * self.clear_of_self_after,
            "pinched %" => 100.0 * self.pinched_after,
            "order %" => 100.0 * order,
            "strain %" => 100.0 * strain,
            "p50 ms" => time.median,
            "p95 ms" => time.p95,
        }
    }
}

/// All numbers, and the outfits that are not clear.
pub(super) fn tables(results: &[OutfitResult], layers: usize) -> String {
    let most = results.iter().map(|r| r.garments.len()).max().unwrap_or(0).max(layers);
    let by_count = (1..=most)
        .map(|count| (format!("{count} garments"), Summary::new(results, |r| r.garments.len() == count)));
    let groups = GROUPS.into_iter().map(|(_, name, belongs)| (name.into(), Summary::new(results, belongs)));
    let groups = by_count.chain(groups).filter(|(_, group)| group.outfits > 0);
    let groups: Vec<Row> = groups.map(|(name, group)| group.row(name)).collect();

    let all = Summary::new(results, |_| true);
    let spreads = [
        ("ms per 8,000 vertices", all.milliseconds_per_8000_vertices),
        ("ms for the body", all.body_milliseconds),
        ("ms for the certificate", all.certificate_milliseconds),
        ("ms of the fast pass where it was not enough", all.fast_milliseconds_in_vain),
        ("element tests of the step filter", all.element_tests),
        ("vertices drawn back by the step filter", all.drawn_back),
        ("largest move [mm]", all.largest_move_mm),
    ];
    let spread = |(what, spread): (&str, Option<Spread>)| {
        let [median, p95] = [spread.map(|s| s.median), spread.map(|s| s.p95)];
        row!["all outfits" => what, "p50" => median, "p95" => p95]
    };
    let within = WITHIN.map(|s| format!("{:.0} % in {s} s", 100.0 * clear_within(results, s)));
    let mut text = format!(
        "{}\n{}clear, of all outfits:  {}\n",
        table(&groups),
        table(&spreads.map(spread)),
        within.join(", ")
    );
    let failures: Vec<Row> = failures(results).map(failure_row).collect();
    if !failures.is_empty() {
        text += &format!("\n{}", table(&failures));
    }
    text
}

fn failure_row(r: &OutfitResult) -> Row {
    let pairs = |before: usize, after: usize| format!("{before} → {after}");
    row! {
        "not clear" => r.outfit,
        "body pairs" => pairs(r.before.body_triangle_pairs, r.after.body_triangle_pairs),
        "narrow of these" => r.after.narrow_triangle_pairs,
        "layer pairs" => pairs(r.before.layer_triangle_pairs, r.after.layer_triangle_pairs),
        "pinched" => r.after.pinched_pairs,
        "deepest [mm]" => r.after.max_depth_mm,
        "garments" => r.garments.join(" < "),
        "" => if r.is_feasible { "" } else { "(infeasible order)" },
    }
}
