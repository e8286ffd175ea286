//! `clothcombo-train`.

mod origin;

use super::exit_code;
use crate::cli::device_argument::DeviceArgument;
use crate::cli::loading::make_pose_bank;
use crate::cli::memory_table::{memory_line, memory_warning};
use crate::cli::verbosity::{Verbosity, is_quiet, print_status};
use crate::config::{Config, load};
use crate::dataset::{Dataset, FrameCounts};
use crate::run::event::Observer;
use crate::run::folder::RunDir;
use crate::run::memory::MemoryEstimate;
use crate::run::observer::{
    History, HistoryObserver, LogObserver, MetricsObserver, ProgressObserver, ReportObserver,
    TensorBoardObserver,
};
use crate::system::files::write_json;
use crate::system::memory::gibibytes;
use crate::system::stop::StopFlag;
use crate::training::process_group::ProcessGroup;
use crate::training::session::Session;
use crate::training::train_loop::train;
use clap::Parser;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use origin::RunOrigin;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::rc::Rc;

/// Trains ClothCombo's four networks from a configuration file.
#[derive(Parser)]
#[command(
    name = "clothcombo-train",
    version,
    after_help = "Examples:\n  clothcombo-train --config configs/smoke.toml\n  \
        clothcombo-train --config configs/open.toml --run-dir runs/wide --set model.width=128\n  \
        clothcombo-train --run-dir runs/wide --resume\n  \
        clothcombo-train --resume runs/wide/checkpoints/step-00004000\n  \
        clothcombo-train --resume runs/wide --set stages.2.steps=9000 --allow-config-change stages\n\n\
        Ctrl-C, SIGTERM, SIGHUP or SIGUSR1 saves a checkpoint and exits 0; a second Ctrl-C or SIGTERM ends at once. Relative paths in \
        a configuration lie beside it if they are there, else in the folder in which the run is started; it resumes\n        from any."
)]
pub struct Arguments {
    /// Configuration file (TOML); optional with --resume --run-dir, which use the run's own
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Overrides one value, for example losses.strain.weight=2.0 or stages.0.steps=500; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Continues a run from its newest whole checkpoint, or from the checkpoint PATH; PATH may also be the run folder.
    /// It continues to the bit only on the device the checkpoint is from, with as many threads
    #[arg(long, value_name = "PATH", num_args = 0..=1)]
    resume: Option<Option<PathBuf>>,
    /// With --resume: keys whose values may differ from the run's own, separated by commas; a section allows all in it. data,
    /// data.body, data.garments and data.poses also allow other files
    #[arg(long, value_name = "KEYS", value_delimiter = ',', requires = "resume")]
    allow_config_change: Vec<String>,
    /// Folder of the run; default: runs/NAME-OF-CONFIG, numbered when taken, or the folder that PATH lies in
    #[arg(long, value_name = "DIR")]
    run_dir: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgument,
    #[command(flatten)]
    verbosity: Verbosity,
}

impl Arguments {
    /// The run folder that is named, by --run-dir or by the path of --resume.
    fn named_run(&self) -> Result<Option<PathBuf>, Report> {
        let Some(Some(path)) = &self.resume else { return Ok(self.run_dir.clone()) };
        let run = run_of(path).ok_or_else(|| {
            miette!(
                help = "pass a run folder or one of its checkpoints, such as RUN/checkpoints/step-00001000",
                "--resume {}: that is neither a run nor a checkpoint of one",
                path.display()
            )
        })?;
        let same = |a: &Path, b: &Path| a.canonicalize().ok() == b.canonicalize().ok();
        match &self.run_dir {
            Some(dir) if !same(dir, &run) => Err(miette!(
                help = "leave --run-dir out: a checkpoint continues the run it belongs to",
                "--resume {} belongs to {}, not to {}",
                path.display(),
                run.display(),
                dir.display()
            )),
            _ => Ok(Some(run)),
        }
    }

    fn config_file(&self, run: Option<&Path>) -> Result<PathBuf, Report> {
        match (&self.config, run, &self.resume) {
            (Some(file), _, _) => Ok(file.clone()),
            (None, Some(run), Some(_)) => {
                Some(run.join("config.toml")).filter(|file| file.exists()).ok_or_else(|| {
                    miette!(
                        help = "leave --resume out to start a run there, with --config",
                        "{} is not the folder of a run: it holds no config.toml",
                        run.display()
                    )
                })
            }
            _ => Err(miette!(help = "for example --config configs/smoke.toml", "no configuration was given")),
        }
    }
}

/// The run that `path` is, or that the checkpoint or checkpoints folder `path` belongs to.
fn run_of(path: &Path) -> Option<PathBuf> {
    // A checkpoint has a config.toml as well, but only a run has checkpoints.
    let is_run = |p: &Path| p.join("config.toml").is_file() && p.join("checkpoints").is_dir();
    // Absolute, so that `step-00001000` alone has parents.
    let full = path.canonicalize().ok()?;
    let found = full.ancestors().take(3).position(is_run)?;
    // In the words of the user where that is possible.
    let spelled = path.ancestors().nth(found).filter(|p| !p.as_os_str().is_empty() && is_run(p));
    spelled.map(Path::to_path_buf).or_else(|| full.ancestors().nth(found).map(Path::to_path_buf))
}

/// The whole program, as one of the processes that a launcher may have started.
pub fn main() -> ExitCode {
    let group = match ProcessGroup::join() {
        Ok(group) => Rc::new(group),
        Err(error) => return exit_code(Err(error)),
    };
    let arguments = match super::parse::<Arguments>() {
        Ok(arguments) => arguments,
        Err(message) => {
            if group.is_rank_zero() {
                // A closed terminal is no reason to fail differently.
                let _ = message.print();
            }
            return ExitCode::from(u8::try_from(message.exit_code()).unwrap_or(2));
        }
    };
    arguments.verbosity.or_quiet(!group.is_rank_zero()).apply("warn");
    match group.conclude(run(&arguments, &group)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Some(report)) => exit_code(Err(report)),
        Err(None) => ExitCode::FAILURE,
    }
}

/// Trains as one of the processes in `group`, of which only the leader writes and prints.
///
/// # Errors
/// One report that names the file, key or garment at fault and how to repair it.
fn run(arguments: &Arguments, group: &Rc<ProcessGroup>) -> Result<(), Report> {
    let stop = StopFlag::on_signals().into_diagnostic().wrap_err("cannot listen for Ctrl-C")?;
    let named = arguments.named_run()?;
    let file = arguments.config_file(named.as_deref())?;
    let root = named.unwrap_or_else(|| default_run_dir(&file, arguments.resume.is_some()));
    let config = load(&file, &arguments.overrides)?;
    // All that can be wrong is found out before anything is made.
    let resume = arguments.resume.as_ref().map(Option::as_deref);
    let origin = RunOrigin::find(resume, &arguments.allow_config_change, &root, &config, group)?;
    let device = arguments.device.open()?;
    let (dataset, check) = origin.load_data(&config, group)?;
    print_data(&dataset);
    make_pose_bank(&dataset.poses);
    let (run, mut session) = origin.begin(&root, &config, &dataset, &device, group)?;
    if !group.is_rank_zero() {
        return train(&mut session, &mut [], &stop);
    }
    run.write_split(&dataset.split_names())?;
    if let Some(check) = &check {
        write_json(&run.data_check(), check)?;
    }
    let memory = session.memory_estimate();
    print_status(&format!("run folder {}", run.root().display()));
    if group.is_shared() {
        print_status(&format!("{} processes share every step", group.partition().size));
    }
    if let Some(memory) = &memory {
        print_status(&memory_line(memory));
        if let Some(warning) = memory_warning(memory) {
            tracing::warn!("{warning}");
        }
    }
    let mut observers = observers(&run, &config, &session, memory)?;
    let result = train(&mut session, &mut observers, &stop);
    let (host, device) = (dataset.memory.most(), session.tensors().memory().most());
    tracing::info!(
        "kept of garments at most {}, {} of it tensors and embeddings",
        gibibytes(host.total.max(device.total) as u64),
        gibibytes(device.device as u64)
    );
    result
}

fn observers(
    run: &RunDir,
    config: &Config,
    session: &Session,
    memory: Option<MemoryEstimate>,
) -> Result<Vec<Box<dyn Observer>>, Report> {
    let (step, device) = (session.step(), session.device_name());
    let log = LogObserver::new(run, &device, session.earlier_device())?;
    // First, because it drops the lines after the checkpoint that the run continues from.
    let metrics = MetricsObserver::new(run, step, config.output.metrics_every)?;
    let history = Rc::new(RefCell::new(History::read(run)?));
    let licences = session.dataset().licences();
    let report = ReportObserver::new(run, config, device, licences, memory, history.clone())?;
    let mut observers: Vec<Box<dyn Observer>> =
        vec![Box::new(metrics), Box::new(log), Box::new(HistoryObserver(history.clone()))];
    if config.output.tensorboard {
        observers.push(Box::new(TensorBoardObserver::new(run, step, config.output.metrics_every)?));
    }
    observers.push(Box::new(report));
    if !is_quiet() {
        observers.push(Box::new(ProgressObserver::new(run, history)));
    }
    Ok(observers)
}

fn print_data(dataset: &Dataset) {
    let frames = match dataset.poses.frame_counts() {
        Some(FrameCounts { training, windows, validation, test }) => format!(
            "{training} motion frames (never trained on: {windows} of held-out windows, {validation} of validation clips, \
             {test} of test clips)"
        ),
        None => "sampled poses".into(),
    };
    print_status(&format!(
        "body: {} · {} garments ({} not trained on) · {} joints · {} shape components · {frames}",
        dataset.body.name,
        dataset.garments.len(),
        dataset.garments.len() - dataset.split.training.len(),
        dataset.joints().len(),
        dataset.shape_count
    ));
}

/// `runs/NAME`, or the first free `runs/NAME-2`, `-3`, …; when resuming, the last existing one.
fn default_run_dir(config: &Path, resume: bool) -> PathBuf {
    let name = config.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let candidate =
        |i: usize| Path::new("runs").join(if i == 1 { name.clone() } else { format!("{name}-{i}") });
    let free = (1..).find(|&i| !candidate(i).join("config.toml").exists()).unwrap_or(1);
    candidate(if resume { free.max(2) - 1 } else { free })
}
