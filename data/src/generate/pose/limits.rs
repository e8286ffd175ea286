//! Ranges of motion of the 22 body joints.
//!
//! The table bounds each component of a joint's axis-angle vector, relative to the T-pose; it is written for the middle
//! and the left side, the right side is its mirror image (the y and z components change sign). Magnitudes follow
//! clinical ranges of motion (American Academy of Orthopaedic Surgeons, "Joint Motion", 1965), rounded, and kept a
//! little inside where the skin of a linear-blend body would fold into itself.

use crate::asset::{BODY_JOINT_COUNT, Pose};

/// Lower and upper bound of each axis-angle component in degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Lower bounds of x, y, z.
    pub low: [f64; 3],
    /// Upper bounds of x, y, z.
    pub high: [f64; 3],
}

const fn limits(x: [f64; 2], y: [f64; 2], z: [f64; 2]) -> JointLimits {
    JointLimits { low: [x[0], y[0], z[0]], high: [x[1], y[1], z[1]] }
}

/// The mirror image of the limits of the left joint.
const fn mirrored(l: JointLimits) -> JointLimits {
    JointLimits { low: [l.low[0], -l.high[1], -l.high[2]], high: [l.high[0], -l.low[1], -l.low[2]] }
}

// x: flexion is negative (thigh forward); y: turn; z: abduction is positive on the left.
const HIP_LIMITS: JointLimits = limits([-115.0, 25.0], [-35.0, 40.0], [-12.0, 40.0]);
// x: flexion, in one direction only.
const KNEE_LIMITS: JointLimits = limits([0.0, 135.0], [-8.0, 8.0], [-5.0, 5.0]);
// x: toes down is positive.
const ANKLE_LIMITS: JointLimits = limits([-20.0, 40.0], [-15.0, 15.0], [-15.0, 15.0]);
const FOOT_LIMITS: JointLimits = limits([-35.0, 15.0], [-5.0, 5.0], [-5.0, 5.0]);
// x: bending forward is positive; three spine joints share the trunk's motion.
const SPINE_LIMITS: JointLimits = limits([-12.0, 28.0], [-16.0, 16.0], [-13.0, 13.0]);
const NECK_LIMITS: JointLimits = limits([-22.0, 28.0], [-35.0, 35.0], [-20.0, 20.0]);
// z: shrugging is positive on the left; y: pulling the shoulder forward is negative.
const COLLAR_LIMITS: JointLimits = limits([-8.0, 8.0], [-18.0, 12.0], [-8.0, 22.0]);
// z: the arm hangs at about −75 and points up at about 80; y: across the chest is negative; x: twist.
const SHOULDER_LIMITS: JointLimits = limits([-75.0, 75.0], [-105.0, 45.0], [-88.0, 80.0]);
// y: flexion is negative on the left, in one direction only; x: turning the forearm.
const ELBOW_LIMITS: JointLimits = limits([-70.0, 60.0], [-140.0, 0.0], [-6.0, 6.0]);
const WRIST_LIMITS: JointLimits = limits([-15.0, 15.0], [-25.0, 20.0], [-60.0, 60.0]);

/// Limits of every body joint, in SMPL order. The pelvis may turn to any heading.
pub const JOINT_LIMITS: [JointLimits; BODY_JOINT_COUNT] = [
    limits([-30.0, 45.0], [-180.0, 180.0], [-20.0, 20.0]),
    HIP_LIMITS,
    mirrored(HIP_LIMITS),
    SPINE_LIMITS,
    KNEE_LIMITS,
    mirrored(KNEE_LIMITS),
    SPINE_LIMITS,
    ANKLE_LIMITS,
    mirrored(ANKLE_LIMITS),
    SPINE_LIMITS,
    FOOT_LIMITS,
    mirrored(FOOT_LIMITS),
    NECK_LIMITS,
    COLLAR_LIMITS,
    mirrored(COLLAR_LIMITS),
    NECK_LIMITS,
    SHOULDER_LIMITS,
    mirrored(SHOULDER_LIMITS),
    ELBOW_LIMITS,
    mirrored(ELBOW_LIMITS),
    WRIST_LIMITS,
    mirrored(WRIST_LIMITS),
];

/// The pose with every component of the body joints clamped to [`JOINT_LIMITS`]; further joints are left alone.
pub fn limited(mut pose: Pose) -> Pose {
    for (rotation, limits) in pose.rotations.iter_mut().zip(&JOINT_LIMITS) {
        for axis in 0..3 {
            rotation[axis] =
                rotation[axis].clamp(limits.low[axis].to_radians(), limits.high[axis].to_radians());
        }
    }
    pose
}

/// Whether every body joint is within [`JOINT_LIMITS`], to a millionth of a radian.
#[cfg(test)]
pub(crate) fn is_within_limits(pose: &Pose) -> bool {
    pose.rotations.iter().zip(&JOINT_LIMITS).all(|(rotation, limits)| {
        (0..3).all(|axis| {
            rotation[axis] >= limits.low[axis].to_radians() - 1e-6
                && rotation[axis] <= limits.high[axis].to_radians() + 1e-6
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::skeleton::mirrored_joint;

    #[test]
    fn limits_are_mirror_images_and_allow_the_t_pose() {
        for joint in 0..BODY_JOINT_COUNT {
            assert_eq!(JOINT_LIMITS[mirrored_joint(joint, BODY_JOINT_COUNT)], mirrored(JOINT_LIMITS[joint]));
            let limits = JOINT_LIMITS[joint];
            assert!((0..3).all(|a| limits.low[a] <= 0.0 && limits.high[a] >= 0.0));
        }
        assert!(is_within_limits(&Pose::t_pose(22)));
    }

    #[test]
    fn clamping_moves_only_what_is_outside() {
        let mut pose = Pose::t_pose(24);
        pose.rotations[4] = [-0.5, 0.05, 0.0];
        pose.rotations[23] = [3.0, 3.0, 3.0];
        assert!(!is_within_limits(&pose));
        let clamped = limited(pose);
        assert_eq!(clamped.rotations[4], [0.0, 0.05, 0.0]);
        assert_eq!(clamped.rotations[23], [3.0, 3.0, 3.0]);
        assert!(is_within_limits(&clamped));
    }
}
