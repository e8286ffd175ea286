//! `clothcombo bench error`: how far drapes are from equilibrium.

use crate::cli::loading::load_dataset;
use crate::cli::model_arguments::ModelArguments;
use crate::cli::output::print_report;
use crate::cli::table::{Cell, row, table};
use crate::cli::values::at_least_one;
use crate::cli::verbosity::progress_bar;
use crate::config::{Config, ValidationConfig};
use crate::dataset::{Dataset, DatasetError, PreparedScene, ValidationGroup, prepare, sample_validation};
use crate::evaluation::certificates::Dressing;
use crate::evaluation::equilibrium_error::{
    Drapes, MethodError, SceneError, SolverRun, TermEnergies, converged, scene_error,
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
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::sync::Arc;

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
    /// Also measures the networks after these numbers of correction steps, for example 0,1,2,4,8
    #[arg(long, value_name = "STEPS", value_delimiter = ',', requires = "checkpoint")]
    corrections: Vec<usize>,
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
    if let Some(trained) = &trained {
        check_model(arguments, trained)?;
    }
    let config = arguments.model.config(trained.as_ref())?;
    let dataset = load_dataset(&config)?;
    let seed = arguments.seed.unwrap_or_else(|| config.validation_seed());
    let scenes = sample_scenes(&dataset, &config, [arguments.scenes, arguments.layers], seed)?;
    let drape = |trained| drape(trained, &config, &dataset, &scenes, &arguments.corrections);
    let drapes = trained.as_ref().map(drape).transpose()?;
    let errors = solve_all(arguments, &config, &scenes, drapes.as_deref(), &settings)?;
    print_report(arguments.json, &Summary::new(errors, &settings), Summary::tables)
}

/// Refuses what the networks of the checkpoint cannot follow.
fn check_model(arguments: &Arguments, trained: &TrainedModel) -> Result<(), Report> {
    if let Some(setting) = arguments.model.overrides.iter().find(|s| s.starts_with("model.")) {
        return Err(miette!(
            help = "the networks are those of the checkpoint; --corrections sets the correction steps",
            "--set {setting} would change nothing with --checkpoint"
        ));
    }
    match arguments.corrections.iter().find(|steps| **steps > 0) {
        Some(&steps) if trained.config.model.corrections == 0 => {
            Err(DraperError::NoCorrections { steps }.into())
        }
        _ => Ok(()),
    }
}

/// Samples `count` of the validation scenes of `layers` garments: of as many as the configuration has, or of `count` where that is
/// more.
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
    let post_process = ResolveSettings { steps: CONTINUATION_STEPS, ..ResolveSettings::default() };
    let bar = progress_bar(scenes.len(), "draping {bar:30} {pos}/{len} · {eta} left");
    let drapes = scenes.iter().map(|scene| {
        let drape = networks.drape(scene)?;
        // A single garment is near enough to its equilibrium to start from. Forces cannot resolve an outfit that intersects itself.
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

/// All scenes together.
#[derive(Serialize)]
struct Summary {
    tolerance: f64,
    iterations: usize,
    scenes: Vec<SceneError>,
    methods: Vec<MethodSummary>,
    reference_terms: TermEnergies,
    /// In how many scenes the networks end above skinning; none without networks.
    above_skinning: Option<usize>,
    solver: SolverSummary,
    /// Innermost first; none for single garments.
    strain_ratios: Vec<StrainRatio>,
}

#[derive(Serialize)]
struct MethodSummary {
    method: String,
    excess: Spread,
    excess_percent: Spread,
    distance_mm: Spread,
    terms: TermEnergies,
}

/// The runs that made the references.
#[derive(Serialize)]
struct SolverSummary {
    converged: usize,
    /// How often each reason ended a run.
    stops: BTreeMap<&'static str, usize>,
    minima_differ: usize,
    iterations: Spread,
    seconds: Spread,
    relative_gradient: Spread,
}

/// Strain of a layer in the outfit over that of the same garment alone, medians over the scenes.
#[derive(Serialize)]
struct StrainRatio {
    /// In equilibrium.
    equilibrium: f64,
    /// Of the networks' drapes.
    network: Option<f64>,
}

impl Summary {
    fn new(scenes: Vec<SceneError>, settings: &SolverSettings) -> Self {
        // The methods are the same in every scene.
        let method_count = scenes.first().map_or(0, |scene| scene.methods.len());
        let above: Option<Vec<bool>> = scenes.iter().map(SceneError::is_above_skinning).collect();
        let above = above.filter(|above| !above.is_empty());
        Self {
            tolerance: settings.tolerance,
            iterations: settings.iterations,
            methods: (0..method_count).map(|i| MethodSummary::new(&scenes, i)).collect(),
            reference_terms: mean_terms(scenes.iter().map(|scene| &scene.reference_run().terms)),
            above_skinning: above.map(|above| above.into_iter().filter(|above| *above).count()),
            solver: SolverSummary::new(&scenes),
            strain_ratios: strain_ratios(&scenes),
            scenes,
        }
    }
}

impl MethodSummary {
    fn new(scenes: &[SceneError], index: usize) -> Self {
        let found = || scenes.iter().map(|scene| &scene.methods[index]);
        let spread = |value: fn(&MethodError) -> f64| Spread::of(found().map(value).collect());
        Self {
            method: scenes[0].methods[index].method.clone(),
            excess: spread(|m| m.excess),
            excess_percent: spread(|m| m.excess_percent),
            distance_mm: spread(|m| m.distance_mm),
            terms: mean_terms(found().map(|m| &m.terms)),
        }
    }
}

impl SolverSummary {
    fn new(scenes: &[SceneError]) -> Self {
        let runs = || scenes.iter().map(SceneError::reference_run);
        let spread = |value: fn(&SolverRun) -> f64| Spread::of(runs().map(value).collect());
        let mut stops = BTreeMap::new();
        runs().for_each(|run| *stops.entry(run.stop).or_default() += 1);
        Self {
            converged: runs().filter(|run| converged(run)).count(),
            stops,
            minima_differ: scenes.iter().filter(|scene| scene.minima_differ).count(),
            iterations: spread(|run| run.iterations as f64),
            seconds: spread(|run| run.seconds),
            relative_gradient: spread(|run| run.relative_gradient),
        }
    }
}

/// Mean of every weighted energy over the scenes (J).
fn mean_terms<'a>(scenes: impl ExactSizeIterator<Item = &'a TermEnergies>) -> TermEnergies {
    let (count, mut means) = (scenes.len() as f64, TermEnergies::new());
    for (term, energy) in scenes.flatten() {
        *means.entry(term).or_default() += energy / count;
    }
    means
}

fn strain_ratios(scenes: &[SceneError]) -> Vec<StrainRatio> {
    let layers = scenes.iter().map(|scene| scene.layers.len()).min().unwrap_or(0);
    let ratio = |layer: usize| {
        let of_layer = || scenes.iter().map(move |scene| &scene.layers[layer]);
        let network: Vec<f64> =
            of_layer().filter_map(|l| l.network.map(|[alone, outfit]| outfit / alone)).collect();
        StrainRatio {
            equilibrium: Spread::of(of_layer().map(|l| l.outfit / l.alone).collect()).median,
            network: (!network.is_empty()).then(|| Spread::of(network).median),
        }
    };
    (0..layers).map(ratio).collect()
}

impl Summary {
    fn tables(&self) -> String {
        let (count, solver) = (self.scenes.len(), &self.solver);
        let stops: Vec<String> = solver.stops.iter().map(|(name, count)| format!("{count} {name}")).collect();
        let mut text = format!(
            "{}\n{}\nsolver: {} steps, {} s\nconverged (relative gradient ≤ {:e}): {} of {count}; stops: {}\n",
            self.scene_table(),
            self.method_table(),
            solver.iterations.text(),
            solver.seconds.text(),
            self.tolerance,
            solver.converged,
            stops.join(", ")
        );
        if self.methods.len() > 2 {
            text += &format!("starts that end in different minima: {} of {count}\n", solver.minima_differ);
        }
        if let Some(above) = self.above_skinning {
            text += &format!("networks above skinning with shape transfer: {above} of {count}\n");
        }
        text += &format!("\nmean of every energy, weighted [J]\n{}", self.term_table());
        if !self.strain_ratios.is_empty() {
            let row = |(layer, ratio): (usize, &StrainRatio)| row!["layer" => layer + 1, "equilibrium" => ratio.equilibrium, "network" => ratio.network];
            let rows: Vec<_> = self.strain_ratios.iter().enumerate().map(row).collect();
            text += "\nstrain in the outfit over that of the garment alone, medians\n";
            text += &table(&rows);
        }
        text
    }

    fn scene_table(&self) -> String {
        let row = |scene: &SceneError| {
            let run = scene.reference_run();
            let mut row = row! {
                "scene" => scene.scene,
                "garments" => scene.garments.join(", "),
                "vertices" => scene.vertices,
                "minimum J" => run.energy,
            };
            row.extend(scene.methods.iter().flat_map(|m| {
                row![format!("{} +J", m.method) => m.excess, "%" => m.excess_percent, "mm" => m.distance_mm]
            }));
            row.extend(row! {
                "steps" => run.iterations,
                "seconds" => run.seconds,
                "rel. grad" => run.relative_gradient,
                "stop" => run.stop,
                "lowest from" => run.start,
                "" => if scene.minima_differ { "minima differ" } else { "" },
            });
            row
        };
        table(&self.scenes.iter().map(row).collect::<Vec<_>>())
    }

    fn method_table(&self) -> String {
        let method = |m: &MethodSummary| {
            row! {
                "mean / median / 95 %" => m.method,
                "excess [J]" => m.excess,
                "excess [% of LBS]" => m.excess_percent,
                "distance [mm]" => m.distance_mm,
            }
        };
        table(&self.methods.iter().map(method).collect::<Vec<_>>())
    }

    /// Every term of the energy, method by method.
    fn term_table(&self) -> String {
        let methods = self.methods.iter().map(|m| (m.method.as_str(), &m.terms));
        let energies: Vec<_> = methods.chain([("equilibrium", &self.reference_terms)]).collect();
        let terms: BTreeSet<&str> = energies.iter().flat_map(|(_, terms)| terms.keys().copied()).collect();
        let row = |(name, values): &(&str, &TermEnergies)| {
            let mut row = row!["method" => name];
            for term in &terms {
                row.extend(row![term => values.get(term).copied().unwrap_or(0.0)]);
            }
            row.extend(row!["sum" => values.values().sum::<f64>()]);
            row
        };
        table(&energies.iter().map(row).collect::<Vec<_>>())
    }
}
