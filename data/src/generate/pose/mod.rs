//! Random poses: sampled within the limits of human joints, or varied from recorded ones.

mod augmentation;
mod limits;
mod sampler;

pub use augmentation::PoseAugmentation;
pub use limits::{JOINT_LIMITS, JointLimits, is_within_limits, limited};
pub use sampler::PoseSampler;
