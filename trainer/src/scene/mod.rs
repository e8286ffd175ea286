//! From a step number to everything the networks and the energies need: draw, prepare, hand over.

mod active_joints;
mod draw;
mod library;
mod poses;
mod prefetch;
mod prepare;

pub use active_joints::ActiveJoints;
pub use draw::{BodyDraw, Plan, SceneDraw, ValidationGroup, draw_training, draw_validation};
pub use library::{Library, LibraryError, LibraryGarment, load_body};
pub use poses::{PoseLibrary, SelfIntersecting, Unseen};
pub use prefetch::Prefetch;
pub use prepare::{PreparedBody, PreparedScene, prepare};
