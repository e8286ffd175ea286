//! The configuration. In: a TOML file and overrides. Out: a checked [`Config`], every key of which is documented here with unit,
//! default and reason, or an error that names file, line and key.
//!
//! Unknown keys are errors. Every value used is written back to `RUN/config.toml`.

mod data;
mod error;
mod guard;
mod load;
mod losses;
mod optimizer;
mod output;
mod paths;
mod ramp;
mod reworded;
mod run;
mod schema;
mod sources;
mod stages;
mod validation;

pub use data::{
    CacheConfig, DataConfig, GarmentSourceConfig, GenerateConfig, MOST_GENERATED_GARMENTS, PoseBankConfig,
    PoseConfig, PoseEncoding, SplitConfig, StartConfig,
};
pub use error::ConfigError;
pub use guard::{GuardConfig, InjectConfig, Injected};
pub use load::{load, parse, to_toml};
pub use losses::{DistanceMode, LossesConfig};
pub use optimizer::{ClipScope, OptimizerConfig};
pub use output::OutputConfig;
pub use paths::MissingInput;
pub use ramp::{Ramp, RampShape};
pub use run::Config;
pub use schema::schema;
pub use stages::{StageConfig, Trains, stage_starts};
pub use validation::ValidationConfig;
