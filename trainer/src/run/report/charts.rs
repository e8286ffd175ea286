//! The charts of a run: a quantity each, over the steps.

use crate::config::Config;
use crate::dataset::ValidationGroup;
use crate::picture::chart::{Baseline, Chart, RunSteps};
use crate::run::event::StepRecord;
use crate::run::observer::History;
use clothcombo_physics::energy::Term;

/// What the steps of a stage are compared with: skinning of as many garments as they have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageBaseline {
    group: ValidationGroup,
    /// Whether the scenes of the group have as many garments as those of the stage; else energies are of other sums.
    has_as_many_garments: bool,
}

impl StageBaseline {
    /// Of every stage of `config`.
    pub fn of_stages(config: &Config) -> Vec<Self> {
        let of_stage = |layers: [usize; 2]| match layers {
            [_, 1] => Self { group: ValidationGroup::Single, has_as_many_garments: true },
            _ => Self {
                group: ValidationGroup::Layered,
                has_as_many_garments: layers == config.validation.layers,
            },
        };
        config.stages.iter().map(|stage| of_stage(stage.layers)).collect()
    }

    fn of(self, history: &History, term: &'static str) -> Option<Baseline> {
        // Single garments have no energies between layers.
        let is_there = self.group != ValidationGroup::Single
            || Term::ALL.iter().all(|other| other.name() != term || !other.is_layer_term());
        let value = history.baselines.get(&(self.group.name().to_owned(), term)).filter(|_| is_there)?;
        Some(Baseline { value: *value, is_comparable: self.has_as_many_garments })
    }
}

/// Name and chart of every quantity.
pub(crate) fn charts(
    history: &History,
    steps: &RunSteps,
    stages: &[StageBaseline],
) -> Vec<(&'static str, Chart)> {
    let draw = |name: &'static str, title: &str, unit: &str| {
        let baselines: Vec<_> = stages.iter().map(|stage| stage.of(history, name)).collect();
        (name, steps.curve(title, unit, history.points(name), &baselines))
    };
    let mut charts =
        vec![draw("loss", "loss", "weighted J"), draw("grad_norm", "gradient norm", "before clipping")];
    charts.extend(StepRecord::term_names().map(|name| draw(name, &name.replace('_', " "), unit(name))));
    charts.push(draw("lr", "learning rate", ""));
    charts.push(("time", time_split(history, steps)));
    charts
}

/// Where the time of a step goes.
fn time_split(history: &History, steps: &RunSteps) -> Chart {
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
