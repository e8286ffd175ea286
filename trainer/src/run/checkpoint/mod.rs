//! Checkpoints: whole on disk or not there at all, and exact to the bit when training continues from one.
//!
//! ```text
//! checkpoints/step-00000100/  state.json         format, step, dimensions, joint names, best score, recent incidents,
//!                                                checksums of the other files and of itself
//!                             config.toml        the run's configuration, so that a checkpoint stands alone
//!                             model.safetensors  parameters for use, by name, for exchange
//!                             model.bpk optimizer.bpk   exact parameters and Adam moments
//!                             average.bpk        running average of the parameters, where optimizer.ema_decay asks for it
//!                             data.json          names and digests of body, garments and clips
//! checkpoints/latest          name of the newest whole checkpoint, for scripts
//! checkpoints/best            name of the one with the best validation, for scripts
//! ```
//! Scenes are a function of seed and step, so neither generator states nor a position in the data have to be stored.

mod error;
mod retention;
mod state;
mod trained;

pub use error::CheckpointError;
pub use state::{BestValidation, CheckpointState};
pub use trained::{ModelFiles, TrainedModel};

use crate::config::{Config, load, to_toml};
use crate::dataset::DataList;
use crate::run::difference::{Difference, differences};
use crate::run::folder::{CONFIG_FILE, RunDir};
use burn::module::Module;
use burn::optim::ModuleOptimizer;
use burn::store::{ModuleRecord, ModuleSnapshot, SafetensorsStore};
use burn::tensor::Device;
use clothcombo_data::format::atomic::{self, Temporary};
use clothcombo_model::{ClothCombo, Dimensions, ModelConfig};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

const MODEL_EXCHANGE: &str = "model.safetensors";
const MODEL_EXACT: &str = "model.bpk";
const AVERAGE: &str = "average.bpk";
const DATA_LIST: &str = "data.json";
const OPTIMIZER: &str = "optimizer.bpk";
const STATE: &str = "state.json";
const REQUIRED_FILES: [&str; 4] = [MODEL_EXCHANGE, MODEL_EXACT, OPTIMIZER, CONFIG_FILE];

/// What training consists of at one moment.
pub struct Snapshot<'a> {
    /// The parameters that are trained.
    pub model: &'a ClothCombo,
    /// Their running average, if one is kept.
    pub average: Option<&'a ClothCombo>,
    /// Adam's moments.
    pub optimizer: &'a ModuleOptimizer,
    /// What the data consists of.
    pub data: &'a DataList,
}

/// A whole checkpoint on disk.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    /// Its folder.
    pub path: PathBuf,
    /// What it says about itself.
    pub state: CheckpointState,
}

impl Checkpoint {
    /// Writes a checkpoint, makes it the newest one and removes those that `config.output` does not keep.
    ///
    /// # Errors
    /// When something cannot be written; the previous newest checkpoint then stays the newest.
    pub fn save(
        run: &RunDir,
        config: &Config,
        mut state: CheckpointState,
        snapshot: &Snapshot,
    ) -> Result<Self, CheckpointError> {
        let folder = run.checkpoints();
        let name = retention::name(state.step);
        let path = folder.join(&name);
        let temporary = Temporary::new(folder.join(format!("{name}{}", retention::TEMPORARY_ENDING)));
        let failed = |reason: String| CheckpointError::Write { path: path.clone(), reason };
        let io_failed = |e: io::Error| failed(e.to_string());

        retention::sweep(&folder);
        write(temporary.path(), config, &mut state, snapshot).map_err(failed)?;
        temporary.replace(&path).map_err(io_failed)?;
        File::open(&folder).and_then(|d| d.sync_all()).map_err(io_failed)?;
        atomic::write(&folder.join("latest"), name.as_bytes()).map_err(io_failed)?;
        let best = state.best.map(|b| b.step);
        retention::prune(&folder, &config.output, state.step, best).map_err(io_failed)?;
        // Also where this one is not the best: a save that was cut short may have left an older name.
        retention::name_best(&folder, best.filter(|_| config.output.keep_best)).map_err(io_failed)?;
        tracing::info!("checkpoint {} written", path.display());
        Ok(Self { path, state })
    }

    /// Opens a checkpoint: a checkpoint folder, or the newest whole one of a run or checkpoints folder. Damaged ones are
    /// passed over with a warning.
    ///
    /// # Errors
    /// When there is none, or it (or all of them) is damaged or of another version.
    pub fn open(path: &Path) -> Result<Self, CheckpointError> {
        Self::open_until(path, u64::MAX)
    }

    /// The same of at most `step` steps, where the newest of several is asked for.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_until(path: &Path, step: u64) -> Result<Self, CheckpointError> {
        newest(path, step, |folder| {
            let state = read_state(folder, &REQUIRED_FILES)?;
            state.checksums.keys().try_for_each(|file| verify(folder, &state, file))?;
            Ok(Self { path: folder.to_owned(), state })
        })
    }

    /// The configuration of the run it belongs to.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn config(&self) -> Result<Config, CheckpointError> {
        Ok(load(&self.path.join(CONFIG_FILE), &[])?)
    }

    /// The networks for use, on `device`: the average of the trained ones where the run keeps one.
    ///
    /// # Errors
    /// When the stored parameters do not fit the configuration.
    pub fn model(&self, config: &Config, device: &Device) -> Result<ClothCombo, CheckpointError> {
        let averaged = self.average(config, device)?;
        averaged.map_or_else(|| self.trained_model(config, device), Ok)
    }

    /// The networks to go on training, on `device`.
    ///
    /// # Errors
    /// When the stored parameters do not fit the configuration.
    pub fn trained_model(&self, config: &Config, device: &Device) -> Result<ClothCombo, CheckpointError> {
        self.read_model(MODEL_EXACT, config, device)
    }

    /// The running average of the networks, if the run kept one.
    ///
    /// # Errors
    /// When the stored parameters do not fit the configuration.
    pub fn average(&self, config: &Config, device: &Device) -> Result<Option<ClothCombo>, CheckpointError> {
        let kept = self.state.checksums.contains_key(AVERAGE);
        kept.then(|| self.read_model(AVERAGE, config, device)).transpose()
    }

    fn read_model(
        &self,
        file: &str,
        config: &Config,
        device: &Device,
    ) -> Result<ClothCombo, CheckpointError> {
        let unusable = |reason: String| CheckpointError::Unusable { path: self.path.clone(), reason };
        let dimensions = self.state.dimensions();
        let model =
            load_model(&self.path.join(file), &config.model, &dimensions, device).map_err(unusable)?;
        model.map_err(|error| match self.config() {
            // The files are those that were written: it is the configuration that asks for other networks.
            Ok(own) => match other_networks(config, &own) {
                changes if changes.is_empty() => unusable(error),
                changes => CheckpointError::OtherNetworks { path: self.path.clone(), changes },
            },
            Err(error) => error,
        })
    }

    /// What its data consisted of; `None` in a checkpoint of an early version.
    pub fn data(&self) -> Option<DataList> {
        serde_json::from_slice(&fs::read(self.path.join(DATA_LIST)).ok()?).ok()
    }

    /// `optimizer` with the stored moments.
    ///
    /// # Errors
    /// When they cannot be read.
    pub fn optimizer(&self, optimizer: ModuleOptimizer) -> Result<ModuleOptimizer, CheckpointError> {
        optimizer
            .load(self.path.join(OPTIMIZER))
            .map_err(|e| CheckpointError::Unusable { path: self.path.clone(), reason: e.to_string() })
    }

    /// Sets the later checkpoints of `run` aside, as `abandoned-step-…`: the run goes on from this one. Returns how many.
    ///
    /// # Errors
    /// When they cannot be renamed.
    pub fn abandon_later(&self, run: &RunDir) -> Result<usize, CheckpointError> {
        retention::abandon_after(&run.checkpoints(), self.state.step)
            .map_err(|e| CheckpointError::Write { path: run.checkpoints(), reason: e.to_string() })
    }
}

/// The keys of networks in which `config` differs from `own`.
fn other_networks(config: &Config, own: &Config) -> Vec<Difference> {
    let mut changes = differences(config, own);
    changes.retain(|change| change.key.starts_with("model."));
    changes
}

/// What `open` makes of a checkpoint folder, or of the newest one in a run or checkpoints folder that it accepts, of at most
/// `step` steps.
fn newest<T>(
    path: &Path,
    step: u64,
    open: impl Fn(&Path) -> Result<T, CheckpointError>,
) -> Result<T, CheckpointError> {
    if path.join(STATE).exists() {
        return open(path);
    }
    let (mut first_error, mut count) = (None, 0);
    for folder in [path.to_owned(), path.join("checkpoints")] {
        let listed = retention::list(&folder).into_iter().rev();
        for (_, candidate) in listed.filter(|(number, _)| *number <= step) {
            match open(&candidate) {
                Ok(found) => return Ok(found),
                Err(error) => {
                    tracing::warn!("passed over: {error}");
                    first_error.get_or_insert(error);
                    count += 1;
                }
            }
        }
    }
    Err(match first_error {
        None => CheckpointError::Missing { path: path.to_owned() },
        Some(error) if count == 1 => error,
        Some(error) => CheckpointError::AllUnusable { path: path.to_owned(), count, reason: Box::new(error) },
    })
}

/// A checkpoint's `state.json`, which must hold the checksums of `required`.
fn read_state(folder: &Path, required: &[&str]) -> Result<CheckpointState, CheckpointError> {
    let unusable = |reason: String| CheckpointError::Unusable { path: folder.to_owned(), reason };
    let bytes = fs::read(folder.join(STATE)).map_err(|e| unusable(format!("{STATE}: {e}")))?;
    let text =
        String::from_utf8(bytes).map_err(|_| unusable(format!("{STATE} is damaged: it is no text")))?;
    let state = CheckpointState::read(&text).map_err(|what| unusable(format!("{STATE} {what}")))?;
    match required.iter().find(|f| !state.checksums.contains_key(**f)) {
        Some(missing) => Err(unusable(format!("{STATE} has no checksum of {missing}"))),
        None => Ok(state),
    }
}

/// Compares `file` with its checksum.
fn verify(folder: &Path, state: &CheckpointState, file: &str) -> Result<(), CheckpointError> {
    let unusable = |reason: String| CheckpointError::Unusable { path: folder.to_owned(), reason };
    let sum = checksum(&folder.join(file)).map_err(|e| unusable(format!("{file}: {e}")))?;
    match state.checksums.get(file) == Some(&sum) {
        true => Ok(()),
        false => Err(unusable(format!("{file} does not match its checksum"))),
    }
}

/// Writes all files of a checkpoint into `folder` and has the disk confirm them.
fn write(
    folder: &Path,
    config: &Config,
    state: &mut CheckpointState,
    snapshot: &Snapshot,
) -> Result<(), String> {
    let text = |e: io::Error| e.to_string();
    fs::create_dir_all(folder).map_err(text)?;
    // A single entry: burn keeps metadata in a hash map, whose order would make equal models differ as files.
    let mut exchange = SafetensorsStore::from_file(folder.join(MODEL_EXCHANGE))
        .clear_metadata()
        .metadata("clothcombo_step", state.step.to_string());
    snapshot.average.unwrap_or(snapshot.model).save_into(&mut exchange).map_err(|e| e.to_string())?;
    save_model(snapshot.model, &folder.join(MODEL_EXACT))?;
    snapshot.optimizer.save(folder.join(OPTIMIZER)).map_err(|e| e.to_string())?;
    fs::write(folder.join(CONFIG_FILE), to_toml(config).map_err(|e| e.to_string())?).map_err(text)?;
    fs::write(folder.join(DATA_LIST), serde_json::to_vec(snapshot.data).map_err(|e| e.to_string())?)
        .map_err(text)?;
    let mut files = REQUIRED_FILES.to_vec();
    files.push(DATA_LIST);
    if let Some(average) = snapshot.average {
        save_model(average, &folder.join(AVERAGE))?;
        files.push(AVERAGE);
    }
    // The exchange file is written as private to its owner; it may be read by whom the others may be read.
    let usual = fs::metadata(folder.join(CONFIG_FILE)).map_err(text)?.permissions();
    fs::set_permissions(folder.join(MODEL_EXCHANGE), usual).map_err(text)?;
    for file in &files {
        let path = folder.join(file);
        let named = |e: io::Error| format!("{file}: {e}");
        File::open(&path).and_then(|f| f.sync_all()).map_err(named)?;
        state.checksums.insert((*file).to_owned(), checksum(&path).map_err(named)?);
    }
    let sealed = state.sealed().map_err(|e| e.to_string())?;
    fs::write(folder.join(STATE), sealed).map_err(text)?;
    File::open(folder.join(STATE)).and_then(|f| f.sync_all()).map_err(text)?;
    File::open(folder).and_then(|f| f.sync_all()).map_err(text)
}

/// Writes the exact parameters of `model`.
///
/// # Errors
/// The reason, in words.
pub(crate) fn save_model(model: &ClothCombo, path: &Path) -> Result<(), String> {
    model.clone().into_record().save(path).map_err(|e| e.to_string())
}

/// The networks whose exact parameters [`save_model`] wrote; or, within, why these are of networks of other sizes.
///
/// # Errors
/// Why the file cannot be read or networks of these sizes not be made, in words.
pub(crate) fn load_model(
    path: &Path,
    config: &ModelConfig,
    dimensions: &Dimensions,
    device: &Device,
) -> Result<Result<ClothCombo, String>, String> {
    let record = ModuleRecord::load(path).map_err(|e| e.to_string())?;
    let model = ClothCombo::new(config, dimensions, 0, device).map_err(|e| e.to_string())?;
    Ok(model.try_load_record(record).map_err(|e| e.to_string()))
}

/// BLAKE3 of a file, as hexadecimal text.
///
/// # Errors
/// The file system's.
pub(crate) fn checksum(path: &Path) -> io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    io::copy(&mut File::open(path)?, &mut hasher)?;
    Ok(hasher.finalize().to_hex().to_string())
}
