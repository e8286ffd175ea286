//! `clothcombo bench step`.

use crate::cli::train::load_under_bar;
use crate::cli::values::{at_least_one, measuring_seconds, picture_file};
use crate::cli::verbosity::say;
use crate::config::{Config, load};
use crate::picture::chart::{Bar, draw_bars};
use crate::picture::save_png;
use crate::system::device::Backend;
use crate::training::measure::{Case, Costs, PHASES, Profile, Subject, export};
use clap::Parser;
use clothcombo_physics::energy::Term;
use miette::{IntoDiagnostic, Report, miette};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

/// Where the time of a training step goes
#[derive(Parser)]
#[command(
    after_help = "Examples:\n  clothcombo bench step --widths 64,128 --layers 1,3 --picture step.png\n  \
        clothcombo bench step --config configs/open.toml --picture open.png --json > open.json\n  \
        clothcombo bench step --config configs/paper.toml --stage 1 --set model.width=64 --export case\n\n\
        Two threads and fewer: RAYON_NUM_THREADS=2. Nothing else should run meanwhile."
)]
pub struct Arguments {
    /// Measures the stages of this configuration instead of made-up runs
    #[arg(long, value_name = "FILE", conflicts_with_all = ["widths", "layers", "vertices", "eigen_count", "blocks", "bodies"])]
    config: Option<PathBuf>,
    /// With --config: only this stage, counted from 0 as in stages.0
    #[arg(long, value_name = "N", requires = "config")]
    stage: Option<usize>,
    /// Overrides one value of the configuration or of every made-up run, for example losses.strain.weight=2; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Widths of the networks; the number of DiffusionNet blocks and eigenpairs goes with them
    #[arg(long, value_delimiter = ',', default_values_t = [64, 128])]
    widths: Vec<usize>,
    /// Numbers of garments
    #[arg(long, value_delimiter = ',', default_values_t = [1, 3])]
    layers: Vec<usize>,
    /// Vertices per garment, about
    #[arg(long, value_delimiter = ',', default_values_t = [2000])]
    vertices: Vec<usize>,
    /// Eigenpairs per garment, instead of those that go with the width
    #[arg(long, value_delimiter = ',')]
    eigen_count: Vec<usize>,
    /// DiffusionNet blocks, instead of those that go with the width
    #[arg(long)]
    blocks: Option<usize>,
    /// Bodies per step, which share the garments' embeddings
    #[arg(long, value_delimiter = ',', default_values_t = [1])]
    bodies: Vec<usize>,
    /// Also times a step on this many outfits (accumulate), which are computed beside each other
    #[arg(long, value_name = "OUTFITS", default_value_t = 1)]
    accumulate: usize,
    /// Training steps that are profiled
    #[arg(long, default_value_t = 10, value_parser = at_least_one)]
    steps: usize,
    /// Time spent on each single measurement [s]
    #[arg(long, default_value_t = 1.0, value_parser = measuring_seconds)]
    seconds: f64,
    /// Compute device
    #[arg(long, value_enum, default_value_t = Backend::preferred())]
    device: Backend,
    /// Writes the shares of a step as stacked bars (PNG)
    #[arg(long, value_name = "FILE", value_parser = picture_file())]
    picture: Option<PathBuf>,
    /// Writes scene, networks and results of the only case or stage into a folder, for scripts/bench_torch.py
    #[arg(long, value_name = "DIR")]
    export: Option<PathBuf>,
    /// Print JSON instead of Markdown tables
    #[arg(long)]
    json: bool,
}

/// What was measured of one case.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Measured {
    /// What it is.
    pub name: String,
    /// Its sizes; absent for a stage of a configuration.
    pub sizes: Option<Sizes>,
    /// Garments of the measured scene.
    pub layers: usize,
    /// Vertices of all its garments.
    pub vertices: usize,
    /// Parameters of all networks.
    pub parameters: usize,
    /// Where the time of a step goes.
    pub profile: Profile,
    /// Single parts.
    pub costs: Costs,
}

/// The sizes a case was asked for.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Sizes {
    pub vertices: usize,
    pub layers: usize,
    pub width: usize,
    pub eigen_count: usize,
    pub bodies: usize,
}

/// Runs the verb.
///
/// # Errors
/// When the configuration or its data cannot be read, a size is out of range, or an output cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let measured = match &arguments.config {
        Some(file) => stages(arguments, load(file, &arguments.overrides)?)?,
        None => made_up(arguments)?,
    };
    if let Some(path) = &arguments.picture {
        save_png(&picture(&measured), path).into_diagnostic()?;
    }
    if arguments.json {
        let report = serde_json::json!({
            "threads": rayon::current_num_threads(),
            "device": format!("{:?}", arguments.device).to_lowercase(),
            "cases": measured,
        });
        println!("{}", serde_json::to_string_pretty(&report).into_diagnostic()?);
    } else {
        print_tables(&measured);
    }
    Ok(())
}

fn made_up(arguments: &Arguments) -> Result<Vec<Measured>, Report> {
    let cases = cases(arguments);
    if arguments.export.is_some() && cases.len() != 1 {
        return Err(miette!(
            help = "give one width, one number of layers and one of vertices",
            "--export writes one case, these are {}",
            cases.len()
        ));
    }
    let mut measured = Vec::with_capacity(cases.len());
    for case in cases {
        let config = case.config(&arguments.overrides)?;
        let case = case.of_config(&config);
        let dataset = Arc::new(load_under_bar(&config)?);
        let mut subject = Subject::new(config, dataset, 0, &arguments.device.device())?;
        let name =
            std::iter::once(case.name()).chain(arguments.overrides.iter().cloned()).collect::<Vec<_>>();
        measured.push(measure(&mut subject, name.join(", "), Some(case), arguments)?);
    }
    Ok(measured)
}

fn cases(arguments: &Arguments) -> Vec<Case> {
    let mut cases = Vec::new();
    for &width in &arguments.widths {
        for &layers in &arguments.layers {
            for &vertices in &arguments.vertices {
                for &bodies in &arguments.bodies {
                    let case = Case::new(width, layers, vertices);
                    let case = Case { bodies, blocks: arguments.blocks.unwrap_or(case.blocks), ..case };
                    match arguments.eigen_count.as_slice() {
                        [] => cases.push(case),
                        counts => {
                            cases.extend(counts.iter().map(|&eigen_count| Case { eigen_count, ..case }))
                        }
                    }
                }
            }
        }
    }
    cases
}

fn stages(arguments: &Arguments, config: Config) -> Result<Vec<Measured>, Report> {
    let names: Vec<String> = config.stages.iter().map(|stage| stage.name.clone()).collect();
    let all =
        || names.iter().enumerate().map(|(i, name)| format!("{i} {name:?}")).collect::<Vec<_>>().join(", ");
    let chosen: Vec<usize> = match arguments.stage {
        Some(stage) if stage < names.len() => vec![stage],
        Some(stage) => {
            return Err(miette!(help = format!("there are {}", all()), "--stage {stage}: no such stage"));
        }
        None => (0..names.len()).collect(),
    };
    if arguments.export.is_some() && chosen.len() != 1 {
        return Err(miette!(
            help = format!("choose one with --stage: {}", all()),
            "--export writes one stage, the configuration has {}",
            names.len()
        ));
    }
    let dataset = Arc::new(load_under_bar(&config)?);
    let stage = |index: usize| {
        let mut subject = Subject::new(config.clone(), dataset.clone(), index, &arguments.device.device())?;
        measure(&mut subject, names[index].clone(), None, arguments)
    };
    chosen.into_iter().map(stage).collect()
}

fn measure(
    subject: &mut Subject,
    name: String,
    case: Option<Case>,
    arguments: &Arguments,
) -> Result<Measured, Report> {
    if let Some(folder) = &arguments.export {
        export(subject, folder)?;
    }
    say(&format!("measuring {name}"));
    let scene = subject.scene(0)?;
    let costs = subject.costs(arguments.seconds, arguments.accumulate)?;
    let profile = subject.profile(arguments.steps)?;
    Ok(Measured {
        name,
        sizes: case.map(|Case { vertices, layers, width, eigen_count, bodies, .. }| Sizes {
            vertices,
            layers,
            width,
            eigen_count,
            bodies,
        }),
        layers: scene.garments.len(),
        vertices: scene.garments.iter().map(|garment| garment.vertex_count()).sum(),
        parameters: burn::module::Module::num_params(subject.model()),
        profile,
        costs,
    })
}

fn picture(measured: &[Measured]) -> image::RgbImage {
    let bars: Vec<Bar> = measured
        .iter()
        .map(|m| Bar {
            label: m.name.clone(),
            parts: m.profile.phases_ms.iter().map(|(_, ms)| *ms).collect(),
            total: format!("{} ms", short(m.profile.step_ms)),
        })
        .collect();
    draw_bars("Time of a training step by part", &PHASES, &bars)
}

/// Three digits.
pub(crate) fn short(ms: f64) -> String {
    match ms {
        ms if ms < 0.0005 => "0".into(),
        ms if ms < 1.0 => format!("{ms:.3}"),
        ms if ms < 10.0 => format!("{ms:.2}"),
        ms if ms < 100.0 => format!("{ms:.1}"),
        ms => format!("{ms:.0}"),
    }
}

fn print_tables(measured: &[Measured]) {
    println!("Where the time of a training step goes, medians [ms].\n");
    println!("| case | step | {} |", PHASES.join(" | "));
    println!("|---|{}", "---:|".repeat(PHASES.len() + 1));
    for m in measured {
        let phases: Vec<String> = m.profile.phases_ms.iter().map(|(_, ms)| short(*ms)).collect();
        println!("| {} | {} | {} |", m.name, short(m.profile.step_ms), phases.join(" | "));
    }
    println!("\nParts of one scene, medians [ms]; scenes are prepared on another thread.\n");
    println!(
        "| case | vertices | parameters | forward | forward + backward | step | step on several outfits | losses | drape again | prepare scene | peak memory [MiB] |"
    );
    println!("|---|{}", "---:|".repeat(10));
    for m in measured {
        let c = &m.costs;
        let several = c.step_of_several_ms.map_or("–".into(), short);
        let [before, after] = [
            [c.forward_ms, c.forward_backward_ms, c.step_ms],
            [c.losses_ms, c.drape_ms, m.profile.prepare_ms],
        ]
        .map(|times| times.map(short).join(" | "));
        let peak = c.peak_mib.map_or("–".into(), |mib| format!("{mib:.0}"));
        println!(
            "| {} | {} | {} | {before} | {several} | {after} | {peak} |",
            m.name, m.vertices, m.parameters
        );
    }
    println!("\nEvery loss alone, value and gradient [ms].\n");
    println!("| case | {} |", Term::ALL.map(Term::name).join(" | "));
    println!("|---|{}", "---:|".repeat(Term::COUNT));
    for m in measured {
        let times =
            Term::ALL.map(|term| m.costs.terms_ms.get(term.name()).map_or("–".into(), |ms| short(*ms)));
        println!("| {} | {} |", m.name, times.join(" | "));
    }
}
