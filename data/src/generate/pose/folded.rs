//! Poses that fold a body into itself.

use crate::asset::skeleton::joint_index;
use crate::asset::{BODY_JOINT_COUNT, Pose};

/// The pose with some joints turned by rotation vectors (degrees), those of the right side as the mirror image of the left one's.
pub(crate) fn bent_on_both_sides(turns: &[(&str, [f64; 3])]) -> Pose {
    let mut pose = Pose::t_pose(BODY_JOINT_COUNT);
    for (name, degrees) in turns {
        let [x, y, z] = degrees.map(f64::to_radians);
        if let Some(joint) = joint_index(name) {
            pose.rotations[joint] = [x, y, z];
        }
        if let Some(joint) = name.strip_prefix("left_").and_then(|n| joint_index(&format!("right_{n}"))) {
            pose.rotations[joint] = [x, -y, -z];
        }
    }
    pose
}

/// Poses that fold a body into itself, each with its name.
pub fn folded_poses() -> Vec<(&'static str, Pose)> {
    let both_sides = bent_on_both_sides;
    vec![
        ("knees bent 150°", both_sides(&[("left_knee", [150.0, 0.0, 0.0])])),
        ("elbows bent 150°", both_sides(&[("left_elbow", [0.0, -150.0, 0.0])])),
        ("arms pressed into the torso", both_sides(&[("left_shoulder", [0.0, 0.0, -95.0])])),
        (
            "sitting",
            both_sides(&[
                ("left_hip", [-100.0, 0.0, 0.0]),
                ("left_knee", [100.0, 0.0, 0.0]),
                ("left_shoulder", [0.0, 0.0, -70.0]),
            ]),
        ),
        (
            "crouching",
            both_sides(&[
                ("left_hip", [-130.0, 0.0, 0.0]),
                ("left_knee", [150.0, 0.0, 0.0]),
                ("spine1", [25.0, 0.0, 0.0]),
                ("spine2", [25.0, 0.0, 0.0]),
                ("left_shoulder", [0.0, -80.0, 0.0]),
            ]),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_are_alike() {
        for (name, pose) in folded_poses() {
            let mirrored = pose.mirrored();
            for (a, b) in pose.rotations.iter().zip(&mirrored.rotations) {
                assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-12), "{name}");
            }
        }
    }
}
