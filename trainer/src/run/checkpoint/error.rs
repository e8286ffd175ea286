//! Why a checkpoint cannot be written or read.

use super::retention;
use crate::config::ConfigError;
use crate::run::difference::{Difference, listed};
use miette::Diagnostic;
use std::path::{Path, PathBuf};
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
    #[diagnostic(help("{}", remedy(path)))]
    Unusable {
        /// The checkpoint.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// None of several checkpoints can be used.
    #[error("none of the {count} checkpoints in {} can be used; the newest: {reason}", path.display())]
    #[diagnostic(help("start a new run, from a model with init_from or from nothing"))]
    AllUnusable {
        /// Where they lie.
        path: PathBuf,
        /// How many there are.
        count: usize,
        /// What is wrong with the newest.
        reason: Box<CheckpointError>,
    },
    /// The checkpoint has other networks.
    #[error(
        "the networks are not those of checkpoint {}:{}",
        path.display(), listed(changes.iter().map(|change| change.text("the configuration", "the checkpoint")))
    )]
    #[diagnostic(help("networks keep their sizes: take the changes of [model] back, or start a new run"))]
    OtherNetworks {
        /// The checkpoint.
        path: PathBuf,
        /// What differs.
        changes: Vec<Difference>,
    },
    /// There is no model to start from.
    #[error("init_from: there is no model in {}", path.display())]
    #[diagnostic(help(
        "init_from names a run, a checkpoint, or a folder with model.safetensors, config.toml and state.json"
    ))]
    NoStart {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// A run cannot start from this model.
    #[error(
        "init_from: the networks are not those of model {}:{}",
        path.display(), listed(changes.iter().map(|change| change.text("the configuration", "the model")))
    )]
    #[diagnostic(help(
        "a run that starts from a model has its networks: give [model] its values, or leave init_from out"
    ))]
    OtherStart {
        /// The model.
        path: PathBuf,
        /// What differs.
        changes: Vec<Difference>,
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

/// What to do about an unusable checkpoint at `path`: an older one of the run is only of use where there is one.
fn remedy(path: &Path) -> String {
    let step = path.file_name().and_then(|name| retention::step_of(&name.to_string_lossy()));
    let beside = path.parent().map(retention::list).unwrap_or_default();
    match beside.into_iter().rev().find(|(other, _)| step.is_some_and(|step| *other < step)) {
        Some((_, older)) => format!("an older checkpoint of the run is {}", older.display()),
        None => "damaged checkpoints are never loaded, and there is no older one beside it".into(),
    }
}
