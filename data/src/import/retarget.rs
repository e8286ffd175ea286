//! Motion of one skeleton on another.
//!
//! World rotations are carried over, not local ones, so that the skeletons need not share a tree: for joint j, `W_j = B_j · A_j`
//! with `B_j` the source joint's world rotation and `A_j` the smallest rotation that takes the body's bone in T-pose to the
//! source's bone at rest. Skeletons whose rest pose has hanging arms thus come out right.

use crate::asset::Pose;
use crate::asset::rotation::{
    IDENTITY, Matrix3, apply, axis_angle_from_matrix, between, matrix_from_axis_angle, product, transpose,
};
use crate::asset::skeleton::{BODY_JOINT_COUNT, BODY_JOINT_PARENTS};

/// The source joint for each of the 22 body joints; a joint without one follows its parent.
pub type JointMap = [Option<usize>; BODY_JOINT_COUNT];

/// The next joint along the limb, which fixes the bone's direction. Collars are left out on purpose: their rest directions
/// differ by convention, not by pose.
const LIMB: [(usize, usize); 10] =
    [(1, 4), (2, 5), (4, 7), (5, 8), (7, 10), (8, 11), (16, 18), (17, 19), (18, 20), (19, 21)];

/// Joints at the end of a limb have no bone of their own and keep the alignment of the bone before.
const LIMB_ENDS: [usize; 4] = [10, 11, 20, 21];

/// Carries poses of a source skeleton over to the 22 body joints.
pub struct Retarget {
    map: JointMap,
    align: [Matrix3; BODY_JOINT_COUNT],
}

impl Retarget {
    /// `rest` are the source's joints at rest, y up; `joints` the body's in T-pose, at least 22.
    pub fn new(map: JointMap, rest: &[[f64; 3]], joints: &[[f64; 3]]) -> Self {
        let bone = |points: &[[f64; 3]], from: usize, to: usize| -> [f64; 3] {
            std::array::from_fn(|a| points[to][a] - points[from][a])
        };
        // A source whose rest skeleton faces elsewhere: turn the body there first. Small asymmetries of a scanned skeleton
        // are not a facing.
        let facing = match (map[1], map[2]) {
            (Some(left), Some(right)) => {
                let side = bone(rest, right, left);
                let yaw = (-side[2]).atan2(side[0]);
                if yaw.abs() < 0.35 { IDENTITY } else { matrix_from_axis_angle([0.0, yaw, 0.0]) }
            }
            _ => IDENTITY,
        };
        let mut align = [facing; BODY_JOINT_COUNT];
        for (joint, next) in LIMB {
            if let (Some(from), Some(to)) = (map[joint], map[next]) {
                let direction = apply(&facing, bone(joints, joint, next));
                align[joint] = product(&between(direction, bone(rest, from, to)), &facing);
            }
        }
        for end in LIMB_ENDS {
            if let Some(parent) = BODY_JOINT_PARENTS[end] {
                align[end] = align[parent];
            }
        }
        Self { map, align }
    }

    /// The pose of the body for the world rotations of the source's joints.
    pub fn pose(&self, source: &[Matrix3]) -> Pose {
        let mut world = [IDENTITY; BODY_JOINT_COUNT];
        let rotations = (0..BODY_JOINT_COUNT)
            .map(|j| {
                let parent: Matrix3 = BODY_JOINT_PARENTS[j].map_or(IDENTITY, |p| world[p]);
                world[j] = self.map[j].map_or(parent, |b| product(&source[b], &self.align[j]));
                axis_angle_from_matrix(&product(&transpose(&parent), &world[j]))
            })
            .collect();
        Pose { rotations }
    }
}
