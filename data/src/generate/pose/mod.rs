//! Random poses: sampled within the limits of human joints, or varied from recorded ones.

mod augmentation;
mod folded;
mod limb_density;
mod limits;
mod sampler;
mod self_contact;

pub use augmentation::PoseAugmentation;
pub use folded::folded_poses;
pub use limb_density::{LimbDensity, uniform_pose};
pub use limits::{JOINT_LIMITS, JointLimits, is_within_limits, limited};
pub use sampler::PoseSampler;
pub use self_contact::SelfContact;
