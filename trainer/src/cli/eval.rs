//! `clothcombo eval`: everything a trained model is judged by, in one report.

use crate::cli::data_check::check_data;
use crate::cli::device_argument::DeviceArgument;
use crate::cli::loading::load_dataset;
use crate::cli::values::folder_to_make;
use crate::cli::verbosity::{print_status, progress_bar};
use crate::config::{Config, load};
use crate::dataset::Dataset;
use crate::evaluation::{Evaluation, EvaluationPage, ModelUnderTest, NamedModel, SceneCounts, part_keys};
use crate::inference::shipped_model;
use crate::run::checkpoint::TrainedModel;
use crate::run::report::html::utc;
use crate::system::device::name;
use crate::system::files::{write_file, write_json};
use burn::tensor::Device;
use clap::Parser;
use clap::builder::PossibleValuesParser;
use miette::{Report, WrapErr, miette};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// The paper's tables for a trained model, speed against error, stress tests, pictures
///
/// Writes eval.json, eval.md and report.html, one page that needs no network. Scenes are sampled from the seed.
/// Training, validation and test set (the latter read by no run) are reported one by one.
#[derive(Parser)]
#[command(after_help = "Examples:\n  clothcombo eval -o report\n  \
        clothcombo eval --checkpoint runs/open --quick -o report\n  \
        clothcombo eval --only certificates --outfits 50 --meshes outfits -o report\n  \
        clothcombo eval --checkpoint runs/all --ablation \"without z_v=runs/without-z_v\" -o report\n  \
        clothcombo eval --specific \"only VNeckTop=runs/vnecktop\" -o report")]
pub struct Arguments {
    /// Run, checkpoints or model folder; default: the model shipped with the project
    #[arg(long, value_name = "DIR")]
    checkpoint: Option<PathBuf>,
    /// Configuration (TOML) that names data and losses; default: that of the model
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Overrides one value of the configuration; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Folder of the report; an earlier report in it is replaced
    #[arg(short, long, value_name = "DIR", value_parser = folder_to_make())]
    output: PathBuf,
    /// A few scenes per part and no gallery: minutes instead of a quarter of an hour
    #[arg(long)]
    quick: bool,
    /// Random outfits of 1 to 6 garments whose certificates are counted before and after the post-process; seconds to a minute
    /// each [default: 50 with --only certificates, else none]
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..))]
    outfits: Option<u16>,
    /// Writes body and garments (rest, draped, resolved) of each of these outfits as OBJ under this folder
    #[arg(long, value_name = "DIR", requires = "outfits", value_parser = folder_to_make())]
    meshes: Option<PathBuf>,
    /// Only these parts of the report
    #[arg(long, value_delimiter = ',', value_name = "PARTS", value_parser = PossibleValuesParser::new(part_keys()))]
    only: Vec<String>,
    /// A model trained on the same data with a part left out, for the ablation table; repeatable
    #[arg(long, value_name = "NAME=DIR", value_parser = named)]
    ablation: Vec<(String, PathBuf)>,
    /// A model trained on a single garment of the data, measured on this garment; repeatable
    #[arg(long, value_name = "NAME=DIR", value_parser = named)]
    specific: Vec<(String, PathBuf)>,
    /// Seed of the scenes; default: that of validation in the configuration
    #[arg(long)]
    seed: Option<u64>,
    #[command(flatten)]
    device: DeviceArgument,
}

fn named(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, path)) if !name.is_empty() && !path.is_empty() => Ok((name.to_owned(), path.into())),
        _ => Err("give a name and a folder: NAME=DIR".to_owned()),
    }
}

/// Outfits of the part `certificates` where it is asked for without their number: a quarter of an hour.
const OUTFITS: usize = 50;
/// The files that make a report.
const JSON: &str = "eval.json";
const MARKDOWN: &str = "eval.md";
const HTML: &str = "report.html";

/// Runs the verb.
///
/// # Errors
/// When a model or its data cannot be read, models do not fit each other, or the report cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let folder = &arguments.output;
    check_output(folder)?;
    let trained = match &arguments.checkpoint {
        Some(path) => TrainedModel::open(path)?,
        None => shipped_model()?,
    };
    let config = match &arguments.config {
        Some(file) => load(file, &arguments.overrides)?,
        None => trained.config_with(&arguments.overrides)?,
    };
    let device = arguments.device.open()?;
    let model = model(arguments, &trained, config, &device)?;
    let ablations = named_models(arguments, "--ablation", &arguments.ablation, &model, &device)?;
    let specific = named_models(arguments, "--specific", &arguments.specific, &model, &device)?;
    check_specific(&specific, &model.dataset)?;
    check_ablations(&ablations, &model)?;

    let asks_for_certificates = arguments.only.iter().any(|part| part == "certificates");
    let outfits = arguments.outfits.map_or(if asks_for_certificates { OUTFITS } else { 0 }, usize::from);
    let counts = SceneCounts::new(arguments.quick, outfits);
    let bar = progress_bar(0, "{bar:30} {pos}/{len} · {elapsed} · {msg}");
    let clock = Instant::now();
    let is_wanted = |key: &str| arguments.only.is_empty() || arguments.only.iter().any(|only| only == key);
    let meshes = arguments.meshes.as_deref();
    let evaluation =
        Evaluation::run(&model, &ablations, &specific, counts, meshes, &is_wanted, &|part| match part {
            Some((part, scenes)) => {
                bar.set_length(scenes as u64);
                bar.set_message(part.to_owned());
                // Off a terminal there is no bar.
                if bar.is_hidden() {
                    print_status(&format!("{:6.0} s  {part}", clock.elapsed().as_secs_f64()));
                }
            }
            None => bar.inc(1),
        })?;
    bar.finish_and_clear();
    let numbers = evaluation.numbers();
    let page = page(&trained, evaluation, &device, clock.elapsed().as_secs_f64());
    println!("{}", page.markdown());
    write(folder, &numbers, &page)?;
    print_status(&format!("written: {}", folder.join(HTML).display()));
    Ok(())
}

/// Before anything is loaded: whether the report may be written where it is wanted.
fn check_output(folder: &Path) -> Result<(), Report> {
    let occupied = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    let read = |text: String| serde_json::from_str::<Value>(&text).ok();
    let earlier = fs::read_to_string(folder.join(JSON)).ok().and_then(read);
    if occupied && earlier.is_none_or(|report| report["evaluation"].is_null()) {
        return Err(miette!(
            help = "choose another folder with -o",
            "{} holds files that are no evaluation",
            folder.display()
        ));
    }
    Ok(())
}

fn model(
    arguments: &Arguments,
    trained: &TrainedModel,
    mut config: Config,
    device: &Device,
) -> Result<ModelUnderTest, Report> {
    config.validation.seed = arguments.seed.or(config.validation.seed);
    check_data(&config)?;
    let dataset = load_dataset(&config)?;
    let known = trained.known_of_held_out(&config, &dataset);
    if !known.is_empty() {
        return Err(miette!(
            help = "evaluate it with the split of its own configuration: leave out --config and --set of data.split, \
                    data.held_out_garments and the clips of data.poses",
            "{} {}: its scores there would not be those of unseen data",
            trained.folder.display(),
            known.join("; it ")
        ));
    }
    ModelUnderTest::new(trained, config, dataset, device)
}

/// Further models, each with its own data, measured by the losses of `first` on scenes of its seed.
fn named_models(
    arguments: &Arguments,
    flag: &str,
    named: &[(String, PathBuf)],
    first: &ModelUnderTest,
    device: &Device,
) -> Result<Vec<NamedModel>, Report> {
    let opened = |path: &Path| {
        let trained = TrainedModel::open(path)?;
        let mut config = trained.config.clone();
        config.losses = first.config.losses.clone();
        config.validation.seed = Some(first.config.validation_seed());
        model(arguments, &trained, config, device)
    };
    let named_model = |(name, path): &(String, PathBuf)| {
        let model = opened(path).wrap_err_with(|| format!("{flag} \"{name}\""))?;
        Ok(NamedModel { name: name.clone(), model })
    };
    named.iter().map(named_model).collect()
}

/// Ablations are compared on the same outfits, which are sampled from a model's own data: all garments, in held-out windows.
fn check_ablations(ablations: &[NamedModel], first: &ModelUnderTest) -> Result<(), Report> {
    let differs = |other: &&NamedModel| {
        let [own, of_first] = [&other.model, first];
        own.dataset.fingerprint_of_windows() != of_first.dataset.fingerprint_of_windows()
            || own.config.data.shape_range != of_first.config.data.shape_range
    };
    match ablations.iter().find(differs) {
        None => Ok(()),
        Some(other) => Err(miette!(
            help = "train it on the data of the evaluated model: body, garments, held-out windows of the motions, data.shape_range",
            "--ablation {}: it was trained on other data",
            other.name
        )),
    }
}

fn check_specific(specific: &[NamedModel], dataset: &Dataset) -> Result<(), Report> {
    let knows = |name: &str| (0..dataset.garments.len()).any(|g| dataset.garments.info(g).name == name);
    for other in specific {
        let names = other.model.names(&other.model.garments());
        if names.len() != 1 {
            return Err(miette!(
                help = "train it on one garment: data.garments = [{ folder = \"…\", only = [\"NAME\"] }]",
                "{}: a garment-specific model has one garment, the data of this one has {}",
                other.name,
                names.len()
            ));
        }
        if let Some(stranger) = names.iter().find(|name| !knows(name)) {
            return Err(miette!(
                help = "train the garment-specific model on a garment of the configuration's own data",
                "{}: the data of the evaluated model has no garment {stranger:?}",
                other.name
            ));
        }
    }
    Ok(())
}

fn page(trained: &TrainedModel, evaluation: Evaluation, device: &Device, seconds: f64) -> EvaluationPage {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    EvaluationPage {
        title: format!("Evaluation of {}", trained.folder.display()),
        facts: vec![
            ("command", format!("clothcombo {}", arguments.join(" "))),
            (
                "model",
                format!(
                    "{} after {} steps, width {}",
                    trained.folder.display(),
                    trained.state.step,
                    trained.config.model.width
                ),
            ),
            ("device", name(device)),
            ("seed", evaluation.seed.to_string()),
            (
                "made",
                format!("{}, in {:.0} s on {} threads", utc(now), seconds, rayon::current_num_threads()),
            ),
        ],
        sections: evaluation.sections,
    }
}

fn write(folder: &Path, numbers: &Value, page: &EvaluationPage) -> Result<(), Report> {
    // First, because by this file a later evaluation recognises the folder as a report.
    let tables: Vec<_> =
        page.sections.iter().map(|s| json!({ "title": s.title, "tables": s.tables })).collect();
    let json = json!({ "facts": page.facts, "evaluation": numbers, "sections": tables });
    write_json(&folder.join(JSON), &json)?;
    for picture in page.sections.iter().flat_map(|section| &section.pictures) {
        write_file(&folder.join(&picture.file), &picture.png)?;
    }
    write_file(&folder.join(MARKDOWN), page.markdown().as_bytes())?;
    write_file(&folder.join(HTML), page.html().as_bytes())
}
