//! `clothcombo bench error`: how far drapes are from equilibrium.

use crate::cli::train::load_under_bar;
use crate::cli::values::at_least_one;
use crate::cli::verbosity::progress_bar;
use crate::config::{Config, ValidationConfig, load};
use crate::dataset::{Dataset, DatasetError, PreparedScene, ValidationGroup, prepare, sample_validation};
use crate::evaluation::certificates::Dressing;
use crate::evaluation::equilibrium_error::{
    Drapes, MethodError, START, SceneError, TermEnergies, converged, scene_error,
};
use crate::inference::DraperError;
use crate::inference::networks::Networks;
use crate::inference::reference::ReferenceScene;
use crate::inference::tensor_store::TensorStore;
use crate::run::checkpoint::TrainedModel;
use crate::run::spread::Spread;
use crate::system::device::Backend;
use crate::system::single_threaded::map_single_threaded;
use clap::Parser;
use clothcombo_physics::contact::resolve::ResolveSettings;
use clothcombo_physics::equilibrium::SolverSettings;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use rand::{SeedableRng, seq::index};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Energy above the equilibrium and distance to it, for skinning and a trained network, on random scenes
#[derive(Parser)]
#[command(after_help = "Examples:\n  clothcombo bench error --config configs/open.toml --scenes 20\n  \
        clothcombo bench error --checkpoint runs/open --json > error.json\n  \
        clothcombo bench error --checkpoint runs/open --layers 3 --scenes 8   # outfits; also strain per layer")]
pub struct Arguments {
    /// Configuration (TOML); default: that of the checkpoint, else configs/open.toml
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Overrides one value of the configuration, for example losses.body_collision.epsilon=0.004; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Run, checkpoints or checkpoint folder of a trained network; default: skinning alone is measured
    #[arg(long, value_name = "DIR")]
    checkpoint: Option<PathBuf>,
    /// Random scenes: validation draws of trained garments
    #[arg(long, default_value_t = 20, value_parser = at_least_one)]
    scenes: usize,
    /// Garments of each scene. In outfits the energy is that of the losses without the layer distance
    #[arg(long, default_value_t = 1, value_parser = at_least_one)]
    layers: usize,
    /// Seed of the draws; default: that of the configuration
    #[arg(long)]
    seed: Option<u64>,
    /// Most iterations of the solver per start
    #[arg(long, default_value_t = SolverSettings::default().iterations)]
    iterations: usize,
    /// Relative gradient at which the solver has converged
    #[arg(long, default_value_t = SolverSettings::default().tolerance)]
    tolerance: f64,
    /// Scenes solved at the same time, each on one core; default: all cores
    #[arg(long)]
    jobs: Option<usize>,
    /// Also measures the networks after these numbers of correction steps, for example 0,1,2,4,8
    #[arg(long, value_name = "STEPS", value_delimiter = ',', requires = "checkpoint")]
    corrections: Vec<usize>,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// Most steps of the post-process on the way from the T-pose, as in `clothcombo eval`.
const WAY_STEPS: usize = 32;

/// Runs the verb.
///
/// # Errors
/// When the configuration, its data or the checkpoint cannot be read, or a scene has no finite energy. A solver that does
/// not converge is a result, not an error.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let settings = SolverSettings {
        iterations: arguments.iterations,
        tolerance: arguments.tolerance,
        ..SolverSettings::default()
    };
    settings.check().into_diagnostic()?;
    let trained = arguments.checkpoint.as_deref().map(TrainedModel::open).transpose()?;
    let config = configuration(arguments, trained.as_ref())?;
    if let (Some(trained), Some(steps)) = (&trained, arguments.corrections.iter().find(|steps| **steps > 0))
        && trained.config.model.corrections == 0
    {
        return Err(DraperError::NoCorrections { steps: *steps }.into());
    }
    let dataset = Arc::new(load_under_bar(&config)?);
    let seed = arguments.seed.unwrap_or_else(|| config.validation_seed());
    let scenes = draw_scenes(&dataset, &config, [arguments.scenes, arguments.layers], seed)?;
    let networks: Vec<Option<Drapes>> = match &trained {
        Some(trained) => {
            let drapes = drape(trained, &config, &dataset, &scenes, &arguments.corrections)?;
            drapes.into_iter().map(Some).collect()
        }
        None => scenes.iter().map(|_| None).collect(),
    };
    let errors = solve_all(arguments, &config, &scenes, &networks, &settings)?;
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&summary(&errors, &settings)).into_diagnostic()?);
    } else {
        print_tables(&errors, &settings);
    }
    Ok(())
}

fn configuration(arguments: &Arguments, trained: Option<&TrainedModel>) -> Result<Config, Report> {
    let file = match (&arguments.config, trained) {
        (Some(file), _) => file.clone(),
        (None, Some(trained)) => trained.folder.join("config.toml"),
        (None, None) => Path::new("configs").join("open.toml"),
    };
    if let (Some(_), Some(setting)) = (trained, arguments.overrides.iter().find(|s| s.starts_with("model.")))
    {
        return Err(miette!(
            help = "the networks are those of the checkpoint; --corrections sets the correction steps",
            "--set {setting} would change nothing with --checkpoint"
        ));
    }
    Ok(load(&file, &arguments.overrides)?)
}

/// Random ones of the single-garment validation scenes: as many as the configuration has, or more if more are asked for.
fn draw_scenes(
    dataset: &Dataset,
    config: &Config,
    [count, layers]: [usize; 2],
    seed: u64,
) -> Result<Vec<PreparedScene>, DatasetError> {
    let pool = config.validation.single_scenes.max(count);
    let validation = ValidationConfig {
        single_scenes: pool,
        layered_scenes: pool,
        layers: [layers, layers],
        ..config.validation.clone()
    };
    let group = if layers == 1 { ValidationGroup::Single } else { ValidationGroup::Layered };
    let draws = sample_validation(dataset, seed, &validation, group);
    let chosen = index::sample(&mut ChaCha8Rng::seed_from_u64(seed), pool, count);
    chosen.into_iter().map(|i| prepare(dataset, &config.losses, draws[i].clone(), 1.0)).collect()
}

fn drape(
    trained: &TrainedModel,
    config: &Config,
    dataset: &Arc<Dataset>,
    scenes: &[PreparedScene],
    corrections: &[usize],
) -> Result<Vec<Drapes>, Report> {
    trained.check_fits(dataset)?;
    let device = Backend::preferred().device();
    let tensors = TensorStore::new(dataset.clone(), trained.state.dimensions(), &device);
    let networks = Networks::new(trained.networks(&device)?, &tensors);
    let dressing = Dressing::new(dataset, &config.losses, Some(&networks));
    let post_process = ResolveSettings { steps: WAY_STEPS, ..ResolveSettings::default() };
    let bar = progress_bar(scenes.len(), "draping {bar:30} {pos}/{len} · {eta} left");
    let drapes = scenes.iter().map(|scene| {
        let drape = networks.drape(scene)?;
        // Alone a garment is near enough to its equilibrium to start from; in an outfit that crosses, no force can tell where
        // cloth belongs.
        let resolved = match scene.garments.len() {
            1 => None,
            _ => Some(dressing.of(scene, &drape.posed).resolved(&post_process)?.positions.concat()),
        };
        let mut drapes = Drapes::new(&networks.drape_single_garments(scene)?, &drape, resolved);
        for &steps in corrections {
            let drape = networks.with_correction_steps(steps).drape(scene)?;
            drapes.steps.push((steps, drape.posed.iter().map(|p| p.map(f64::from)).collect()));
        }
        bar.inc(1);
        Ok(drapes)
    });
    let drapes = drapes.collect();
    bar.finish_and_clear();
    drapes
}

/// Solves every scene on one core of its own; results are in the order of the scenes.
fn solve_all(
    arguments: &Arguments,
    config: &Config,
    scenes: &[PreparedScene],
    networks: &[Option<Drapes>],
    settings: &SolverSettings,
) -> Result<Vec<SceneError>, Report> {
    let bar = progress_bar(scenes.len(), "scenes {bar:30} {pos}/{len} · {eta} left · {msg}");
    let solve_one = |i: usize| -> Result<SceneError, Report> {
        let scene = ReferenceScene::new(&config.losses, &scenes[i]).into_diagnostic()?;
        let name = scene.garments.join(", ");
        let result = scene_error(i, &scene, networks[i].as_ref(), settings, &mut |progress| {
            let step = progress.step;
            bar.set_message(format!("{name}: iteration {}, {:.4} J", step.iteration, step.energy));
            ControlFlow::Continue(())
        });
        bar.inc(1);
        result.into_diagnostic().wrap_err_with(|| format!("scene {i} ({name})"))
    };
    let results = map_single_threaded((0..scenes.len()).collect(), arguments.jobs, solve_one);
    bar.finish_and_clear();
    results
}

/// Names of the methods, the same in every scene.
fn methods(errors: &[SceneError]) -> Vec<&str> {
    errors.first().map_or(Vec::new(), |e| e.methods.iter().map(|m| m.method.as_str()).collect())
}

fn spread(errors: &[SceneError], method: &str, value: impl Fn(&MethodError) -> f64) -> Spread {
    let of_method = errors.iter().flat_map(|e| e.methods.iter().filter(|m| m.method == method));
    Spread::of(of_method.map(value).collect())
}

/// How often each stop reason ended the run that made the reference.
fn stops(errors: &[SceneError]) -> Vec<(&'static str, usize)> {
    let mut counts: Vec<(&'static str, usize)> = Vec::new();
    for error in errors {
        let stop = error.reference_run().stop;
        match counts.iter_mut().find(|(name, _)| *name == stop) {
            Some((_, count)) => *count += 1,
            None => counts.push((stop, 1)),
        }
    }
    counts
}

fn summary(errors: &[SceneError], settings: &SolverSettings) -> serde_json::Value {
    let over = |f: &dyn Fn(&SceneError) -> f64| Spread::of(errors.iter().map(f).collect());
    let of_method = |method: &str| {
        json!({
            "method": method,
            "excess": spread(errors, method, |m| m.error.excess),
            "excess_percent": spread(errors, method, |m| m.error.excess_percent),
            "distance_mm": spread(errors, method, |m| m.error.distance_mm),
            "terms": mean_terms(errors, |e| terms_of(e, method)),
        })
    };
    json!({
        "tolerance": settings.tolerance,
        "iterations": settings.iterations,
        "scenes": errors,
        "methods": methods(errors).into_iter().map(of_method).collect::<Vec<_>>(),
        "reference_terms": mean_terms(errors, |e| &e.reference_run().terms),
        "above_skinning": above_skinning(errors),
        "solver": {
            "converged": errors.iter().filter(|e| converged(e.reference_run())).count(),
            "stops": stops(errors).into_iter().collect::<std::collections::BTreeMap<_, _>>(),
            "minima_differ": errors.iter().filter(|e| e.minima_differ).count(),
            "iterations": over(&|e| e.reference_run().iterations as f64),
            "seconds": over(&|e| e.reference_run().seconds),
            "relative_gradient": over(&|e| e.reference_run().relative_gradient),
        },
        "strain_ratios": strain_ratios(errors),
    })
}

/// Mean of every weighted energy over the scenes [J].
fn mean_terms<'a>(errors: &'a [SceneError], of: impl Fn(&'a SceneError) -> &'a TermEnergies) -> TermEnergies {
    let mut means = TermEnergies::new();
    for (term, energy) in errors.iter().flat_map(of) {
        *means.entry(term).or_default() += energy / errors.len() as f64;
    }
    means
}

/// In how many scenes the networks end above skinning; none without networks.
fn above_skinning(errors: &[SceneError]) -> Option<usize> {
    let above: Option<Vec<bool>> = errors.iter().map(SceneError::is_above_skinning).collect();
    above.filter(|above| !above.is_empty()).map(|above| above.into_iter().filter(|above| *above).count())
}

/// Strain of a layer in the outfit over that of the single garment, medians over the scenes.
#[derive(Serialize)]
struct StrainRatio {
    /// In equilibrium.
    equilibrium: f64,
    /// Of the networks' drapes.
    network: Option<f64>,
}

/// Innermost first.
fn strain_ratios(errors: &[SceneError]) -> Vec<StrainRatio> {
    let layers = errors.iter().map(|e| e.layers.len()).min().unwrap_or(0);
    let ratio = |layer: usize| {
        let of_layer = || errors.iter().map(move |e| &e.layers[layer]);
        let network: Vec<f64> =
            of_layer().filter_map(|l| l.network.map(|[single, outfit]| outfit / single)).collect();
        StrainRatio {
            equilibrium: Spread::of(of_layer().map(|l| l.outfit / l.single_garment).collect()).median,
            network: (!network.is_empty()).then(|| Spread::of(network).median),
        }
    };
    (0..layers).map(ratio).collect()
}

fn print_tables(errors: &[SceneError], settings: &SolverSettings) {
    let names = methods(errors);
    print!("{:>5} {:<28}{:>9}{:>11}", "scene", "garments", "vertices", "minimum J");
    // A heading is never narrower than its column.
    let width = |name: &str| (name.chars().count() + 5).max(14);
    for name in &names {
        print!("{:>1$}{2:>9}{3:>8}", format!("{name} +J"), width(name), "%", "mm");
    }
    println!("{:>7}{:>9}{:>11}  {:<11}lowest from", "steps", "seconds", "rel. grad", "stop");
    for e in errors {
        let run = e.reference_run();
        print!("{:>5} {:<28}{:>9}{:>11.4}", e.scene, e.garments.join(", "), e.vertices, run.energy);
        for MethodError { method, error, .. } in &e.methods {
            print!(
                "{:>1$.4}{2:>9.1}{3:>8.2}",
                error.excess,
                width(method),
                error.excess_percent,
                error.distance_mm
            );
        }
        println!(
            "{:>7}{:>9.2}{:>11.1e}  {:<11}{}{}",
            run.iterations,
            run.seconds,
            run.relative_gradient,
            run.stop,
            run.start,
            if e.minima_differ { " (minima differ)" } else { "" }
        );
    }
    println!("\n{:<46}{:>12}{:>12}{:>12}", format!("{} scenes", errors.len()), "mean", "median", "95 %");
    let line =
        |what: String, s: Spread| println!("{what:<46}{:>12.4}{:>12.4}{:>12.4}", s.mean, s.median, s.p95);
    for name in &names {
        line(format!("{name}: excess [J]"), spread(errors, name, |m| m.error.excess));
        if *name != START {
            line(format!("{name}: excess [% of {START}]"), spread(errors, name, |m| m.error.excess_percent));
        }
        line(format!("{name}: distance [mm]"), spread(errors, name, |m| m.error.distance_mm));
    }
    line(
        "solver: steps".into(),
        Spread::of(errors.iter().map(|e| e.reference_run().iterations as f64).collect()),
    );
    line("solver: seconds".into(), Spread::of(errors.iter().map(|e| e.reference_run().seconds).collect()));
    let reached = errors.iter().filter(|e| converged(e.reference_run())).count();
    println!(
        "\nconverged (relative gradient ≤ {:e}): {reached} of {}; stops: {}",
        settings.tolerance,
        errors.len(),
        stops(errors).iter().map(|(name, count)| format!("{count} {name}")).collect::<Vec<_>>().join(", ")
    );
    if names.len() > 2 {
        let differ = errors.iter().filter(|e| e.minima_differ).count();
        println!("starts that end in different minima: {differ} of {}", errors.len());
    }
    if let Some(above) = above_skinning(errors) {
        println!("networks above {START}: {above} of {}", errors.len());
    }
    print_terms(errors, &names);
    let ratios = strain_ratios(errors);
    if !ratios.is_empty() {
        println!(
            "\nstrain in the outfit over that of the single garment, medians\n{:>6}{:>14}{:>10}",
            "layer", "equilibrium", "network"
        );
    }
    for (layer, ratio) in ratios.iter().enumerate() {
        let network = ratio.network.map_or("–".to_owned(), |network| format!("{network:.2}"));
        println!("{:>6}{:>14.2}{:>10}", layer + 1, ratio.equilibrium, network);
    }
}

/// Every term of the energy, method by method.
fn print_terms(errors: &[SceneError], methods: &[&str]) {
    let mut rows: Vec<(&str, TermEnergies)> =
        methods.iter().map(|name| (*name, mean_terms(errors, |e| terms_of(e, name)))).collect();
    rows.push(("equilibrium", mean_terms(errors, |e| &e.reference_run().terms)));
    let terms: BTreeSet<&str> = rows.iter().flat_map(|(_, terms)| terms.keys().copied()).collect();
    println!("\nmean of every energy, weighted [J]");
    print!("{:<26}", "method");
    terms.iter().for_each(|term| print!("{term:>17}"));
    println!("{:>12}", "sum");
    for (name, values) in rows {
        print!("{name:<26}");
        terms.iter().for_each(|term| print!("{:>17.4}", values.get(term).copied().unwrap_or(0.0)));
        println!("{:>12.4}", values.values().sum::<f64>());
    }
}

fn terms_of<'a>(error: &'a SceneError, method: &str) -> &'a TermEnergies {
    &error.methods.iter().find(|m| m.method == method).expect("every scene has every method").terms
}
