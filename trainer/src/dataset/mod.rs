//! The data of a run. In: a configuration. Out: body, garments and poses ([`Dataset`]), samples of scenes as pure
//! functions of seed and step, and prepared scenes with their energies.

mod active_joints;
mod body;
mod contents;
mod data_check;
mod data_list;
mod error;
mod garment_source;
mod garment_store;
pub mod objective;
mod pose_features;
mod poses;
mod prepare;
mod prepared_garment;
mod preprocessor;
mod sampling;
pub(crate) mod sizes;
mod skinning;
mod split;

pub use active_joints::ActiveJoints;
pub use body::{load_body, read_body};
pub use contents::{Dataset, LicenceLine, SplitNames, is_fingerprint};
pub use data_check::{DataCheck, Fault, FileWarnings};
pub use data_list::{DataChange, DataList};
pub use error::DatasetError;
pub use garment_source::{GarmentLoader, GarmentSource};
pub use garment_store::{GarmentInfo, GarmentStore};
pub use poses::{ClipSplit, FrameCounts, HeldOut, PoseLibrary, SelfIntersecting, Window};
pub use prepare::{Arrangement, PreparedBody, PreparedScene, SceneBuilder, prepare};
pub use prepared_garment::PreparedGarment;
pub use preprocessor::Preprocessor;
pub use sampling::{
    BodySample, Plan, SceneSample, ValidationGroup, round_robin, sample_evaluation, sample_training,
    sample_validation,
};
pub use sizes::{DataSizes, tensor_bytes};
pub use skinning::skinning_transforms;
pub use split::{GarmentPurpose, GarmentSplit, purpose};

/// Steps whose scenes are prepared in advance.
pub const SCENES_AHEAD: usize = 4;

/// Garments of validation scenes prepared at a time: enough to keep every core busy, few enough to be in memory together.
pub const GARMENTS_AT_ONCE: usize = 16;
