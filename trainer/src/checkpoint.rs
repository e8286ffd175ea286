//! Checkpoints: whole on disk or not there at all, and exact to the bit when training continues from one.
//!
//! ```text
//! checkpoints/step-00000100/  state.json         format, step, dimensions, joint names, checksums of the other files
//!                             config.toml        the run's configuration, so that a checkpoint stands alone
//!                             model.safetensors  parameters by name, for exchange
//!                             model.bpk optimizer.bpk   exact parameters and Adam moments
//! checkpoints/latest          name of the newest whole checkpoint
//! ```
//! Scenes are a function of seed and step, so no generator state has to be stored.

use crate::config::{Config, ConfigError, load, to_toml};
use crate::run_dir::RunDir;
use burn::module::Module;
use burn::optim::ModuleOptimizer;
use burn::store::{ModuleRecord, ModuleSnapshot, SafetensorsStore};
use burn::tensor::Device;
use clothcombo_data::format::atomic;
use clothcombo_model::{ClothCombo, Dimensions};
use miette::Diagnostic;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Version of the layout above; other versions are refused.
const FORMAT: u32 = 1;

/// Why a checkpoint cannot be written or read.
#[derive(Debug, Error, Diagnostic)]
pub enum CheckpointError {
    /// The file system refused.
    #[error("cannot write the checkpoint {}: {reason}", path.display())]
    #[diagnostic(help("earlier checkpoints are untouched; check free space and permissions"))]
    Write {
        /// The checkpoint.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// There is no checkpoint.
    #[error("{} holds no checkpoint", path.display())]
    #[diagnostic(help(
        "pass a run folder, its checkpoints folder, or one checkpoint folder such as RUN/checkpoints/step-00001000"
    ))]
    Missing {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// The checkpoint cannot be used.
    #[error("checkpoint {}: {reason}", path.display())]
    #[diagnostic(help("choose an older checkpoint of the run; damaged ones are never loaded"))]
    Unusable {
        /// The checkpoint.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// The configuration inside cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Config(#[from] ConfigError),
}

/// What a checkpoint says about itself.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckpointState {
    /// Layout version.
    pub format: u32,
    /// Steps done.
    pub step: u64,
    /// Joints the networks see, in order.
    pub joints: Vec<String>,
    /// Shape components.
    pub shape_count: usize,
    /// Length of the pose feature.
    pub pose_features: usize,
    /// BLAKE3 checksum of each file.
    pub checksums: BTreeMap<String, String>,
}

impl CheckpointState {
    /// Input sizes of the networks.
    pub fn dimensions(&self) -> Dimensions {
        Dimensions { joints: self.joints.len(), shape: self.shape_count, pose: self.pose_features }
    }
}

const MODEL_EXCHANGE: &str = "model.safetensors";
const MODEL_EXACT: &str = "model.bpk";
const OPTIMIZER: &str = "optimizer.bpk";
const CONFIG: &str = "config.toml";
const STATE: &str = "state.json";

/// Trained networks for use, not for training on: `model.safetensors`, `config.toml` and `state.json` of a checkpoint,
/// whatever else lies beside them. A model that is handed on needs no more than these three files.
#[derive(Clone, Debug)]
pub struct TrainedModel {
    /// Its folder.
    pub folder: PathBuf,
    /// What it says about itself.
    pub state: CheckpointState,
    /// The configuration it was trained with.
    pub config: Config,
}

impl TrainedModel {
    /// Opens a run, a checkpoints folder, one checkpoint, or a `model.safetensors` with its two companions.
    ///
    /// # Errors
    /// When there is none, or one of the three files is missing, damaged or of another version.
    pub fn open(path: &Path) -> Result<Self, CheckpointError> {
        let folder = match path.is_file() {
            true => path.parent().unwrap_or(Path::new("")).to_owned(),
            false => Checkpoint::locate(path)?,
        };
        let state = read_state(&folder, &[MODEL_EXCHANGE, CONFIG])?;
        let config = load(&folder.join(CONFIG), &[])?;
        Ok(Self { folder, state, config })
    }

    /// The networks, on `device`.
    ///
    /// # Errors
    /// When the stored parameters do not fit the configuration.
    pub fn networks(&self, device: &Device) -> Result<ClothCombo, CheckpointError> {
        let unusable = |reason: String| CheckpointError::Unusable { path: self.folder.clone(), reason };
        let mut model = ClothCombo::new(&self.config.model, &self.state.dimensions(), device)
            .map_err(|e| unusable(e.to_string()))?;
        let mut store = SafetensorsStore::from_file(self.folder.join(MODEL_EXCHANGE));
        let applied = model.load_from(&mut store).map_err(|e| unusable(format!("{MODEL_EXCHANGE}: {e}")))?;
        match applied.errors.first() {
            Some(error) => Err(unusable(format!("{MODEL_EXCHANGE}: {error}"))),
            None => Ok(model),
        }
    }

    /// Checksum of the parameters: equal ones make equal embeddings.
    pub fn checksum(&self) -> &str {
        self.state.checksums.get(MODEL_EXCHANGE).map_or("", String::as_str)
    }
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
    /// Writes a checkpoint and makes it the newest one; keeps the `keep` newest.
    ///
    /// # Errors
    /// When something cannot be written; the previous newest checkpoint then stays the newest.
    pub fn save(
        run: &RunDir,
        config: &Config,
        mut state: CheckpointState,
        model: &ClothCombo,
        optimizer: &ModuleOptimizer,
        keep: usize,
    ) -> Result<Self, CheckpointError> {
        let name = format!("step-{:08}", state.step);
        let path = run.checkpoints().join(&name);
        let temporary = run.checkpoints().join(format!("{name}.tmp"));
        let failed = |reason: String| CheckpointError::Write { path: path.clone(), reason };
        let io_failed = |e: io::Error| failed(e.to_string());

        let _ = fs::remove_dir_all(&temporary); // a leftover of an interrupted save
        fs::create_dir_all(&temporary).map_err(io_failed)?;
        // A single entry: burn keeps metadata in a hash map, whose order would make equal models differ as files.
        let mut exchange = SafetensorsStore::from_file(temporary.join(MODEL_EXCHANGE))
            .clear_metadata()
            .metadata("clothcombo_step", state.step.to_string());
        model.save_into(&mut exchange).map_err(|e| failed(e.to_string()))?;
        model.clone().into_record().save(temporary.join(MODEL_EXACT)).map_err(|e| failed(e.to_string()))?;
        optimizer.save(temporary.join(OPTIMIZER)).map_err(|e| failed(e.to_string()))?;
        let text = to_toml(config).map_err(|e| failed(e.to_string()))?;
        fs::write(temporary.join(CONFIG), text).map_err(io_failed)?;
        for file in [MODEL_EXCHANGE, MODEL_EXACT, OPTIMIZER, CONFIG] {
            let sum = checksum(&temporary.join(file)).map_err(io_failed)?;
            state.checksums.insert(file.to_owned(), sum);
        }
        let text = serde_json::to_string_pretty(&state).map_err(|e| failed(e.to_string()))?;
        fs::write(temporary.join(STATE), text).map_err(io_failed)?;
        for file in [MODEL_EXCHANGE, MODEL_EXACT, OPTIMIZER, CONFIG, STATE] {
            File::open(temporary.join(file)).and_then(|f| f.sync_all()).map_err(io_failed)?;
        }
        if path.exists() {
            fs::remove_dir_all(&path).map_err(io_failed)?;
        }
        fs::rename(&temporary, &path).map_err(io_failed)?;
        File::open(run.checkpoints()).and_then(|d| d.sync_all()).map_err(io_failed)?;
        atomic::write(&run.checkpoints().join("latest"), name.as_bytes()).map_err(io_failed)?;
        prune(&run.checkpoints(), &name, keep).map_err(io_failed)?;
        Ok(Self { path, state })
    }

    /// Opens a checkpoint: a checkpoint folder, or the newest one of a run or checkpoints folder.
    ///
    /// # Errors
    /// When there is none, or it is damaged or of another version.
    pub fn open(path: &Path) -> Result<Self, CheckpointError> {
        let folder = Self::locate(path)?;
        let state = read_state(&folder, &[MODEL_EXCHANGE, MODEL_EXACT, OPTIMIZER, CONFIG])?;
        Ok(Self { path: folder, state })
    }

    /// The folder of one checkpoint: `path` itself, or the newest one of a run or checkpoints folder.
    fn locate(path: &Path) -> Result<PathBuf, CheckpointError> {
        [path.to_owned(), path.join("checkpoints")]
            .into_iter()
            .find_map(|f| match f.join(STATE).exists() {
                true => Some(f),
                false => {
                    let name = fs::read_to_string(f.join("latest")).ok()?;
                    let newest = f.join(name.trim());
                    newest.join(STATE).exists().then_some(newest)
                }
            })
            .ok_or_else(|| CheckpointError::Missing { path: path.to_owned() })
    }

    /// The configuration of the run it belongs to.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn config(&self) -> Result<Config, CheckpointError> {
        Ok(load(&self.path.join(CONFIG), &[])?)
    }

    /// The networks, on `device`.
    ///
    /// # Errors
    /// When the stored parameters do not fit the configuration.
    pub fn model(&self, config: &Config, device: &Device) -> Result<ClothCombo, CheckpointError> {
        let unusable = |reason: String| CheckpointError::Unusable { path: self.path.clone(), reason };
        let record = ModuleRecord::load(self.path.join(MODEL_EXACT)).map_err(|e| unusable(e.to_string()))?;
        ClothCombo::new(&config.model, &self.state.dimensions(), device)
            .map_err(|e| unusable(e.to_string()))?
            .try_load_record(record)
            .map_err(|e| unusable(e.to_string()))
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
}

impl CheckpointState {
    /// A state of the current format without checksums.
    pub fn new(step: u64, joints: Vec<String>, shape_count: usize, pose_features: usize) -> Self {
        Self { format: FORMAT, step, joints, shape_count, pose_features, checksums: BTreeMap::new() }
    }
}

/// A checkpoint's `state.json`, after comparing the checksums of `files`.
fn read_state(folder: &Path, files: &[&str]) -> Result<CheckpointState, CheckpointError> {
    let unusable = |reason: String| CheckpointError::Unusable { path: folder.to_owned(), reason };
    let text = fs::read_to_string(folder.join(STATE)).map_err(|e| unusable(e.to_string()))?;
    let version = serde_json::from_str::<serde_json::Value>(&text)
        .map_err(|e| unusable(format!("{STATE} is damaged: {e}")))?["format"]
        .as_u64();
    if version != Some(u64::from(FORMAT)) {
        let found = version.map_or("no version".to_owned(), |v| format!("version {v}"));
        return Err(unusable(format!("{STATE} has {found}, this program reads version {FORMAT}")));
    }
    let state: CheckpointState =
        serde_json::from_str(&text).map_err(|e| unusable(format!("{STATE} is damaged: {e}")))?;
    for file in files {
        let sum = checksum(&folder.join(file)).map_err(|e| unusable(format!("{file}: {e}")))?;
        if state.checksums.get(*file) != Some(&sum) {
            return Err(unusable(format!("{file} does not match its checksum")));
        }
    }
    Ok(state)
}

fn checksum(path: &Path) -> io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    io::copy(&mut File::open(path)?, &mut hasher)?;
    Ok(hasher.finalize().to_hex().to_string())
}

/// Removes all but the `keep` newest checkpoints, never `newest`.
fn prune(folder: &Path, newest: &str, keep: usize) -> io::Result<()> {
    let mut names: Vec<String> = fs::read_dir(folder)?
        .filter_map(|e| e.ok()?.file_name().into_string().ok())
        .filter(|n| n.starts_with("step-") && !n.ends_with(".tmp"))
        .collect();
    names.sort_unstable();
    for name in names.iter().rev().skip(keep).filter(|n| *n != newest) {
        fs::remove_dir_all(folder.join(name))?;
    }
    Ok(())
}
