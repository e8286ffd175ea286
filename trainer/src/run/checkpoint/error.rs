//! Why a checkpoint cannot be written or read.

use crate::config::ConfigError;
use miette::Diagnostic;
use std::path::PathBuf;
use thiserror::Error;

/// Why a checkpoint cannot be written or read.
#[derive(Debug, Error, Diagnostic)]
pub enum CheckpointError {
    /// The file system refused.
    #[error("cannot write the checkpoint {}: {reason}", path.display())]
    #[diagnostic(help("earlier checkpoints are untouched; check free space and permissions, then --resume"))]
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
    /// The model was made for something else.
    #[error("model {}: {reason}", path.display())]
    #[diagnostic(help(
        "use the configuration and the data that the model was trained with, or train another one"
    ))]
    Foreign {
        /// The model.
        path: PathBuf,
        /// What differs.
        reason: String,
    },
    /// The configuration inside cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Config(#[from] ConfigError),
}
