//! DeepMimic motion text (`humanoid3d_*.txt`), retargeted to the 22 SMPL body joints.
//!
//! Peng et al., "DeepMimic", 2018. JSON with `Frames`, rows of 44: duration (s), root position, root rotation, then the joints of
//! `ROW` relative to their parents: quaternions `w x y z`, and angles about z for knees and elbows. The character stands in y
//! up, faces +x with its left towards −z, and rests with hanging arms.

use super::motions::{RetargetSettings, Retargeted, write_retargeted};
use super::retarget::{JointMap, Retarget};
use super::summary::{ImportError, Progress, Summary};
use crate::asset::Body;
use crate::asset::motion::{MAX_ANGLE, check_frame_rate};
use crate::asset::rotation::{Matrix3, axis_angle_from_quaternion, matrix_from_axis_angle, product};
use crate::format::way_out;
use serde::Deserialize;
use std::fs;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

const ROW_LENGTH: usize = 44;
/// Column of the root's rotation.
const ROOT_COLUMN: usize = 4;
/// Lengths that a quaternion may have: the published clips hold interpolated ones from 0.58 to 1.12, which are normalised, as
/// DeepMimic itself does.
const LENGTHS: RangeInclusive<f64> = 0.5..=1.5;

/// Joints after the root: first column, whether it is an angle about z instead of a quaternion, and the parent
/// (0 the root, n the n-th joint of this table).
const ROW: [(usize, bool, usize); 12] = [
    (8, false, 0),  // 1 chest
    (12, false, 1), // 2 neck
    (16, false, 0), // 3 right hip
    (20, true, 3),  // 4 right knee
    (21, false, 4), // 5 right ankle
    (25, false, 1), // 6 right shoulder
    (29, true, 6),  // 7 right elbow
    (30, false, 0), // 8 left hip
    (34, true, 8),  // 9 left knee
    (35, false, 9), // 10 left ankle
    (39, false, 1), // 11 left shoulder
    (43, true, 11), // 12 left elbow
];

/// Joints that follow others: the lower spine (a third and two thirds of the chest's bend, which one joint of the character
/// stands for), and half of the neck's.
const LOWER_SPINE: [usize; 2] = [13, 14];
const LOWER_NECK: usize = 15;
/// Wrists do not turn against the forearm; they are needed for its direction.
const WRISTS: [usize; 2] = [16, 17];
const DEEPMIMIC_JOINT_COUNT: usize = 18;

/// The character's joints at rest (m), in its own frame; only the limbs' directions matter.
fn rest_positions() -> [[f64; 3]; DEEPMIMIC_JOINT_COUNT] {
    const RIGHT_SHOULDER: [f64; 3] = [-0.024, 0.4797, 0.1831];
    let mut rest = [[0.0; 3]; DEEPMIMIC_JOINT_COUNT];
    rest[1] = [0.0, 0.2362, 0.0];
    rest[2] = [0.0, 0.4601, 0.0];
    for (side, hip, shoulder, wrist) in [(1.0, 3, 6, WRISTS[1]), (-1.0, 8, 11, WRISTS[0])] {
        rest[hip] = [0.0, 0.0, side * 0.0849];
        rest[hip + 1] = [0.0, -0.4215, side * 0.0849];
        rest[hip + 2] = [0.0, -0.8314, side * 0.0849];
        rest[shoulder] = [RIGHT_SHOULDER[0], RIGHT_SHOULDER[1], side * RIGHT_SHOULDER[2]];
        rest[shoulder + 1] = [RIGHT_SHOULDER[0], RIGHT_SHOULDER[1] - 0.2748, side * RIGHT_SHOULDER[2]];
        rest[wrist] = [RIGHT_SHOULDER[0], RIGHT_SHOULDER[1] - 0.5337, side * RIGHT_SHOULDER[2]];
    }
    rest
}

#[rustfmt::skip]
const MAP: JointMap = [
    Some(0), Some(8), Some(3), Some(LOWER_SPINE[0]), Some(9), Some(4), Some(LOWER_SPINE[1]), Some(10), Some(5), Some(1),
    None, None, Some(LOWER_NECK), None, None, Some(2), Some(11), Some(6), Some(12), Some(7), Some(WRISTS[0]), Some(WRISTS[1]),
];

/// World rotations of all joints in one row.
fn world_rotations(row: &[f64]) -> [Matrix3; DEEPMIMIC_JOINT_COUNT] {
    let turn = |column: usize| -> [f64; 3] {
        axis_angle_from_quaternion([row[column], row[column + 1], row[column + 2], row[column + 3]])
    };
    let root = matrix_from_axis_angle(turn(ROOT_COLUMN));
    let mut world = [root; DEEPMIMIC_JOINT_COUNT];
    for (i, (column, hinge, parent)) in ROW.into_iter().enumerate() {
        let local = if hinge { [0.0, 0.0, row[column]] } else { turn(column) };
        world[i + 1] = product(&world[parent], &matrix_from_axis_angle(local));
    }
    let share = |column: usize, part: f64| matrix_from_axis_angle(turn(column).map(|x| x * part));
    for (n, joint) in LOWER_SPINE.into_iter().enumerate() {
        world[joint] = product(&root, &share(ROW[0].0, (n + 1) as f64 / 3.0));
    }
    world[LOWER_NECK] = product(&world[1], &share(ROW[1].0, 0.5));
    world[WRISTS[0]] = world[12];
    world[WRISTS[1]] = world[7];
    world
}

#[derive(Deserialize)]
struct Text {
    #[serde(rename = "Frames")]
    frames: Vec<Vec<f64>>,
}

/// The rows of a motion text, checked.
fn parse(text: &str) -> Result<Vec<Vec<f64>>, String> {
    let Text { frames } =
        serde_json::from_str(text).map_err(|e| format!("not a DeepMimic motion (JSON with Frames): {e}"))?;
    for (number, row) in frames.iter().enumerate() {
        if row.len() != ROW_LENGTH {
            return Err(format!(
                "frame {number} has {} numbers; a humanoid's row has {ROW_LENGTH}",
                row.len()
            ));
        }
        if let Some(column) = row.iter().position(|x| !x.is_finite()) {
            return Err(format!("frame {number}, number {column} is not finite"));
        }
        let mut angles = ROW.iter().filter(|(_, hinge, _)| *hinge).map(|(column, _, _)| *column);
        if let Some(column) = angles.find(|column| row[*column].abs() > MAX_ANGLE) {
            return Err(format!(
                "frame {number}, number {column} is an angle of {:?} rad, more than the {MAX_ANGLE} rad of any motion",
                row[column]
            ));
        }
        let quaternions = ROW.iter().filter(|(_, hinge, _)| !hinge).map(|(column, _, _)| *column);
        for column in quaternions.chain([ROOT_COLUMN]) {
            let length = row[column..column + 4].iter().map(|x| x * x).sum::<f64>().sqrt();
            if !LENGTHS.contains(&length) {
                return Err(format!(
                    "frame {number}: numbers {column} to {} are no unit quaternion, their length is {length:.3}",
                    column + 3
                ));
            }
        }
    }
    if frames.is_empty() {
        return Err("it has no frames".into());
    }
    Ok(frames)
}

/// Frames per second: the median duration counts, because the last frame's is often zero.
fn frame_rate(frames: &[Vec<f64>]) -> Result<f64, String> {
    let mut durations: Vec<f64> = frames.iter().map(|row| row[0]).filter(|d| *d > 0.0).collect();
    durations.sort_by(f64::total_cmp);
    match durations.get(durations.len() / 2) {
        Some(d) if *d < 10.0 => {
            check_frame_rate(1.0 / d)
                .map_err(|defect| format!("a median duration of {d:?} s for a frame means {defect}"))?;
            Ok(1.0 / d)
        }
        _ => Err("no frame has a duration between 0 and 10 s".into()),
    }
}

/// Imports DeepMimic motion texts as motion npz files in the folder `out`, retargeted to `body`. Files that cannot be used are
/// skipped with their reason.
///
/// # Errors
/// If no file can be used, or a result cannot be written.
pub fn import_deepmimic(
    files: &[PathBuf],
    body: &Body,
    out: &Path,
    settings: &RetargetSettings,
    progress: Progress<'_>,
) -> Result<Summary, ImportError> {
    let read = |file: &Path| -> Result<Retargeted, String> {
        let bytes = fs::read(file).map_err(|e| e.to_string())?;
        if let Some(way_out) = way_out(file) {
            return Err(way_out);
        }
        let frames = parse(&String::from_utf8_lossy(&bytes))?;
        let retarget = Retarget::new(MAP, &rest_positions(), &body.joint_template);
        Ok(Retargeted {
            frame_rate: frame_rate(&frames)?,
            poses: frames.iter().map(|row| retarget.pose(&world_rotations(row))).collect(),
            skeleton: "DeepMimic humanoid".into(),
            remark: "",
        })
    };
    write_retargeted(files, body, out, settings, "DeepMimic motions", &read, progress)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::Pose;
    use crate::generate::mannequin;

    fn rest_row() -> Vec<f64> {
        let mut row = vec![0.0; ROW_LENGTH];
        row[0] = 1.0 / 30.0;
        row[ROOT_COLUMN] = 1.0;
        ROW.iter().filter(|(_, hinge, _)| !hinge).for_each(|(column, _, _)| row[*column] = 1.0);
        row
    }

    /// Joints of the mannequin in the pose of a row, seen by someone facing as the character does: (forward, up, left).
    fn joints(row: &[f64]) -> Vec<[f64; 3]> {
        let body = mannequin();
        let retarget = Retarget::new(MAP, &rest_positions(), &body.joint_template);
        let pose: Pose = retarget.pose(&world_rotations(row));
        body.posed(&[], &pose).unwrap().joints.iter().map(|p| [p[0], p[1], -p[2]]).collect()
    }

    #[test]
    fn at_rest_the_body_stands_facing_plus_x_with_hanging_arms() {
        let j = joints(&rest_row());
        assert!(j[7][1] < -0.5 && j[15][1] > 0.3, "feet {:?} head {:?}", j[7], j[15]);
        // Left is left, toes point forward.
        assert!(j[1][2] > 0.02 && j[2][2] < -0.02 && j[16][2] > 0.1);
        assert!(j[10][0] > j[7][0] + 0.05);
        for (shoulder, wrist) in [(16, 20), (17, 21)] {
            let arm: [f64; 3] = std::array::from_fn(|a| j[wrist][a] - j[shoulder][a]);
            assert!(arm[1] < -0.3 && arm[0].abs() < 0.02 && arm[2].abs() < 0.02, "{arm:?}");
        }
    }

    #[test]
    fn knees_bend_backwards_elbows_forwards_and_the_chest_over_three_joints() {
        let mut row = rest_row();
        (row[20], row[34]) = (-1.2, -0.8);
        (row[29], row[43]) = (1.0, 0.5);
        let j = joints(&row);
        // The heel goes back, each by its own angle.
        assert!(j[8][0] - j[5][0] < -0.25 && j[7][0] - j[4][0] < -0.15 && j[8][0] < j[7][0]);
        // The hand comes forward.
        assert!(j[21][0] - j[19][0] > 0.15 && j[20][0] - j[18][0] > 0.05);

        let mut row = rest_row();
        // A bow: about +z is backwards for who faces +x, so a negative angle.
        let half: f64 = -0.45;
        (row[8], row[11]) = (half.cos(), half.sin());
        let body = mannequin();
        let pose = Retarget::new(MAP, &rest_positions(), &body.joint_template).pose(&world_rotations(&row));
        for joint in [3, 6, 9] {
            let r = pose.rotations[joint];
            assert!((r[0] - 0.3).abs() < 1e-9 && r[1].abs() < 1e-9 && r[2].abs() < 1e-9, "{joint}: {r:?}");
        }
        assert!(joints(&row)[15][0] > 0.2);
    }

    #[test]
    fn what_is_not_a_humanoid_motion_is_refused_with_the_frame() {
        let text = |row: &[f64]| format!("{{\"Loop\": \"wrap\", \"Frames\": [{:?}, {:?}]}}", rest_row(), row);
        assert_eq!(parse(&text(&rest_row())).unwrap().len(), 2);
        assert!(parse(&text(&[0.0; 20])).unwrap_err().contains("frame 1 has 20 numbers"));
        let mut row = rest_row();
        row[13] = 1.7;
        assert!(parse(&text(&row)).unwrap_err().contains("frame 1: numbers 12 to 15"));
        assert!(parse("{\"Frames\": []}").unwrap_err().contains("no frames"));
        for bad in ["", "[1, 2]", "{\"Frames\": [[1, \"x\"]]}", &text(&rest_row())[..200]] {
            assert!(parse(bad).unwrap_err().contains("line 1"), "{bad}");
        }
        let mut row = rest_row();
        row[20] = 1e300;
        assert!(parse(&text(&row)).unwrap_err().contains("frame 1, number 20 is an angle"));
        assert!(frame_rate(&[vec![0.0]]).is_err());
        assert!(frame_rate(&[vec![1e-300]]).unwrap_err().contains("expected 0.01 to 10000"));
        assert!((frame_rate(&[vec![0.05], vec![0.05], vec![0.0]]).unwrap() - 20.0).abs() < 1e-9);
    }
}
