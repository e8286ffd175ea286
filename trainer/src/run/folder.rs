//! The folder of a run: where everything lies, created whole or not at all.

use crate::config::{Config, ConfigError, load, to_toml};
use crate::dataset::SplitNames;
use crate::run::lock::{LockError, RunLock};
use clothcombo_data::format::atomic;
use miette::Diagnostic;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
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
    #[diagnostic(help(
        "resume with the configuration the run was started with ({}), allow the change with --allow-config-change {}, or \
            start a new run",
        path.display(), keys.join(",")
    ))]
    ConfigChanged {
        /// The run's configuration.
        path: PathBuf,
        /// The differing keys.
        keys: Vec<String>,
    },
    /// Another process trains in the folder.
    #[error("{} is in use: {owner} trains in it", path.display())]
    #[diagnostic(help("wait for it or stop it, or choose another folder with --run-dir"))]
    InUse {
        /// The folder.
        path: PathBuf,
        /// Who holds it.
        owner: String,
    },
    /// A key that may change is none that differs.
    #[error("--allow-config-change names {key:?}, which is no key of the configuration")]
    #[diagnostic(help(
        "keys look like stages, optimizer.clip_norm or stages[0].steps; a section allows all in it"
    ))]
    UnknownKey {
        /// The key as given.
        key: String,
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

/// Paths inside `RUN/`, and the right to write there.
#[derive(Clone, Debug)]
pub struct RunDir {
    root: PathBuf,
    /// Held as long as any clone lives; a process that follows another holds none.
    _lock: Option<Arc<RunLock>>,
}

impl RunDir {
    /// Creates a new run folder with its `config.toml`.
    ///
    /// # Errors
    /// When the folder already holds a run, is in use or cannot be written.
    pub fn create(root: &Path, config: &Config) -> Result<Self, RunDirError> {
        Self::refuse_occupied(root)?;
        fs::create_dir_all(root).map_err(|e| io_error(root, e))?;
        let run = Self::locked(root)?;
        // Another process may have been faster between the first look and the lock.
        Self::refuse_occupied(root)?;
        for folder in [run.checkpoints(), run.samples()] {
            fs::create_dir_all(&folder).map_err(|reason| RunDirError::Io { path: folder, reason })?;
        }
        run.write_config(config)?;
        Ok(run)
    }

    /// The folder of a run that another process of the same run writes.
    pub fn follow(root: &Path) -> Self {
        Self { root: root.to_owned(), _lock: None }
    }

    /// Checks that no run lives in `root`.
    ///
    /// # Errors
    /// When one does.
    pub fn refuse_occupied(root: &Path) -> Result<(), RunDirError> {
        match root.join(CONFIG).exists() {
            true => Err(RunDirError::Occupied { path: root.to_owned() }),
            false => Ok(()),
        }
    }

    /// Opens an existing run to continue it with `config`, which may differ from the run's own in `allowed` keys (a section
    /// allows everything in it). The run's own stays as it is until [`adopt_config`](Self::adopt_config).
    ///
    /// # Errors
    /// When there is no run, another process trains in it, or its configuration differs elsewhere (the differing keys are
    /// named).
    pub fn resume(root: &Path, config: &Config, allowed: &[String]) -> Result<Self, RunDirError> {
        if !root.join(CONFIG).exists() {
            return Err(RunDirError::Missing { path: root.to_owned() });
        }
        let run = Self::locked(root)?;
        let own = load(&run.config(), &[])?;
        if let Some(key) = allowed.iter().find(|key| !is_known(key, &[&own, config])) {
            return Err(RunDirError::UnknownKey { key: key.clone() });
        }
        let is_allowed = |key: &String| allowed.iter().any(|a| covers(a, key));
        let keys: Vec<String> = differing_keys(&own, config).into_iter().filter(|k| !is_allowed(k)).collect();
        if !keys.is_empty() {
            return Err(RunDirError::ConfigChanged { path: run.config(), keys });
        }
        Ok(run)
    }

    /// Makes `config` the run's own. Returns the keys that change; if there are any that matter, the configuration before is
    /// kept beside it as `config.before-N.toml`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn adopt_config(&self, config: &Config) -> Result<Vec<String>, RunDirError> {
        let keys = differing_keys(&load(&self.config(), &[])?, config);
        if !keys.is_empty() {
            let kept = (1..)
                .map(|n| self.root.join(format!("config.before-{n}.toml")))
                .find(|path| !path.exists())
                .expect("there are more numbers than files");
            fs::copy(self.config(), &kept).map_err(|e| io_error(&kept, e))?;
        }
        self.write_config(config)?;
        Ok(keys)
    }

    fn locked(root: &Path) -> Result<Self, RunDirError> {
        let lock = RunLock::acquire(root).map_err(|error| match error {
            LockError::Held { owner } => RunDirError::InUse { path: root.to_owned(), owner },
            LockError::Io { path, reason } => RunDirError::Io { path, reason },
        })?;
        let run = Self { root: root.to_owned(), _lock: Some(Arc::new(lock)) };
        [run.root.clone(), run.checkpoints(), run.samples(), run.incidents()].iter().for_each(|f| sweep(f));
        Ok(run)
    }

    fn write_config(&self, config: &Config) -> Result<(), RunDirError> {
        let text = to_toml(config).map_err(|e| io_error(&self.config(), io::Error::other(e)))?;
        atomic::write(&self.config(), text.as_bytes()).map_err(|e| io_error(&self.config(), e))
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
        self.root.join(CONFIG)
    }
    /// One JSON object per step.
    pub fn metrics(&self) -> PathBuf {
        self.root.join("metrics.jsonl")
    }
    /// One JSON object per validation.
    pub fn validation(&self) -> PathBuf {
        self.root.join("validation.jsonl")
    }
    /// What happened besides the steps: stages, spikes of the gradient, skipped steps, checkpoints.
    pub fn log(&self) -> PathBuf {
        self.root.join("log.txt")
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
    /// One self-contained page about the run.
    pub fn report(&self) -> PathBuf {
        self.root.join("report.html")
    }
    /// TensorBoard event files.
    pub fn tensorboard(&self) -> PathBuf {
        self.root.join("tensorboard")
    }
    /// Steps whose loss or gradient was not finite.
    pub fn incidents(&self) -> PathBuf {
        self.root.join("incidents")
    }
    /// Checkpoints.
    pub fn checkpoints(&self) -> PathBuf {
        self.root.join("checkpoints")
    }
}

/// Name of the run's configuration.
const CONFIG: &str = "config.toml";

/// Removes files of `folder` that a killed process had not finished writing; nobody else writes there now.
fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let is_file = entry.file_type().is_ok_and(|t| t.is_file());
        if is_file && entry.file_name().to_string_lossy().ends_with(".tmp") {
            // A leftover costs space and nothing else.
            let _ = fs::remove_file(entry.path());
        }
    }
}

fn io_error(path: &Path, reason: io::Error) -> RunDirError {
    RunDirError::Io { path: path.to_owned(), reason }
}

/// Keeps the lines of a JSON-lines file whose `"step"` is at most `step`: what was logged after the checkpoint that a
/// run continues from will be logged again, and so will everything where it starts anew at step 0.
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
            .is_some_and(|s| s <= step && step > 0)
    };
    let mut out: String = text.lines().filter(kept).flat_map(|l| [l, "\n"]).collect();
    out.shrink_to_fit();
    atomic::write(path, out.as_bytes())
}

/// Whether the allowance `allowed` covers `key`: the key itself, or a section it lies in.
fn covers(allowed: &str, key: &str) -> bool {
    key.strip_prefix(allowed).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// Whether `key` names a value or section of one of `configs`.
fn is_known(key: &str, configs: &[&Config]) -> bool {
    configs.iter().any(|config| {
        let tree = toml::Value::try_from(*config).ok();
        let mut node = tree.as_ref();
        for part in key.split(['.', '[']) {
            node = match (node, part.strip_suffix(']')) {
                (Some(node), Some(index)) => index.parse::<usize>().ok().and_then(|i| node.get(i)),
                (Some(node), None) => node.get(part),
                (None, _) => None,
            };
        }
        node.is_some()
    })
}

/// Keys whose values differ, as dotted paths. What only concerns output may change between sessions.
pub(crate) fn differing_keys(a: &Config, b: &Config) -> Vec<String> {
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
        // Where things are kept and when a run gives up changes no result.
        c.guard = crate::config::GuardConfig { inject: c.guard.inject, ..Default::default() };
        c.data.cache = crate::config::CacheConfig::default();
        (c.data.memory_mib, c.data.device_memory_mib) = (1, 1);
        toml::Value::try_from(c).ok()
    };
    let mut out = Vec::new();
    walk("", value(a).as_ref(), value(b).as_ref(), &mut out);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::parse;

    const SMALL: &str = "seed = 1\n[data]\n[[data.garments]]\ngenerate = { count = 2 }\n[[stages]]\nname = \"single\"\n\
        trains = \"single\"\nsteps = 10\n";

    fn config(overrides: &[&str]) -> Config {
        let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_owned()).collect();
        parse(SMALL, Path::new("small.toml"), &overrides).unwrap()
    }

    #[test]
    fn a_changed_configuration_is_refused_by_key_unless_allowed() {
        let folder = tempfile::tempdir().unwrap();
        drop(RunDir::create(folder.path(), &config(&[])).unwrap());
        let changed = config(&["stages.0.steps=20", "losses.strain.weight=2.0", "output.keep_checkpoints=9"]);
        let resume = |allowed: &[&str]| {
            let allowed: Vec<String> = allowed.iter().map(|a| (*a).to_owned()).collect();
            RunDir::resume(folder.path(), &changed, &allowed)
        };
        match resume(&["stages[0].steps"]).unwrap_err() {
            RunDirError::ConfigChanged { keys, .. } => assert_eq!(keys, ["losses.strain.weight"]),
            other => panic!("{other}"),
        }
        assert!(matches!(resume(&["stagse"]).unwrap_err(), RunDirError::UnknownKey { .. }));
        let run = resume(&["stages", "losses.strain"]).unwrap();
        assert_eq!(load(&run.config(), &[]).unwrap().stages[0].steps, 10, "not before it is adopted");
        assert_eq!(run.adopt_config(&changed).unwrap(), ["losses.strain.weight", "stages[0].steps"]);
        assert_eq!(load(&run.config(), &[]).unwrap().stages[0].steps, 20);
        assert_eq!(load(&folder.path().join("config.before-1.toml"), &[]).unwrap().stages[0].steps, 10);
        assert!(run.adopt_config(&changed).unwrap().is_empty());
        // What changes no result is taken over without further ado.
        let changed = Config { output: config(&["output.keep_checkpoints=4"]).output, ..changed };
        assert!(run.adopt_config(&changed).unwrap().is_empty());
        assert_eq!(load(&run.config(), &[]).unwrap().output.keep_checkpoints, 4);
        assert!(!folder.path().join("config.before-2.toml").exists());
    }

    #[test]
    fn one_folder_has_one_run() {
        let folder = tempfile::tempdir().unwrap();
        let first = RunDir::create(folder.path(), &config(&[])).unwrap();
        let second = RunDir::resume(folder.path(), &config(&[]), &[]).unwrap_err();
        let owner = format!("process {}", std::process::id());
        assert!(second.to_string().contains(&owner), "{second}");
        let clone = first.clone();
        drop(first);
        assert!(RunDir::resume(folder.path(), &config(&[]), &[]).is_err());
        drop(clone);
        RunDir::resume(folder.path(), &config(&[]), &[]).unwrap();
    }
}
