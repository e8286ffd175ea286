//! `clothcombo replay`: a step whose loss or gradient was not finite, once more.

use crate::cli::device_argument::DeviceArgument;
use crate::cli::loading::load_dataset;
use crate::cli::table::{row, table};
use crate::system::exact::Exact;
use crate::training::incident::Incident;
use clap::Parser;
use miette::{Report, miette};
use std::path::PathBuf;

/// Computes a step that was skipped (RUN/incidents/step-N.json) again and compares every energy
#[derive(Parser)]
#[command(after_help = "Examples:\n  clothcombo replay runs/wide/incidents/step-120.json\n  \
        clothcombo replay step-120.json --set data.body=elsewhere/body.npz\n\n\
        The weights lie beside the file (step-120.bpk); the data must be that of the run. Exits 0 if every number comes back \
        to the bit, 1 if not.")]
pub struct Arguments {
    /// The incident
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Overrides one value of the run's configuration, for data that has moved; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    #[command(flatten)]
    device: DeviceArgument,
    /// Every number, not only those that are not finite or differ
    #[arg(long, short)]
    all: bool,
}

/// Runs the verb.
///
/// # Errors
/// When the incident or the data cannot be used, or a number does not come back.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let file = &arguments.file;
    let incident = Incident::read(file)?;
    let config = incident.configuration(file, &arguments.overrides)?;
    let device = arguments.device.open()?;
    let dataset = load_dataset(&config)?;
    let again = incident.replay(file, &config, &dataset, &device)?;

    println!("step {} of stage {:?}, seed {}", incident.step, incident.stage, incident.seed);
    if let Some(injected) = incident.injected {
        println!("a test broke it on purpose: {injected:?}");
    }
    for (i, scene) in incident.scenes.iter().enumerate() {
        let names: Vec<&str> = scene.garments.iter().map(|g| g.name.as_str()).collect();
        println!("scene {i}: {} on {} bodies", names.join(" under "), scene.bodies.len());
    }
    let (then, now) = (incident.numbers(), again.numbers());
    let mut differing = 0;
    let mut rows = Vec::new();
    for ((name, a), (_, b)) in then.iter().zip(&now) {
        let same = a.same(*b);
        differing += usize::from(!same);
        if arguments.all || !same || !a.0.is_finite() {
            let differs = if same { "" } else { "differs" };
            rows.push(row!["" => name, "recorded" => text(*a), "replayed" => text(*b), "" => differs]);
        }
    }
    print!("{}", table(&rows));
    if differing > 0 || then.len() != now.len() {
        return Err(miette!(
            help = "another program version, device or data gives other numbers; the scene is the same",
            "{differing} of {} numbers did not come back to the bit",
            then.len()
        ));
    }
    println!("all {} numbers came back to the bit", then.len());
    Ok(())
}

fn text(value: Exact) -> String {
    match value.0 {
        v if v == 0.0 || (1e-4..1e6).contains(&v.abs()) => format!("{v:.9}"),
        v => format!("{v:.9e}"),
    }
}
