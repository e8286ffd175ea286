//! The folder of a run: where everything lies, created whole or not at all.

use crate::config::{Config, load, to_toml};
use crate::dataset::SplitNames;
use crate::run::difference::{AllowedChanges, differences, differing_keys};
use crate::run::error::RunDirError;
use crate::run::lock::{LOCK_FILE, RunLock};
use crate::system::files::check_writable;
use crate::system::paths::obstacle;
use clothcombo_data::format::atomic::{self, Temporary};
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Paths inside `RUN/`, and the right to write there.
#[derive(Clone, Debug)]
pub struct RunDir {
    root: PathBuf,
    /// What may change when the run goes on.
    allowed: AllowedChanges,
    /// Held as long as any clone lives; a process that follows another holds none.
    _lock: Option<Arc<RunLock>>,
}

impl RunDir {
    /// Creates a new run folder with its `config.toml`.
    ///
    /// # Errors
    /// When the folder already holds a run, is in use or cannot be written; nothing that was made is left then.
    pub fn create(root: &Path, config: &Config) -> Result<Self, RunDirError> {
        // What was there stays, and so does a folder that another process uses by now.
        let made = (!root.exists()).then(|| Temporary::new(root.to_owned()));
        let created = Self::create_in(root, config);
        let is_others = matches!(created, Err(RunDirError::Occupied { .. } | RunDirError::InUse { .. }));
        if let (true, Some(made)) = (created.is_ok() || is_others, made) {
            made.keep();
        }
        created
    }

    fn create_in(root: &Path, config: &Config) -> Result<Self, RunDirError> {
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

    /// The folder of a run that somebody else makes or writes.
    pub fn follow(root: &Path) -> Self {
        Self { root: root.to_owned(), allowed: AllowedChanges::default(), _lock: None }
    }

    /// The folder of a run that another process resumes, which may change in the keys `allowed`.
    #[must_use]
    pub fn allowing(self, allowed: AllowedChanges) -> Self {
        Self { allowed, ..self }
    }

    /// Checks that a run could be made in `root`, and makes nothing.
    ///
    /// # Errors
    /// When one lives there, or the folder could not be made or written to.
    pub fn check_free(root: &Path) -> Result<(), RunDirError> {
        Self::refuse_occupied(root)?;
        if let Some(file) = obstacle(root) {
            return Err(RunDirError::Obstacle { path: root.to_owned(), file: file.to_owned() });
        }
        check_writable(root).map_err(|e| io_error(root, e))
    }

    /// Checks that nothing lives in `root`.
    ///
    /// # Errors
    /// When a run or something else does.
    fn refuse_occupied(root: &Path) -> Result<(), RunDirError> {
        if root.join(CONFIG_FILE).exists() {
            return Err(RunDirError::Occupied { path: root.to_owned() });
        }
        // What a start leaves that was killed before there was a configuration.
        let own = [LOCK_FILE, CHECKPOINTS_FOLDER, SAMPLES_FOLDER].map(OsStr::new);
        let entries = fs::read_dir(root).into_iter().flatten().flatten().map(|entry| entry.file_name());
        match entries.filter(|name| !own.contains(&name.as_os_str())).min() {
            Some(entry) => Err(RunDirError::Foreign { path: root.to_owned(), entry: entry.into() }),
            None => Ok(()),
        }
    }

    /// Opens an existing run to continue it with `config`, which may differ from the run's own in `allowed` keys (a section
    /// allows everything in it). The run's own stays as it is until [`adopt_config`](Self::adopt_config).
    ///
    /// # Errors
    /// When there is no run, another process trains in it, or its configuration differs elsewhere (the differing keys are
    /// named).
    pub fn resume(root: &Path, config: &Config, allowed: &[String]) -> Result<Self, RunDirError> {
        if !root.join(CONFIG_FILE).exists() {
            return Err(RunDirError::Missing { path: root.to_owned() });
        }
        let run = Self::locked(root)?;
        let own = load(&run.config(), &[])?;
        let allowed =
            AllowedChanges::new(allowed, &[&own, config]).map_err(|key| RunDirError::UnknownKey { key })?;
        let mut changes = differences(config, &own);
        changes.retain(|change| !allowed.covers(&change.key));
        if !changes.is_empty() {
            return Err(RunDirError::ConfigChanged { path: run.config(), changes });
        }
        Ok(run.allowing(allowed))
    }

    /// What may change while the run goes on.
    pub fn allowed(&self) -> &AllowedChanges {
        &self.allowed
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
        let lock = RunLock::acquire(root)?;
        let run = Self { _lock: Some(Arc::new(lock)), ..Self::follow(root) };
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
        self.root.join(CONFIG_FILE)
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
        self.root.join(SAMPLES_FOLDER)
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
    /// What was found out about the files of its data.
    pub fn data_check(&self) -> PathBuf {
        self.root.join("check.json")
    }
    /// Checkpoints.
    pub fn checkpoints(&self) -> PathBuf {
        self.root.join(CHECKPOINTS_FOLDER)
    }
}

/// Name of the configuration of a run, and of a checkpoint.
pub const CONFIG_FILE: &str = "config.toml";
const CHECKPOINTS_FOLDER: &str = "checkpoints";
const SAMPLES_FOLDER: &str = "samples";

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
    // Bytes: a kill may have cut a line within a letter.
    let log = match fs::read(path) {
        Ok(log) => log,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(e),
    };
    let kept = |line: &&[u8]| {
        serde_json::from_slice::<serde_json::Value>(line)
            .ok()
            .and_then(|v| v["step"].as_u64())
            .is_some_and(|s| s <= step && step > 0)
    };
    let lines = log.split(|byte| *byte == b'\n').filter(kept);
    atomic::write(path, &lines.flat_map(|line| [line, b"\n"]).collect::<Vec<_>>().concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::parse;

    #[test]
    fn a_folder_that_cannot_be_made_whole_leaves_nothing() {
        let place = tempfile::tempdir().unwrap();
        let root = place.path().join("a/b/run");
        // No file system has such a name; the folders around it are made before that is found out.
        let unwritable = root.join("r".repeat(300));
        assert!(matches!(RunDir::create(&unwritable, &config(&[])), Err(RunDirError::Io { .. })));
        assert!(!place.path().join("a").exists());
        fs::create_dir_all(&root).unwrap();
        fs::write(root.join("note"), "mine").unwrap();
        assert!(RunDir::create(&unwritable, &config(&[])).is_err());
        assert!(root.join("note").exists());
        let file = root.join("note/run");
        assert!(matches!(RunDir::check_free(&file), Err(RunDirError::Obstacle { .. })));
        RunDir::check_free(&place.path().join("new/run")).unwrap();
        assert!(!place.path().join("new").exists());
    }

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
            RunDirError::ConfigChanged { changes, .. } => {
                let changes: Vec<_> = changes.iter().map(|change| change.text("new", "old")).collect();
                assert_eq!(changes, ["losses.strain.weight: 2.0 in new, 1.0 in old"]);
            }
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
    fn a_log_that_was_cut_within_a_letter_is_truncated() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("metrics.jsonl");
        let cut = "{\"step\":3,\"name\":\"é".as_bytes();
        let whole = b"{\"step\":1}\n{\"step\":2}\n";
        fs::write(&log, [whole, &cut[..cut.len() - 1]].concat()).unwrap();
        truncate_log(&log, 3).unwrap();
        assert_eq!(fs::read(&log).unwrap(), whole);
        truncate_log(&log, 1).unwrap();
        assert_eq!(fs::read(&log).unwrap(), b"{\"step\":1}\n");
        truncate_log(&log, 0).unwrap();
        assert!(fs::read(&log).unwrap().is_empty());
        truncate_log(&folder.path().join("none"), 1).unwrap();
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
