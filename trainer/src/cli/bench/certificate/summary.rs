//! Numbers of many outfits, as tables and as JSON.

use crate::evaluation::certificates::OutfitResult;
use crate::run::spread::Spread;
use serde_json::{Value, json};

/// Outfits on a body with fewer pairs in pinched regions before the post-process are called hardly pinched.
const HARDLY_PINCHED: usize = 200;

/// Times within which outfits are clear [s].
const WITHIN: [f64; 5] = [0.1, 1.0, 10.0, 60.0, 600.0];

/// Groups of outfits: key in JSON, name in tables, what belongs to it.
type Group = (&'static str, &'static str, fn(&OutfitResult) -> bool);

const GROUPS: [Group; 4] = [
    ("all", "all", |_| true),
    ("wearable", "in a wearable order", |r| r.is_wearable),
    ("in_one_go", "no path needed", |r| r.steps == 0),
    ("hardly_pinched", "on a hardly pinched body", |r| r.before.pinched_pairs < HARDLY_PINCHED),
];

/// All numbers, with every draw.
pub(super) fn report(results: &[OutfitResult], layers: usize) -> Value {
    let mut report = json!({
        "by_layers": (1..=layers)
            .map(|layers| summary(results, |r| r.garments.len() == layers))
            .collect::<Vec<_>>(),
        "clear_within": WITHIN
            .map(|seconds| json!({ "seconds": seconds, "share": clear_within(results, seconds) })),
        "failures": results.iter().filter(|r| !r.after.is_clear()).collect::<Vec<_>>(),
        "draws": results,
    });
    for (key, _, belongs) in GROUPS {
        report[key] = summary(results, belongs);
    }
    report
}

/// Share of the outfits that are clear and took no longer.
fn clear_within(results: &[OutfitResult], seconds: f64) -> f64 {
    let clear = results.iter().filter(|r| r.after.is_clear() && time_of(r) <= 1e3 * seconds).count();
    clear as f64 / results.len().max(1) as f64
}

/// The whole time of an outfit, for the body and for certificates too [ms].
fn time_of(result: &OutfitResult) -> f64 {
    result.body_milliseconds + result.milliseconds.iter().sum::<f64>() + result.certificate_milliseconds
}

/// That time shared out to the garments by vertices [ms].
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

/// Where a share of 500 draws may not hold, every number that stands for the rest.
fn summary(results: &[OutfitResult], counts: impl Fn(&OutfitResult) -> bool) -> Value {
    let chosen: Vec<&OutfitResult> = results.iter().filter(|r| counts(r)).collect();
    let share = |holds: &dyn Fn(&OutfitResult) -> bool| {
        chosen.iter().filter(|r| holds(r)).count() as f64 / chosen.len().max(1) as f64
    };
    json!({
        "draws": chosen.len(),
        "clear_before": share(&|r| r.before.is_clear()),
        "clear_after": share(&|r| r.after.is_clear()),
        "clear_of_self_after": share(&|r| r.after.self_triangle_pairs == 0),
        "pinched_after": share(&|r| r.after.pinched_pairs > 0),
        "order_violations_after": spread(&chosen, |r| vec![r.after.order_violations]),
        "order_violations_nearest_vertex_after":
            spread(&chosen, |r| vec![r.after.order_violations_nearest_vertex]),
        "strain_added": spread(&chosen, |r| r.strain_added.into_iter().collect()),
        "milliseconds_per_garment": spread(&chosen, per_garment),
        "milliseconds_per_8000_vertices": spread(&chosen, per_8000_vertices),
        "body_milliseconds": spread(&chosen, |r| vec![r.body_milliseconds]),
        "certificate_milliseconds": spread(&chosen, |r| vec![r.certificate_milliseconds]),
    })
}

fn spread(results: &[&OutfitResult], values: impl Fn(&OutfitResult) -> Vec<f64>) -> Option<Spread> {
    let all: Vec<f64> = results.iter().flat_map(|r| values(r)).collect();
    (!all.is_empty()).then(|| Spread::of(all))
}

/// Prints all numbers, and the outfits that are not clear.
pub(super) fn print_tables(results: &[OutfitResult], layers: usize) {
    println!(
        "{:<26}{:>7}{:>9}{:>9}{:>9}{:>10}{:>10}{:>10}{:>9}{:>9}",
        "outfits",
        "draws",
        "clear %",
        "after %",
        "self %",
        "pinched %",
        "order %",
        "strain %",
        "p50 ms",
        "p95 ms"
    );
    let line = |name: String, counts: &dyn Fn(&OutfitResult) -> bool| {
        let chosen: Vec<&OutfitResult> = results.iter().filter(|r| counts(r)).collect();
        if chosen.is_empty() {
            return;
        }
        let share = |holds: &dyn Fn(&OutfitResult) -> bool| {
            100.0 * chosen.iter().filter(|r| holds(r)).count() as f64 / chosen.len() as f64
        };
        let strain = spread(&chosen, |r| r.strain_added.into_iter().collect());
        let time = spread(&chosen, per_garment);
        let order = spread(&chosen, |r| vec![r.after.order_violations]);
        println!(
            "{name:<26}{:>7}{:>9.1}{:>9.1}{:>9.1}{:>10.1}{:>10.3}{:>10.2}{:>9.1}{:>9.1}",
            chosen.len(),
            share(&|r| r.before.is_clear()),
            share(&|r| r.after.is_clear()),
            share(&|r| r.after.self_triangle_pairs == 0),
            share(&|r| r.after.pinched_pairs > 0),
            100.0 * order.map_or(0.0, |s| s.mean),
            100.0 * strain.map_or(0.0, |s| s.median),
            time.map_or(0.0, |s| s.median),
            time.map_or(0.0, |s| s.p95),
        );
    };
    let most = results.iter().map(|r| r.garments.len()).max().unwrap_or(0).max(layers);
    for count in 1..=most {
        line(format!("{count} garments"), &|r| r.garments.len() == count);
    }
    for (_, name, belongs) in GROUPS {
        line(name.into(), &belongs);
    }
    let all: Vec<&OutfitResult> = results.iter().collect();
    for (what, found) in [
        ("ms per 8,000 vertices", spread(&all, per_8000_vertices)),
        ("ms for the body", spread(&all, |r| vec![r.body_milliseconds])),
        ("ms for the certificate", spread(&all, |r| vec![r.certificate_milliseconds])),
        ("largest move [mm]", spread(&all, |r| vec![r.largest_move_mm])),
    ] {
        if let Some(s) = found {
            println!("{what:<24}p50 {:>8.1}   p95 {:>8.1}", s.median, s.p95);
        }
    }
    let within = WITHIN.map(|s| format!("{:.0} % in {s} s", 100.0 * clear_within(results, s)));
    println!("clear, of all outfits:  {}", within.join(", "));
    let failures: Vec<&OutfitResult> = results.iter().filter(|r| !r.after.is_clear()).collect();
    if !failures.is_empty() {
        println!(
            "\nnot clear: pairs with the body (before → after, of those narrow), between layers; pinched; deepest [mm]"
        );
    }
    for r in failures {
        println!(
            "{:>5}  {:>5} → {:<5}{:>5}{:>6} → {:<5}{:>6}{:>8.1}  {}{}",
            r.draw,
            r.before.body_triangle_pairs,
            r.after.body_triangle_pairs,
            r.after.narrow_triangle_pairs,
            r.before.layer_triangle_pairs,
            r.after.layer_triangle_pairs,
            r.after.pinched_pairs,
            r.after.max_depth_mm,
            r.garments.join(" < "),
            if r.is_wearable { "" } else { "  (cannot be worn)" }
        );
    }
}
