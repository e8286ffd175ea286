//! `clothcombo drape`: any body, any garments, in order.

mod dataset;
mod folders;
mod job;
mod outfits;
mod summary;

use crate::cli::device_argument::DeviceArgument;
use crate::cli::fit_arguments::{FitArguments, HINTS};
use crate::cli::output::print_json;
use crate::cli::post_process::PostProcessArguments;
use crate::cli::verbosity::{print_status, progress_bar};
use crate::inference::output::{Show, Staged, write};
use crate::inference::{
    Bodies, DrapeProgress, DrapeReport, Draper, DraperSettings, GivenGarment, MOST_RADIUS, RefineSteps,
};
use crate::system::files::write_json;
use crate::system::paths::user_cache;
use clap::{ArgGroup, Parser, ValueEnum};
use clothcombo_data::asset::GarmentMaterial;
use dataset::DatasetFolders;
use folders::check_cache;
use indicatif::ProgressBar;
use job::{Job, RequestedGarment, ordered};
use miette::{IntoDiagnostic, Report, miette};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::{Duration, Instant};

// Groups of flags in the help.
const GARMENTS: &str = "Garments";
const BODY: &str = "Body and pose";
const COMPUTATION: &str = "Networks, post-process, refinement";
const OUTPUT: &str = "Output";

/// Drapes garments on a body, innermost first: OBJ, GLB, picture, viewer and a report with a certificate
#[derive(Parser)]
#[command(group(ArgGroup::new("moving").args(["motion", "outfits"]).multiple(true)))]
#[command(after_help = "Examples (garments from the body outwards):\n  \
        clothcombo drape --checkpoint runs/smoke --garments tee.obj coat.glb -o out\n  \
        clothcombo drape --garments tee.obj skirt.obj coat.obj --order 1,0,2 --shape 1.5,-0.5 --pose walk.npz:30 -o out\n  \
        clothcombo drape --garments tee.obj --motion walk.npz --frames 0..120 -o out\n  \
        clothcombo drape --outfits outfits.toml -o out\n\n\
        A garment is a mesh file (.obj, .ply, .stl, .gltf, .glb) or the name of one in --dataset or in the model's own data.\n\
        What does not lie on the body in metres, y up and T-pose is fitted first (see `clothcombo fit`); every repair is in\n\
        report.json. Hints about files (--unit, --up, --arms, --legs, --category, --offset, --turn, --keep, --join-seams,\n\
        --from-body) are about all of the call; a file with a hint is always fitted, the file of a name with --offset, --turn\n\
        or --from-body. Outputs keep the vertices and polygons of the given files, in their order: what --keep leaves out\n\
        follows the cloth.\n\n\
        --outfits takes a TOML file:\n  \
        [[outfit]]\n  name = \"monday\"\n  garments = [{ file = \"tee.obj\", unit = \"cm\" }, \"coat.obj\"]   # hints, or a name alone\n  # { file = \"coat.obj\", material = { thickness = 0.003 } } is of another material\n  shape = [1.0]       # optional, as are pose, \
        motion, frames, every")]
pub struct Arguments {
    /// Garments, innermost first: mesh files or names
    #[arg(help_heading = GARMENTS, long, num_args = 1.., value_name = "GARMENT", required_unless_present = "outfits", conflicts_with = "outfits")]
    garments: Vec<String>,
    /// Drapes the garments in another order: their numbers from 0, innermost first
    #[arg(help_heading = GARMENTS, long, value_delimiter = ',', value_name = "NUMBERS", conflicts_with = "outfits")]
    order: Option<Vec<usize>>,
    /// Several outfits in one process, from a TOML file; each garment is embedded once
    #[arg(help_heading = GARMENTS, long, value_name = "FILE")]
    outfits: Option<PathBuf>,
    /// Folder whose garments may be named, those in folders within it too; repeatable
    #[arg(help_heading = GARMENTS, long, value_name = "FOLDER")]
    dataset: Vec<PathBuf>,
    /// What the garments are made of, where that is not what the model was trained on: of thickness (m), density (kg/m³),
    /// lambda, mu (Pa) and bending_stiffness (J/rad²). The refinement knows it all; of it the networks see how thick the
    /// garments below are, and the post-process measures strain by it.
    /// Example: --material thickness=0.003,density=150
    #[arg(help_heading = GARMENTS, long, value_name = "KEY=VALUE,…", value_parser = GarmentMaterial::from_str)]
    material: Option<GarmentMaterial>,
    /// Body: "mannequin" or a body npz; default: the one body in --dataset, else the one the model was trained on
    #[arg(help_heading = BODY, long, value_name = "BODY")]
    body: Option<String>,
    #[command(flatten, next_help_heading = BODY)]
    scene: job::SceneArguments,
    /// Whether mesh files are fitted to the body
    #[arg(help_heading = HINTS, long, value_enum, default_value_t = Fit::Auto)]
    fit: Fit,
    #[command(flatten)]
    hints: FitArguments,
    /// Run, checkpoint folder or model.safetensors; default: the shipped model, which is part of the program
    #[arg(help_heading = COMPUTATION, long, value_name = "PATH")]
    checkpoint: Option<PathBuf>,
    #[command(flatten, next_help_heading = COMPUTATION)]
    device: DeviceArgument,
    /// Leaves out the post-process; the certificate still counts everything
    #[arg(help_heading = COMPUTATION, long, conflicts_with_all = ["gap_mm", "time_limit"])]
    no_resolve: bool,
    #[command(flatten, next_help_heading = COMPUTATION)]
    post_process: PostProcessArguments,
    /// Steps of the static solver after networks and post-process that make no intersection, at most 2 cm each, until a vertex
    /// is 5 cm from there: at most 1000, 0 for none; `auto`: until a step gains less than 1 % of what all did, for at most two
    /// seconds [default: 4 for one pose, 0 for a motion]
    #[arg(help_heading = COMPUTATION, long, value_name = "STEPS|auto")]
    refine: Option<RefineSteps>,
    /// Smooths a motion over this many frames to each side, before the post-process and, where that makes no
    /// intersection, after it; 0 takes every frame as it is [default: 2 for frames at most 0.05 s apart, else 0]
    #[arg(help_heading = COMPUTATION, long, num_args = 0..=1, default_missing_value = "2", value_name = "FRAMES",
          value_parser = clap::value_parser!(u16).range(..=i64::from(MOST_RADIUS)))]
    smooth: Option<u16>,
    /// Folder that keeps embeddings between runs; default: clothcombo in the user's cache folder
    #[arg(help_heading = COMPUTATION, long, value_name = "FOLDER")]
    cache: Option<PathBuf>,
    /// Keeps nothing between runs
    #[arg(help_heading = COMPUTATION, long, conflicts_with = "cache")]
    no_cache: bool,
    /// Folder to make
    #[arg(help_heading = OUTPUT, short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Writes OBJ files of every frame of a motion, not only of the first
    #[arg(help_heading = OUTPUT, long, requires = "moving")]
    all_frames: bool,
    /// Replaces the folder of an earlier drape
    #[arg(help_heading = OUTPUT, long)]
    replace: bool,
    /// Prints the report as JSON instead of tables
    #[arg(help_heading = OUTPUT, long)]
    json: bool,
}

impl Arguments {
    /// What is read, beside what an outfit names.
    fn inputs(&self) -> impl Iterator<Item = PathBuf> {
        let body = self.body.iter().map(PathBuf::from);
        let paths = [&self.outfits, &self.checkpoint].into_iter().flatten().chain(&self.dataset);
        paths.cloned().chain(body)
    }
}

/// Whether mesh files are fitted.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
enum Fit {
    /// Those that do not lie on the body as they are, or have defects
    Auto,
    /// All
    Always,
    /// None: they are taken as they are
    Never,
}

impl Fit {
    fn decided(self) -> Option<bool> {
        match self {
            Self::Auto => None,
            Self::Always => Some(true),
            Self::Never => Some(false),
        }
    }
}

/// Runs the verb.
///
/// # Errors
/// When a file cannot be read or written, or something cannot be draped. Intersections that are left are no error: the
/// certificate lists them.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let jobs = jobs(arguments)?;
    if arguments.smooth.is_some_and(|radius| radius > 0) && jobs.iter().all(|job| job.scene.motion.is_none())
    {
        return Err(miette!(help = "give --motion FILE, or leave --smooth out", "--smooth without a motion"));
    }
    let dataset = DatasetFolders::find(&arguments.dataset)?;
    let settings = settings(arguments, dataset.body)?;
    check_cache(settings.cache.as_deref(), &arguments.output)?;
    let inputs: Vec<PathBuf> = jobs.iter().flat_map(Job::files).chain(arguments.inputs()).collect();
    let mut staged = Staged::new(&arguments.output, arguments.replace, &inputs)?;
    let clock = Instant::now();
    let draper = Draper::load(arguments.checkpoint.as_deref(), &settings)?;
    let catalog = draper.catalog(&dataset.garments)?;
    tracing::info!(
        "model {} (step {}), body {}: loaded in {:.1} s",
        draper.trained().folder.display(),
        draper.trained().state.step,
        draper.body().name,
        clock.elapsed().as_secs_f64()
    );
    let clock = Instant::now();
    // Everything is read before anything is draped, so that a wrong name in the last outfit fails at once.
    let blame = |job: &Job, failure: Report| match arguments.outfits {
        None => failure,
        Some(_) => failure.wrap_err(format!("outfit {}", job.name)),
    };
    let read = |job: &Job| {
        let find = |garment: &RequestedGarment| {
            let fit = arguments.fit.decided();
            let mut source = catalog.find(&garment.name, draper.body(), fit, &garment.hints)?;
            source.add_material(garment.material);
            Ok(source)
        };
        let sources = job.garments.iter().map(find).collect::<Result<Vec<_>, Report>>()?;
        draper.check_garments(&sources)?;
        let bodies = job.bodies(&draper)?;
        draper.check_bodies(&bodies)?;
        Ok((sources, bodies))
    };
    let read = |job| read(job).map_err(|failure| blame(job, failure));
    let wanted = jobs.iter().map(read).collect::<Result<Vec<_>, Report>>()?;
    // A name says only now which file it stands for.
    let files = wanted.iter().flat_map(|(sources, _)| sources).filter_map(|source| source.path.clone());
    staged.keep(files.chain([draper.trained().folder.clone()]))?;
    let bar = match wanted.iter().map(|(_, bodies)| bodies.states.len()).sum() {
        1 => progress_bar(1, "{spinner} draping · {elapsed}{prefix}{msg}"),
        drapes => progress_bar(drapes, "drapes {bar:30} {pos}/{len} · {eta} left{prefix}{msg}"),
    };
    bar.enable_steady_tick(Duration::from_millis(200));
    let drape = |job: &Job, sources: Vec<GivenGarment>, bodies: &Bodies| -> Result<DrapeReport, Report> {
        let (folder, outfit) = (staged.folder(), draper.outfit(sources)?);
        let (drapes, smoothing) =
            draper.drape_bodies(&outfit, bodies, arguments.smooth, show_progress(&bar))?;
        bar.set_prefix("");
        let title = match job.name.as_str() {
            "outfit" => outfit.names().collect::<Vec<_>>().join(", "),
            name => name.to_owned(),
        };
        let show = Show {
            draper: &draper,
            outfit: &outfit,
            bodies,
            drapes: &drapes,
            smoothing: smoothing.as_ref(),
            title: &title,
            all_frames: arguments.all_frames,
        };
        match jobs.len() {
            1 => write(folder, &show),
            _ => write(&folder.join(&job.name), &show),
        }
    };
    let mut reports = Vec::new();
    for (job, (sources, bodies)) in jobs.iter().zip(wanted) {
        let report = drape(job, sources, &bodies).map_err(|failure| blame(job, failure))?;
        reports.push((job.name.as_str(), report));
    }
    bar.finish_and_clear();
    if jobs.len() > 1 {
        let list: Vec<_> = reports
            .iter()
            .map(|(name, r)| json!({ "name": name, "milliseconds": r.milliseconds, "certificate": r.certificate }))
            .collect();
        write_json(&staged.folder().join(outfits::REPORT), &json!({ "outfits": list }))?;
    }
    staged.commit()?;
    print(arguments, &reports)?;
    let seconds = clock.elapsed().as_secs_f64();
    print_status(&format!(
        "{} draped and written in {seconds:.2} s after loading",
        arguments.output.display()
    ));
    Ok(())
}

fn jobs(arguments: &Arguments) -> Result<Vec<Job>, Report> {
    let hints = arguments.hints.settings().into_diagnostic()?;
    let material = arguments.material.unwrap_or_default();
    match &arguments.outfits {
        Some(file) => outfits::read(file, &arguments.scene, &hints, material),
        None => {
            let wanted =
                |name: &String| RequestedGarment { name: name.clone(), hints: hints.clone(), material };
            let garments = arguments.garments.iter().map(wanted).collect();
            let garments = ordered(garments, arguments.order.as_deref())?;
            Ok(vec![Job { name: "outfit".to_owned(), garments, scene: arguments.scene.clone() }])
        }
    }
}

fn settings(arguments: &Arguments, body: Option<String>) -> Result<DraperSettings, Report> {
    let cache = match arguments.no_cache {
        true => None,
        false => arguments.cache.clone().or_else(user_cache),
    };
    Ok(DraperSettings {
        body: arguments.body.clone().or(body),
        cache,
        device: arguments.device.open()?,
        refine: arguments.refine,
        resolve: !arguments.no_resolve,
        post_process: arguments.post_process.settings(),
        ..DraperSettings::default()
    })
}

fn show_progress(bar: &ProgressBar) -> impl FnMut(DrapeProgress) {
    |progress| match progress {
        DrapeProgress::Continuation(share) if share < 1.0 => {
            bar.set_message(format!(
                " · resolving intersections, {:.0} % of the continuation path",
                100.0 * share
            ));
        }
        DrapeProgress::Continuation(_) => bar.set_message(""),
        DrapeProgress::Draped => {
            bar.set_message("");
            bar.inc(1);
        }
        DrapeProgress::Again(frame) => {
            bar.set_message("");
            bar.set_prefix(format!(" · number {} once more, from the one after it", frame + 1));
        }
    }
}

fn print(arguments: &Arguments, reports: &[(&str, DrapeReport)]) -> Result<(), Report> {
    match (arguments.json, reports) {
        (true, [(_, only)]) => print_json(only)?,
        (true, several) => {
            print_json(&several.iter().map(|(name, report)| (name, report)).collect::<BTreeMap<_, _>>())?;
        }
        (false, [(_, only)]) => print!("{}", summary::tables(only)),
        (false, several) => {
            let texts = several.iter().map(|(name, report)| format!("{name}\n{}", summary::tables(report)));
            print!("{}", texts.collect::<Vec<_>>().join("\n"));
        }
    }
    Ok(())
}
