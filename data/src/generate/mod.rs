//! Data without downloads: a mannequin, garments for any body, and poses within the limits of human joints.

mod field;
pub mod garment;
pub mod mannequin;
mod parts;
pub mod pose;

pub use garment::{GarmentError, GarmentGenerator};
pub use mannequin::mannequin;
pub use pose::{
    LimbDensity, POSE_NAMES, PoseAugmentation, PoseSampler, SelfContact, named_pose, uniform_pose,
};
