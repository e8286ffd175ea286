//! `clothcombo bench step`.

use crate::cli::device_argument::DeviceArgument;
use crate::cli::loading::load_dataset;
use crate::cli::output::print_report;
use crate::cli::table::{Cell, Row, markdown, row};
use crate::cli::values::{at_least_one, folder_to_make, measuring_seconds};
use crate::cli::verbosity::print_status;
use crate::config::{Config, load};
use crate::system::device::name;
use crate::training::measure::{BenchmarkRun, Case, Costs, Profile, export};
use burn::module::Module;
use burn::tensor::Device;
use clap::Parser;
use clothcombo_physics::energy::Term;
use miette::{Report, miette};
use serde::Serialize;
use std::path::PathBuf;

/// Where the time of a training step goes
#[derive(Parser)]
#[command(after_help = "Examples:\n  clothcombo bench step --widths 64,128 --layers 1,3\n  \
        clothcombo bench step --config configs/open.toml --json > open.json\n  \
        clothcombo bench step --config configs/paper.toml --stage 1 --set model.width=64 --export case\n\n\
        Two threads and fewer: RAYON_NUM_THREADS=2. Nothing else should run meanwhile.")]
pub struct Arguments {
    /// Measures the stages of this configuration instead of synthetic runs
    #[arg(long, value_name = "FILE", conflicts_with_all = ["widths", "layers", "vertices", "eigen_count", "blocks", "bodies"])]
    config: Option<PathBuf>,
    /// With --config: only this stage, counted from 0 as in stages.0
    #[arg(long, value_name = "N", requires = "config")]
    stage: Option<usize>,
    /// Overrides one value of the configuration or of every synthetic run, for example losses.strain.weight=2; repeatable
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
    /// Also times a step on this many outfits (accumulate), which are computed in parallel
    #[arg(long, value_name = "OUTFITS", default_value_t = 1, value_parser = at_least_one)]
    accumulate: usize,
    /// Training steps that are profiled
    #[arg(long, default_value_t = 10, value_parser = at_least_one)]
    steps: usize,
    /// Time spent on each single measurement (s)
    #[arg(long, default_value_t = 1.0, value_parser = measuring_seconds)]
    seconds: f64,
    #[command(flatten)]
    device: DeviceArgument,
    /// Writes scene, networks and results of the only case or stage into a folder, for scripts/bench_torch.py
    #[arg(long, value_name = "DIR", value_parser = folder_to_make())]
    export: Option<PathBuf>,
    /// With --export: measures nothing
    #[arg(long, requires = "export")]
    export_only: bool,
    /// Print JSON instead of Markdown tables
    #[arg(long)]
    json: bool,
}

/// Results of one case.
#[derive(Clone, Debug, Serialize)]
struct CaseCosts {
    name: String,
    /// Absent for a stage of a configuration.
    sizes: Option<Case>,
    /// Garments of the measured scene.
    layers: usize,
    /// Vertices of all its garments.
    vertices: usize,
    /// Parameters of all networks.
    parameters: usize,
    profile: Profile,
    costs: Costs,
}

/// Runs the verb.
///
/// # Errors
/// When the configuration or its data cannot be read, a size is out of range, or an output cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let device = arguments.device.open()?;
    let measured = match &arguments.config {
        Some(file) => stages(arguments, load(file, &arguments.overrides)?, &device)?,
        None => synthetic(arguments, &device)?,
    };
    if arguments.export_only {
        return Ok(());
    }
    let report = serde_json::json!({
        "threads": rayon::current_num_threads(),
        "device": name(&device),
        "cases": &measured,
    });
    print_report(arguments.json, &report, |_| tables(&measured))
}

fn synthetic(arguments: &Arguments, device: &Device) -> Result<Vec<CaseCosts>, Report> {
    let cases = cases(arguments);
    if arguments.export.is_some() && cases.len() != 1 {
        return Err(miette!(
            help = "give one width, one number of layers and one of vertices",
            "--export writes one case, these are {}",
            cases.len()
        ));
    }
    let measured = cases.into_iter().map(|case| {
        let config = case.config(&arguments.overrides)?;
        let case = case.of_config(&config);
        let dataset = load_dataset(&config)?;
        let mut run = BenchmarkRun::new(config, dataset, 0, device)?;
        let name = [&[case.name()][..], arguments.overrides.as_slice()].concat().join(", ");
        measure(&mut run, name, Some(case), arguments)
    });
    measured.filter_map(Result::transpose).collect()
}

/// Every combination of the sizes.
fn cases(arguments: &Arguments) -> Vec<Case> {
    let Arguments { widths, layers, vertices, bodies, eigen_count, .. } = arguments;
    let sizes = widths.iter().flat_map(|&width| {
        let of_layers = move |&layers: &usize| vertices.iter().map(move |&v| Case::new(width, layers, v));
        layers.iter().flat_map(of_layers)
    });
    let sizes = sizes.flat_map(|case| bodies.iter().map(move |&bodies| Case { bodies, ..case }));
    let sizes = sizes.map(|case| Case { blocks: arguments.blocks.unwrap_or(case.blocks), ..case });
    match eigen_count.as_slice() {
        [] => sizes.collect(),
        counts => sizes
            .flat_map(|case| counts.iter().map(move |&eigen_count| Case { eigen_count, ..case }))
            .collect(),
    }
}

fn stages(arguments: &Arguments, config: Config, device: &Device) -> Result<Vec<CaseCosts>, Report> {
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
    let dataset = load_dataset(&config)?;
    let stage = |index: usize| {
        let mut run = BenchmarkRun::new(config.clone(), dataset.clone(), index, device)?;
        measure(&mut run, names[index].clone(), None, arguments)
    };
    chosen.into_iter().map(stage).filter_map(Result::transpose).collect()
}

/// Nothing where a case is only exported.
fn measure(
    run: &mut BenchmarkRun,
    name: String,
    sizes: Option<Case>,
    arguments: &Arguments,
) -> Result<Option<CaseCosts>, Report> {
    if let Some(folder) = &arguments.export {
        export(run, folder)?;
    }
    if arguments.export_only {
        return Ok(None);
    }
    print_status(&format!("measuring {name}"));
    let scene = run.scene(0)?;
    let costs = run.costs(arguments.seconds, arguments.accumulate)?;
    let profile = run.profile(arguments.steps)?;
    Ok(Some(CaseCosts {
        name,
        sizes,
        layers: scene.garments.len(),
        vertices: scene.garments.iter().map(|garment| garment.vertex_count()).sum(),
        parameters: run.model().num_params(),
        profile,
        costs,
    }))
}

/// Three digits.
fn short(ms: f64) -> String {
    match ms {
        ms if ms < 0.0005 => "0".into(),
        ms if ms < 1.0 => format!("{ms:.3}"),
        ms if ms < 10.0 => format!("{ms:.2}"),
        ms if ms < 100.0 => format!("{ms:.1}"),
        ms => format!("{ms:.0}"),
    }
}

fn tables(measured: &[CaseCosts]) -> String {
    let rows = |row: fn(&CaseCosts) -> Row| measured.iter().map(row).collect::<Vec<_>>();
    format!(
        "Where the time of a training step goes, medians [ms].\n\n{}\n\
         Parts of one scene, medians [ms]; scenes are prepared on another thread.\n\n{}\n\
         Every single loss, value and gradient [ms].\n\n{}",
        markdown(&rows(phase_row)),
        markdown(&rows(cost_row)),
        markdown(&rows(term_row))
    )
}

fn phase_row(m: &CaseCosts) -> Row {
    let mut row = row!["case" => m.name, "step" => short(m.profile.step_ms)];
    row.extend(m.profile.phases_ms.iter().map(|(name, ms)| ((*name).to_owned(), short(*ms))));
    row
}

fn cost_row(m: &CaseCosts) -> Row {
    row! {
        "case" => m.name,
        "vertices" => m.vertices,
        "parameters" => m.parameters,
        "forward" => short(m.costs.forward_ms),
        "forward + backward" => short(m.costs.forward_backward_ms),
        "step" => short(m.costs.step_ms),
        "step on several outfits" => m.costs.step_of_several_ms.map(short),
        "losses" => short(m.costs.losses_ms),
        "drape again" => short(m.costs.drape_ms),
        "prepare scene" => short(m.profile.prepare_ms),
        "peak memory [MiB]" => m.costs.peak_mib.map(|mib| format!("{mib:.0}")),
    }
}

fn term_row(m: &CaseCosts) -> Row {
    let ms = |term: Term| m.costs.terms_ms.get(term.name()).map(|ms| short(*ms));
    let mut row = row!["case" => m.name];
    row.extend(Term::ALL.map(|term| (term.name().to_owned(), ms(term).text())));
    row
}
