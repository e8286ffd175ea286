//! `clothcombo bench error`: how far drapes are from equilibrium.

mod summary;

use crate::cli::device_argument::DeviceArgument;
use crate::cli::loading::load_dataset;
use crate::cli::model_arguments::ModelArguments;
use crate::cli::output::print_report;
use crate::cli::values::at_least_one;
use crate::cli::verbosity::progress_bar;
use crate::config::{Config, ValidationConfig};
use crate::dataset::{Dataset, DatasetError, PreparedScene, ValidationGroup, prepare, sample_validation};
use crate::evaluation::certificates::PostProcessor;
use crate::evaluation::equilibrium_error::{Drapes, SceneError, scene_error};
use crate::inference::networks::Networks;
use crate::inference::reference::ReferenceScene;
use crate::inference::tensor_store::TensorStore;
use crate::run::checkpoint::TrainedModel;
use crate::system::single_threaded::map_single_threaded;
use burn::tensor::Device;
use clap::Parser;
use clothcombo_physics::contact::resolve::ResolveSettings;
use clothcombo_physics::equilibrium::SolverSettings;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use rand::{SeedableRng, seq::index};
use rand_chacha::ChaCha8Rng;
use std::ops::ControlFlow;
use std::sync::Arc;
use summary::Summary;

/// Energy above the equilibrium and distance to it, for skinning and a trained network, on random scenes
#[derive(Parser)]
#[command(after_help = "Examples:\n  clothcombo bench error --config configs/open.toml --scenes 20\n  \
        clothcombo bench error --checkpoint runs/open --json > error.json\n  \
        clothcombo bench error --checkpoint runs/open --layers 3 --scenes 8   # outfits; also strain per layer")]
pub struct Arguments {
    #[command(flatten)]
    model: ModelArguments,
    /// Random scenes: validation samples of trained garments
    #[arg(long, default_value_t = 20, value_parser = at_least_one)]
    scenes: usize,
    /// Garments of each scene. In outfits the energy is that of the losses without the layer distance
    #[arg(long, default_value_t = 1, value_parser = at_least_one)]
    layers: usize,
    /// Seed of the samples; default: that of the configuration
    #[arg(long)]
    seed: Option<u64>,
    /// Most iterations of the solver per start
    #[arg(long, default_value_t = SolverSettings::default().iterations)]
    iterations: usize,
    /// Relative gradient at which the solver has converged
    #[arg(long, default_value_t = SolverSettings::default().tolerance)]
    tolerance: f64,
    /// Scenes solved in parallel, each on one core; default: all cores
    #[arg(long)]
    jobs: Option<usize>,
    #[command(flatten)]
    device: DeviceArgument,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// Most steps of the post-process along the continuation path from the T-pose, as in `clothcombo eval`.
const CONTINUATION_STEPS: usize = 32;

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
    let trained = arguments.model.open()?;
    if trained.is_some() {
        check_model(arguments)?;
    }
    // Before the data: a device that is not there is known at once.
    let device = trained.as_ref().map(|_| arguments.device.open()).transpose()?;
    let config = arguments.model.config(trained.as_ref())?;
    let dataset = load_dataset(&config)?;
    let seed = arguments.seed.unwrap_or_else(|| config.validation_seed());
    let scenes = sample_scenes(&dataset, &config, [arguments.scenes, arguments.layers], seed)?;
    let drape = |(trained, device)| drape((trained, device), &config, &dataset, &scenes);
    let drapes = trained.as_ref().zip(device.as_ref()).map(drape).transpose()?;
    let errors = solve_all(arguments, &config, &scenes, drapes.as_deref(), &settings)?;
    print_report(arguments.json, &Summary::new(errors, &settings), Summary::tables)
}

/// Refuses what the networks of the checkpoint cannot follow.
fn check_model(arguments: &Arguments) -> Result<(), Report> {
    if let Some(setting) = arguments.model.overrides.iter().find(|s| s.starts_with("model.")) {
        return Err(miette!(
            help = "the networks are those of the checkpoint",
            "--set {setting} would change nothing with --checkpoint"
        ));
    }
    Ok(())
}

/// Samples `count` of the validation scenes of `layers` garments: of as many as the configuration has, or of `count`
/// where that is more.
fn sample_scenes(
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
    let samples = sample_validation(dataset, seed, &validation, group);
    let chosen = index::sample(&mut ChaCha8Rng::seed_from_u64(seed), pool, count);
    chosen.into_iter().map(|i| prepare(dataset, &config.losses, samples[i].clone(), 1.0)).collect()
}

fn drape(
    (trained, device): (&TrainedModel, &Device),
    config: &Config,
    dataset: &Arc<Dataset>,
    scenes: &[PreparedScene],
) -> Result<Vec<Drapes>, Report> {
    trained.check_fits(dataset)?;
    let tensors = TensorStore::new(dataset.clone(), trained.state.dimensions(), device);
    let networks = Networks::new(trained.networks(device)?, &tensors);
    let post_processor = PostProcessor::new(dataset, &config.losses, Some(&networks));
    let post_process = ResolveSettings { steps: CONTINUATION_STEPS, ..ResolveSettings::default() };
    let bar = progress_bar(scenes.len(), "draping {bar:30} {pos}/{len} · {eta} left");
    let drapes = scenes.iter().map(|scene| {
        let drape = networks.drape(scene)?;
        // A single garment is near enough to its equilibrium to start from. Forces cannot resolve an outfit that
        // intersects itself.
        let resolved = match scene.garments.len() {
            1 => None,
            _ => Some(post_processor.of(scene, &drape.posed).resolved(&post_process)?.positions.concat()),
        };
        let drapes = Drapes::new(&networks.drape_single_garments(scene)?, &drape, resolved);
        bar.inc(1);
        Ok(drapes)
    });
    drapes.collect()
}

/// Solves every scene on one core of its own; results are in the order of the scenes.
fn solve_all(
    arguments: &Arguments,
    config: &Config,
    scenes: &[PreparedScene],
    drapes: Option<&[Drapes]>,
    settings: &SolverSettings,
) -> Result<Vec<SceneError>, Report> {
    let bar = progress_bar(scenes.len(), "scenes {bar:30} {pos}/{len} · {eta} left · {msg}");
    let solve_one = |i: usize| -> Result<SceneError, Report> {
        let scene = ReferenceScene::new(&config.losses, &scenes[i]).into_diagnostic()?;
        let name = scene.garments.join(", ");
        let result = scene_error(i, &scene, drapes.map(|all| &all[i]), settings, &mut |progress| {
            let step = progress.step;
            bar.set_message(format!("{name}: iteration {}, {:.4} J", step.iteration, step.energy));
            ControlFlow::Continue(())
        });
        bar.inc(1);
        result.into_diagnostic().wrap_err_with(|| format!("scene {i} ({name})"))
    };
    map_single_threaded((0..scenes.len()).collect(), arguments.jobs, solve_one)
}
