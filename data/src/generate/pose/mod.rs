//! Poses: sampled within the limits of human joints, varied from recorded ones, or known by a name.

mod augmentation;
mod figure;
mod folded;
mod limb_density;
mod limits;
mod named;
mod sampler;
mod self_contact;

pub use augmentation::PoseAugmentation;
pub(crate) use folded::bent_on_both_sides;
pub use folded::folded_poses;
pub use limb_density::{LimbDensity, uniform_pose};
#[cfg(test)]
pub(crate) use limits::is_within_limits;
pub use limits::{JOINT_LIMITS, JointLimits, limited};
pub use named::{POSE_NAMES, named_pose};
pub use sampler::PoseSampler;
pub use self_contact::SelfContact;
