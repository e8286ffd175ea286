//! Bodies in poses and shapes where skin folds into skin.

use super::case::{DegenerateCase, bounded};
use crate::asset::{BODY_JOINT_COUNT, Pose};
use crate::generate::pose::bent_on_both_sides;

pub(super) const BODY_CASES: &[DegenerateCase] = &[
    bounded(
        "knees and elbows bent by 150 degrees",
        "Calves press into thighs, forearms into upper arms.",
        |w| {
            let turns = [("left_knee", [150.0, 0.0, 0.0]), ("left_elbow", [0.0, -150.0, 0.0])];
            w.dressed(&[], &bent_on_both_sides(&turns))
        },
    ),
    bounded(
        "limbs pressed into the torso",
        "Arms cut into the trunk, thighs into each other and into the belly.",
        |w| {
            let turns = [("left_shoulder", [0.0, 0.0, -105.0]), ("left_hip", [-130.0, 0.0, -20.0])];
            w.dressed(&[], &bent_on_both_sides(&turns))
        },
    ),
    bounded("shape +5", "Every shape number is 5, far beyond any person.", |w| {
        w.dressed(&vec![5.0; w.body.shape_count], &Pose::t_pose(BODY_JOINT_COUNT))
    }),
    bounded("shape -5", "Every shape number is -5.", |w| {
        w.dressed(&vec![-5.0; w.body.shape_count], &Pose::t_pose(BODY_JOINT_COUNT))
    }),
];
