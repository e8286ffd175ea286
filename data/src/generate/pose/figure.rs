//! A pose by the angles that people name: how far an arm hangs, a knee bends, the trunk leans.

use crate::asset::rotation::{axis_angle_from_quaternion, quaternion_from_axis_angle, quaternion_product};
use crate::asset::{BODY_JOINT_COUNT, Pose};

pub(super) const LEFT_SIDE: usize = 0;

/// Angles of one side of the body in degrees, as for the left side.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FigureSide {
    pub hip_flexion: f64,
    pub hip_abduction: f64,
    pub hip_turn: f64,
    pub knee: f64,
    pub toes_down: f64,
    /// 0 is the T-pose, 75 hangs, −80 points up.
    pub arm_lowered: f64,
    pub arm_forward: f64,
    pub arm_twist: f64,
    pub elbow: f64,
    pub shrug: f64,
}

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PoseFigure {
    pub sides: [FigureSide; 2],
    /// Whole trunk: forward, turn, sideways.
    pub trunk: [f64; 3],
    pub head: [f64; 3],
    pub pelvis: [f64; 3],
}

impl PoseFigure {
    /// Its pose; angles may leave the limits of the joints.
    pub fn pose(&self) -> Pose {
        let mut pose = Pose::t_pose(BODY_JOINT_COUNT);
        let radians = |v: [f64; 3]| v.map(f64::to_radians);
        pose.rotations[0] = radians(self.pelvis);
        // The trunk's motion spreads over the spine, most of the turn high up.
        for (joint, share) in [(3, [0.36, 0.26, 0.34]), (6, [0.34, 0.34, 0.33]), (9, [0.30, 0.40, 0.33])] {
            pose.rotations[joint] = radians(std::array::from_fn(|a| share[a] * self.trunk[a]));
        }
        pose.rotations[12] = radians(self.head.map(|x| 0.5 * x));
        pose.rotations[15] = pose.rotations[12];
        for (i, side) in self.sides.iter().enumerate() {
            let sign = if i == LEFT_SIDE { 1.0 } else { -1.0 };
            let mut set = |joint: usize, v: [f64; 3]| {
                pose.rotations[joint + i] = [v[0], sign * v[1], sign * v[2]].map(f64::to_radians);
            };
            set(1, [-side.hip_flexion, side.hip_turn, side.hip_abduction]);
            set(4, [side.knee, 0.0, 0.0]);
            set(7, [side.toes_down - 0.15 * side.knee, 0.0, 0.0]);
            set(13, [0.0, -0.12 * side.arm_forward.max(0.0), side.shrug]);
            set(18, [0.3 * side.arm_twist, -side.elbow, 0.0]);
            set(20, [0.0, 0.0, 0.1 * side.arm_twist]);
            // First the twist about the arm, then down, then forward about the side axis of the body.
            let turn = |v: [f64; 3]| quaternion_from_axis_angle(v.map(f64::to_radians));
            let lowered = side.arm_lowered;
            // A horizontal arm moves forward by a turn about the vertical, a hanging one about the side axis.
            let hanging = (lowered / 75.0).clamp(-1.0, 1.0);
            let forward = turn([-side.arm_forward * hanging, -side.arm_forward * (1.0 - hanging.abs()), 0.0]);
            let arm = quaternion_product(
                forward,
                quaternion_product(turn([0.0, 0.0, -lowered]), turn([side.arm_twist, 0.0, 0.0])),
            );
            set(16, axis_angle_from_quaternion(arm).map(f64::to_degrees));
        }
        pose
    }
}
