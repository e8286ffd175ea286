//! Poses that a name stands for, so that a drape needs no motion file.

use super::figure::{FigureSide, PoseFigure};
use super::limits::limited;
use crate::asset::Pose;

/// Names of the poses that [`named_pose`] knows.
pub const POSE_NAMES: [&str; 3] = ["standing", "walking", "reaching"];

/// The pose of that name, within [`super::JOINT_LIMITS`]: arms hanging; a stride; one arm up.
pub fn named_pose(name: &str) -> Option<Pose> {
    let hanging = FigureSide {
        hip_abduction: 3.0,
        knee: 5.0,
        hip_flexion: 2.5,
        arm_lowered: 64.0,
        elbow: 18.0,
        ..FigureSide::default()
    };
    let figure = match name {
        "standing" => PoseFigure { sides: [hanging; 2], ..PoseFigure::default() },
        "walking" => PoseFigure {
            sides: [
                FigureSide {
                    hip_flexion: 30.0,
                    knee: 9.0,
                    hip_abduction: 1.0,
                    arm_forward: -20.0,
                    elbow: 22.0,
                    ..hanging
                },
                FigureSide {
                    hip_flexion: -14.0,
                    knee: 26.0,
                    hip_abduction: 1.0,
                    toes_down: 14.0,
                    arm_forward: 24.0,
                    elbow: 34.0,
                    ..hanging
                },
            ],
            trunk: [5.0, -8.0, 0.0],
            head: [0.0, 6.0, 0.0],
            ..PoseFigure::default()
        },
        "reaching" => PoseFigure {
            sides: [
                FigureSide { arm_lowered: -50.0, arm_forward: 15.0, shrug: 14.0, elbow: 20.0, ..hanging },
                FigureSide { hip_abduction: 8.0, arm_forward: 22.0, elbow: 40.0, ..hanging },
            ],
            trunk: [3.0, 12.0, -7.0],
            head: [-10.0, 14.0, 0.0],
            ..PoseFigure::default()
        },
        _ => return None,
    };
    Some(limited(figure.pose()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::mannequin;

    #[test]
    fn every_name_is_another_pose_and_its_feet_are_below_its_hips() {
        let body = mannequin();
        let poses = POSE_NAMES.map(|name| named_pose(name).unwrap());
        for (i, pose) in poses.iter().enumerate() {
            assert!(poses[..i].iter().all(|other| other != pose));
            let joints = body.posed(&[], pose).unwrap().joints;
            assert!(
                joints[7][1] < joints[1][1] - 0.5 && joints[8][1] < joints[2][1] - 0.5,
                "{}",
                POSE_NAMES[i]
            );
            assert!(joints[21][1] < joints[17][1], "the right hand hangs: {}", POSE_NAMES[i]);
        }
        let reaching = body.posed(&[], &poses[2]).unwrap().joints;
        assert!(reaching[20][1] > reaching[16][1] + 0.2, "the left hand is up");
        assert_eq!(named_pose("flying"), None);
    }
}
