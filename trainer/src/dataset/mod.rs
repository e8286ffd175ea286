//! From a step number to everything the networks and the energies need: draw, prepare, hand over.

mod active_joints;
mod draw;
mod error;
mod garment;
mod library;
pub mod objective;
mod origin;
mod pose_features;
mod poses;
mod prepare;
mod recipe;
pub(crate) mod sizes;
mod skinning;
mod split;
mod wardrobe;

pub use active_joints::ActiveJoints;
pub use draw::{
    BodyDraw, Plan, SceneDraw, ValidationGroup, draw_outfit, draw_study, draw_training, draw_validation,
    in_turn,
};
pub use error::LibraryError;
pub use garment::LibraryGarment;
pub use library::{Library, LicenceLine, is_fingerprint, load_body};
pub use origin::{Maker, Origin};
pub use poses::{ClipSplit, FrameCounts, HeldOut, PoseLibrary, SelfIntersecting, Window};
pub use prepare::{Dresser, PreparedBody, PreparedScene, contacts, prepare};
pub use recipe::Recipe;
pub use sizes::{DataSizes, tensor_bytes};
pub use skinning::skinning_transforms;
pub use split::{GarmentPurpose, GarmentSplit, SplitNames, purpose};
pub use wardrobe::{Card, Wardrobe};

/// Steps whose scenes are prepared in advance.
pub const SCENES_AHEAD: usize = 4;

/// Garments of validation scenes prepared at a time: enough to keep every core busy, few enough to be in memory together.
pub const GARMENTS_AT_ONCE: usize = 16;
