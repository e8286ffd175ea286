//! Why a run folder cannot be used.

use crate::config::ConfigError;
use crate::run::difference::{Difference, listed};
use miette::Diagnostic;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Why a run folder cannot be used.
#[derive(Debug, Error, Diagnostic)]
pub enum RunDirError {
    /// Something that is no folder is in the way.
    #[error("{} cannot be a run folder: {} is a file, not a folder", path.display(), file.display())]
    #[diagnostic(help("choose another folder with --run-dir"))]
    Obstacle {
        /// The folder.
        path: PathBuf,
        /// The file.
        file: PathBuf,
    },
    /// The folder already holds a run.
    #[error("{} already holds a run", path.display())]
    #[diagnostic(help("continue it with --resume, or choose another folder with --run-dir"))]
    Occupied {
        /// The folder.
        path: PathBuf,
    },
    /// The folder holds other things.
    #[error("{} is no run folder and not empty: it holds {}", path.display(), entry.display())]
    #[diagnostic(help("choose a new folder with --run-dir"))]
    Foreign {
        /// The folder.
        path: PathBuf,
        /// Something in it.
        entry: PathBuf,
    },
    /// There is nothing to resume.
    #[error("{} holds no run to resume", path.display())]
    #[diagnostic(help("start one without --resume"))]
    Missing {
        /// The folder.
        path: PathBuf,
    },
    /// The configuration differs from the one the run was started with.
    #[error(
        "the configuration differs from the run's own, {}:{}",
        path.display(), listed(changes.iter().map(|change| change.text("the configuration", "the run")))
    )]
    #[diagnostic(help(
        "resume without --config and --set, allow the change with --allow-config-change {}, or start a new run",
        changes.iter().map(|change| change.key.as_str()).collect::<Vec<_>>().join(",")
    ))]
    ConfigChanged {
        /// The run's configuration.
        path: PathBuf,
        /// What differs.
        changes: Vec<Difference>,
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
