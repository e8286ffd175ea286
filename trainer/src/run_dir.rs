//! The folder of a run: where everything lies, created whole or not at all.

use crate::config::{Config, ConfigError, load, to_toml};
use crate::scene::SplitNames;
use clothcombo_data::format::atomic;
use miette::Diagnostic;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a run folder cannot be used.
#[derive(Debug, Error, Diagnostic)]
pub enum RunDirError {
    /// The folder already holds a run.
    #[error("{} already holds a run", path.display())]
    #[diagnostic(help("continue it with --resume, or choose another folder with --run-dir"))]
    Occupied {
        /// The folder.
        path: PathBuf,
    },
    /// There is nothing to resume.
    #[error("{} holds no run to resume", path.display())]
    #[diagnostic(help("start one without --resume"))]
    Missing {
        /// The folder.
        path: PathBuf,
    },
    /// The configuration differs from the one the run was started with.
    #[error("the configuration differs from the run's own in: {}", keys.join(", "))]
    #[diagnostic(help("resume with the configuration the run was started with ({}), or start a new run", path.display()))]
    ConfigChanged {
        /// The run's configuration.
        path: PathBuf,
        /// The differing keys.
        keys: Vec<String>,
    },
    /// The run's own configuration cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Config(#[from] ConfigError),
    /// The file system refused.
    #[error("cannot write {}: {reason}", path.display())]
    #[diagnostic(help("check that the folder is writable and the disk is not full"))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        reason: io::Error,
    },
}

/// Paths inside `RUN/`.
#[derive(Clone, Debug)]
pub struct RunDir {
    root: PathBuf,
}

impl RunDir {
    /// Creates a new run folder with its `config.toml`.
    ///
    /// # Errors
    /// When the folder already holds a run or cannot be written.
    pub fn create(root: &Path, config: &Config) -> Result<Self, RunDirError> {
        Self::refuse_occupied(root)?;
        let run = Self { root: root.to_owned() };
        for folder in [run.checkpoints(), run.samples()] {
            fs::create_dir_all(&folder).map_err(|reason| RunDirError::Io { path: folder, reason })?;
        }
        let text = to_toml(config).map_err(|e| io_error(&run.config(), io::Error::other(e)))?;
        atomic::write(&run.config(), text.as_bytes()).map_err(|e| io_error(&run.config(), e))?;
        Ok(run)
    }

    /// Checks that no run lives in `root`.
    ///
    /// # Errors
    /// When one does.
    pub fn refuse_occupied(root: &Path) -> Result<(), RunDirError> {
        let run = Self { root: root.to_owned() };
        if run.config().exists() {
            return Err(RunDirError::Occupied { path: root.to_owned() });
        }
        Ok(())
    }

    /// Opens an existing run to continue it with `config`.
    ///
    /// # Errors
    /// When there is no run, or its configuration differs (the differing keys are named).
    pub fn resume(root: &Path, config: &Config) -> Result<Self, RunDirError> {
        let run = Self { root: root.to_owned() };
        if !run.config().exists() {
            return Err(RunDirError::Missing { path: root.to_owned() });
        }
        let own = load(&run.config(), &[])?;
        let keys = differing_keys(&own, config);
        if !keys.is_empty() {
            return Err(RunDirError::ConfigChanged { path: run.config(), keys });
        }
        Ok(run)
    }

    /// Writes which garments and clips are for what.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_split(&self, split: &SplitNames) -> Result<(), RunDirError> {
        let path = self.root.join("split.json");
        let text = serde_json::to_vec_pretty(split).map_err(|e| io_error(&path, e.into()))?;
        atomic::write(&path, &text).map_err(|e| io_error(&path, e))
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }
    /// Every value that was used.
    pub fn config(&self) -> PathBuf {
        self.root.join("config.toml")
    }
    /// One JSON object per step.
    pub fn metrics(&self) -> PathBuf {
        self.root.join("metrics.jsonl")
    }
    /// One JSON object per validation.
    pub fn validation(&self) -> PathBuf {
        self.root.join("validation.jsonl")
    }
    /// Loss curves.
    pub fn curves(&self) -> PathBuf {
        self.root.join("curves.png")
    }
    /// Sample pictures.
    pub fn samples(&self) -> PathBuf {
        self.root.join("samples")
    }
    /// The sample picture after `step`.
    pub fn sample(&self, step: u64) -> PathBuf {
        self.samples().join(format!("step-{step:08}.png"))
    }
    /// Checkpoints.
    pub fn checkpoints(&self) -> PathBuf {
        self.root.join("checkpoints")
    }
}

fn io_error(path: &Path, reason: io::Error) -> RunDirError {
    RunDirError::Io { path: path.to_owned(), reason }
}

/// Keeps the lines of a JSON-lines file whose `"step"` is at most `step`: what was logged after the checkpoint that a
/// run continues from will be logged again.
///
/// # Errors
/// The file system's.
pub fn truncate_log(path: &Path, step: u64) -> io::Result<()> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(e),
    };
    let kept = |line: &&str| {
        serde_json::from_str::<serde_json::Value>(line)
            .ok()
            .and_then(|v| v["step"].as_u64())
            .is_some_and(|s| s <= step)
    };
    let mut out: String = text.lines().filter(kept).flat_map(|l| [l, "\n"]).collect();
    out.shrink_to_fit();
    atomic::write(path, out.as_bytes())
}

/// Keys whose values differ, as dotted paths. What only concerns output may change between sessions.
fn differing_keys(a: &Config, b: &Config) -> Vec<String> {
    fn walk(path: &str, a: Option<&toml::Value>, b: Option<&toml::Value>, out: &mut Vec<String>) {
        match (a, b) {
            (Some(toml::Value::Table(a)), Some(toml::Value::Table(b))) => {
                let names: std::collections::BTreeSet<_> = a.keys().chain(b.keys()).collect();
                for name in names {
                    let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                    walk(&path, a.get(name), b.get(name), out);
                }
            }
            (Some(toml::Value::Array(a)), Some(toml::Value::Array(b))) if a.len() == b.len() => {
                for (i, (a, b)) in a.iter().zip(b).enumerate() {
                    walk(&format!("{path}[{i}]"), Some(a), Some(b), out);
                }
            }
            (a, b) if a == b => {}
            _ => out.push(path.to_owned()),
        }
    }
    let value = |c: &Config| {
        let mut c = c.clone();
        c.output = crate::config::OutputConfig::default();
        // Where things are kept changes no result.
        c.data.cache = crate::config::CacheConfig::default();
        c.data.memory_mib = 1;
        toml::Value::try_from(c).ok()
    };
    let mut out = Vec::new();
    walk("", value(a).as_ref(), value(b).as_ref(), &mut out);
    out
}
