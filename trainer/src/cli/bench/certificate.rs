//! `clothcombo bench certificate`: the post-process on random outfits.

mod summary;

use crate::cli::device_argument::DeviceArgument;
use crate::cli::loading::load_dataset;
use crate::cli::model_arguments::ModelArguments;
use crate::cli::output::print_report;
use crate::cli::post_process::PostProcessArguments;
use crate::cli::values::{at_least_one, folder_to_make};
use crate::cli::verbosity::progress_bar;
use crate::config::Config;
use crate::dataset::{Dataset, PreparedScene, SceneSample, prepare, sample_outfit};
use crate::evaluation::certificates::{DrapedScene, OutfitResult, PostProcessor};
use crate::inference::UniqueNames;
use crate::inference::networks::Networks;
use crate::inference::tensor_store::TensorStore;
use crate::run::checkpoint::TrainedModel;
use crate::system::single_threaded::map_single_threaded;
use burn::tensor::Device;
use clap::Parser;
use clothcombo_data::format::obj;
use clothcombo_physics::contact::resolve::ResolveSettings;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The post-process on random outfits: exact pairs before and after, strain added, time
///
/// Shapes are sampled from the configuration's range, poses from validation clips, 1 to --layers of all garments in random order.
#[derive(Parser)]
#[command(after_help = "Examples:\n  clothcombo bench certificate --outfits 500\n  \
        clothcombo bench certificate --checkpoint runs/open --json > certificate.json\n  \
        clothcombo bench certificate --checkpoint models/default --jobs 2\n  \
        clothcombo bench certificate --only 17 --meshes /tmp/outfit-17\n  \
        clothcombo bench certificate --outfits 24 --orders helper_tee,helper_vest,Coat,helper_shorts")]
pub struct Arguments {
    #[command(flatten)]
    model: ModelArguments,
    /// Random outfits
    #[arg(long, default_value_t = 500, value_parser = at_least_one)]
    outfits: usize,
    /// Most garments of an outfit
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u8).range(1..=12))]
    layers: u8,
    /// These garments in every order instead of random ones: outfit i has order i mod n! on the body of outfit i / n!
    #[arg(long, value_delimiter = ',', value_name = "NAME,NAME,…", conflicts_with = "layers")]
    orders: Vec<String>,
    /// Only these outfits, by number from 0
    #[arg(long, value_delimiter = ',')]
    only: Vec<usize>,
    /// Outfits resolved in parallel, a core for each; 1: one after the other, each with all cores
    #[arg(long, default_value_t = 1, value_parser = at_least_one)]
    jobs: usize,
    /// Seed of the outfits; default: that of the configuration
    #[arg(long)]
    seed: Option<u64>,
    #[command(flatten)]
    post_process: PostProcessArguments,
    /// Writes body and garments (rest, draped, resolved) of every outfit as OBJ under this folder
    #[arg(long, value_name = "DIR", value_parser = folder_to_make())]
    meshes: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgument,
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// When the configuration, its data or the checkpoint cannot be read. Intersections that stay are a result, not an error.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let settings = arguments.post_process.settings();
    settings.check().into_diagnostic()?;
    let checkpoint = arguments.model.open()?;
    // Before the data: a device that is not there is known at once.
    let device = checkpoint.as_ref().map(|_| arguments.device.open()).transpose()?;
    let mut config = arguments.model.config(checkpoint.as_ref())?;
    if checkpoint.is_none() {
        // Nothing but the networks reads the eigenvectors, and most of the preparation is theirs.
        config.model.eigen_count = 1;
    }
    let dataset = load_dataset(&config)?;
    let results = measure(arguments, &config, &dataset, checkpoint.as_ref().zip(device.as_ref()), &settings)?;
    let layers = usize::from(arguments.layers);
    let mut report = summary::report(&results, layers);
    report["jobs"] = json!(arguments.jobs);
    report["gap_mm"] = json!(arguments.post_process.gap_mm);
    report["time_limit_s"] = json!(arguments.post_process.time_limit.map(|t| t.as_secs_f64()));
    report["drape"] = json!(if checkpoint.is_some() { "network" } else { "skinning" });
    print_report(arguments.json, &report, |_| summary::tables(&results, layers))
}

fn measure(
    arguments: &Arguments,
    config: &Config,
    dataset: &Arc<Dataset>,
    checkpoint: Option<(&TrainedModel, &Device)>,
    settings: &ResolveSettings,
) -> Result<Vec<OutfitResult>, Report> {
    let tensors;
    let networks = match checkpoint {
        None => None,
        Some((checkpoint, device)) => {
            checkpoint.check_fits(dataset)?;
            tensors = TensorStore::new(dataset.clone(), checkpoint.state.dimensions(), device);
            Some(Networks::new(checkpoint.networks(device)?, &tensors))
        }
    };
    let outfits: Vec<usize> = match arguments.only.is_empty() {
        true => (0..arguments.outfits).collect(),
        false => arguments.only.clone(),
    };
    let bar = progress_bar(outfits.len(), "outfits {bar:30} {pos}/{len} · {eta} left");
    let orders = orders(dataset, &arguments.orders)?;
    let post_process = PostProcessor::new(dataset, &config.losses, networks.as_ref());
    let resolve = |outfit: usize| {
        let seed = arguments.seed.unwrap_or_else(|| config.validation_seed());
        let sample = match orders.is_empty() {
            true => sample_outfit(dataset, seed, outfit as u64, usize::from(arguments.layers)),
            false => {
                let body = sample_outfit(dataset, seed, (outfit / orders.len()) as u64, 1);
                SceneSample { garments: orders[outfit % orders.len()].clone(), ..body }
            }
        };
        let scene = prepare(dataset, &config.losses, sample, 1.0)?;
        let draped = post_process.of(&scene, &post_process.drape(&scene)?);
        let (result, resolved) =
            OutfitResult::new(outfit, &draped, settings).wrap_err_with(|| format!("outfit {outfit}"))?;
        if let Some(folder) = &arguments.meshes {
            write_meshes(&folder.join(format!("{outfit:04}")), &scene, &draped, &resolved.positions)?;
        }
        bar.inc(1);
        Ok(result)
    };
    match arguments.jobs {
        1 => outfits.into_iter().map(resolve).collect(),
        jobs => map_single_threaded(outfits, Some(jobs), resolve),
    }
}

/// Every order of the garments called `names`; none for no name.
fn orders(dataset: &Dataset, names: &[String]) -> Result<Vec<Vec<usize>>, Report> {
    if names.len() > 6 {
        return Err(miette!(help = "give at most six", "{} garments have too many orders", names.len()));
    }
    let known = || (0..dataset.garments.len()).map(|i| dataset.garments.info(i).name.as_str());
    let find = |name: &String| {
        known().position(|known| known == name).ok_or_else(|| {
            let all = known().collect::<Vec<_>>().join(", ");
            miette!(help = format!("the garments are: {all}"), "no garment is called {name:?}")
        })
    };
    let garments = names.iter().map(find).collect::<Result<Vec<usize>, Report>>()?;
    if let Some(at) = (1..garments.len()).find(|&at| garments[..at].contains(&garments[at])) {
        return Err(miette!(help = "name each garment once", "--orders names {:?} twice", names[at]));
    }
    let mut orders = if garments.is_empty() { Vec::new() } else { vec![Vec::new()] };
    for _ in &garments {
        orders = orders
            .iter()
            .flat_map(|order: &Vec<usize>| {
                let left = garments.iter().filter(|g| !order.contains(g));
                left.map(|g| [order.as_slice(), &[*g]].concat()).collect::<Vec<_>>()
            })
            .collect();
    }
    Ok(orders)
}

fn write_meshes(
    folder: &Path,
    scene: &PreparedScene,
    draped: &DrapedScene<'_>,
    resolved: &[Vec<[f64; 3]>],
) -> Result<(), Report> {
    let save = |file: String, positions: &[[f64; 3]], faces: &[[u32; 3]], note: String| {
        obj::save(&folder.join(file), positions, faces, &[note]).into_diagnostic()
    };
    save("body.obj".into(), &draped.body.positions, &draped.body.faces, "body".into())?;
    let mut names = UniqueNames::default();
    for (i, garment) in scene.garments.iter().enumerate() {
        let garment = &garment.garment;
        let name = names.take(&garment.name);
        let states = [
            ("rest", garment.rest.positions()),
            ("draped", &draped.positions[i]),
            ("resolved", &resolved[i]),
        ];
        for (state, positions) in states {
            let note = format!("{}: {} {}", garment.name, garment.source.author, garment.source.licence);
            save(format!("{state}/{i}-{name}.obj"), positions, garment.rest.faces(), note)?;
        }
    }
    Ok(())
}
