//! The charts of a run: a quantity each, over the steps.

use crate::picture::chart::{Chart, Steps};
use crate::run::event::StepRecord;
use crate::run::observer::History;

/// Name and chart of every quantity.
pub(crate) fn charts(history: &History, steps: &Steps) -> Vec<(&'static str, Chart)> {
    let draw = |name: &'static str, title: &str, unit: &str| {
        let baseline = history.baselines.get(name).copied();
        (name, steps.curve(title, unit, history.points(name), baseline))
    };
    let mut charts =
        vec![draw("loss", "loss", "weighted J"), draw("grad_norm", "gradient norm", "before clipping")];
    charts.extend(StepRecord::term_names().map(|name| draw(name, &name.replace('_', " "), unit(name))));
    charts.push(draw("lr", "learning rate", ""));
    charts.push(("time", time_split(history, steps)));
    charts
}

/// Where the time of a step goes.
fn time_split(history: &History, steps: &Steps) -> Chart {
    let milliseconds = |name: &str| -> Vec<(f64, f64)> {
        history.points(name).iter().map(|(step, s)| (*step, 1000.0 * s)).collect()
    };
    let [wait, forward, backward, update] =
        ["wait_seconds", "forward_seconds", "backward_seconds", "update_seconds"].map(milliseconds);
    let rest = milliseconds("seconds").into_iter().enumerate().map(|(i, (step, whole))| {
        let parts = [&wait, &forward, &backward, &update];
        let known: f64 = parts.iter().filter_map(|part| Some(part.get(i)?.1)).sum();
        (step, (whole - known).max(0.0))
    });
    let rest = rest.collect();
    let parts = [
        ("forward", forward),
        ("backward", backward),
        ("update", update),
        ("waiting for scenes", wait),
        ("rest", rest),
    ];
    steps.stacked("time of a step", "ms", &parts)
}

/// The unit of a raw energy.
fn unit(term: &str) -> &'static str {
    match term {
        "strain" | "bending" | "gravity" => "J",
        "holding" => "m²",
        "repulsion" => "",
        _ => "m³",
    }
}
