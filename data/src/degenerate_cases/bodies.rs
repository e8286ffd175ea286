//! Bodies in poses and shapes where skin folds into skin.

use super::case::DegenerateCase;
use crate::asset::{Pose, skeleton};

pub(super) const CASES: &[DegenerateCase] = &[
    DegenerateCase::bounded(
        "knees and elbows bent by 150 degrees",
        "Calves press into thighs, forearms into upper arms.",
        |w| {
            let degrees = [
                ("left_knee", [150.0, 0.0, 0.0]),
                ("right_knee", [150.0, 0.0, 0.0]),
                ("left_elbow", [0.0, -150.0, 0.0]),
                ("right_elbow", [0.0, 150.0, 0.0]),
            ];
            w.dressed(&[], pose(w.body.joint_count(), &degrees))
        },
    ),
    DegenerateCase::bounded(
        "limbs pressed into the torso",
        "Arms cut into the trunk, thighs into each other and into the belly.",
        |w| {
            let degrees = [
                ("left_shoulder", [0.0, 0.0, -105.0]),
                ("right_shoulder", [0.0, 0.0, 105.0]),
                ("left_hip", [-130.0, 0.0, -20.0]),
                ("right_hip", [-130.0, 0.0, 20.0]),
            ];
            w.dressed(&[], pose(w.body.joint_count(), &degrees))
        },
    ),
    DegenerateCase::bounded("shape +5", "Every shape number is 5, far beyond any person.", |w| {
        w.dressed(&vec![5.0; w.body.shape_count], Pose::t_pose(w.body.joint_count()))
    }),
    DegenerateCase::bounded("shape -5", "Every shape number is -5.", |w| {
        w.dressed(&vec![-5.0; w.body.shape_count], Pose::t_pose(w.body.joint_count()))
    }),
];

/// The pose with some joints turned by axis-angle vectors in degrees.
fn pose(joint_count: usize, degrees: &[(&str, [f64; 3])]) -> Pose {
    let mut pose = Pose::t_pose(joint_count);
    for (name, turn) in degrees {
        if let Some(rotation) = skeleton::joint_index(name).and_then(|j| pose.rotations.get_mut(j)) {
            *rotation = turn.map(f64::to_radians);
        }
    }
    pose
}
