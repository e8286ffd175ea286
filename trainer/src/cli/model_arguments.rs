//! Flags of every bench that measures a configuration, with or without a trained model.

use crate::config::{Config, ConfigError, load};
use crate::run::checkpoint::{CheckpointError, TrainedModel};
use clap::Args;
use std::path::{Path, PathBuf};

/// A configuration, and the model that drapes its scenes.
#[derive(Args)]
pub struct ModelArguments {
    /// Configuration (TOML); default: that of the checkpoint, else configs/open.toml
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Overrides one value of the configuration, for example losses.body_collision.epsilon=0.004; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
    /// Run, checkpoint or folder of a trained model (models/default); default: LBS + shape transfer
    #[arg(long, value_name = "DIR")]
    checkpoint: Option<PathBuf>,
}

impl ModelArguments {
    /// Opens the model.
    ///
    /// # Errors
    /// When the checkpoint cannot be used.
    pub fn open(&self) -> Result<Option<TrainedModel>, CheckpointError> {
        self.checkpoint.as_deref().map(TrainedModel::open).transpose()
    }

    /// Reads the configuration, `trained` being the opened model.
    ///
    /// # Errors
    /// Names the file or key at fault.
    pub fn config(&self, trained: Option<&TrainedModel>) -> Result<Config, ConfigError> {
        match (&self.config, trained) {
            (Some(file), _) => load(file, &self.overrides),
            (None, Some(trained)) => trained.config_with(&self.overrides),
            (None, None) => load(&Path::new("configs").join("open.toml"), &self.overrides),
        }
    }
}
