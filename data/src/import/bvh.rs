//! Motion capture in BVH form, retargeted to the 22 SMPL body joints; see [`super::rig`].

mod hierarchy;

#[cfg(test)]
pub(super) use hierarchy::tests::SMALL;
pub use hierarchy::{load, parse};

use super::motions::{RetargetSettings, write_retargeted};
use super::rig::{JointFile, retargeted};
use super::summary::{ImportError, Progress, Summary};
use crate::asset::Body;
use std::path::{Path, PathBuf};

/// Imports BVH files as motion npz files in the folder `out`, retargeted to `body`. The file `joints` names the joints
/// of rigs whose names are not known. Files that cannot be used are skipped with their reason.
///
/// # Errors
/// If `joints` cannot be used, no file can, or a result cannot be written.
pub fn import_bvh(
    files: &[PathBuf],
    body: &Body,
    out: &Path,
    settings: &RetargetSettings,
    joints: Option<&Path>,
    progress: Progress<'_>,
) -> Result<Summary, ImportError> {
    let joints = joints.map(JointFile::load).transpose()?;
    let read = |file: &Path| retargeted(&load(file).map_err(|e| e.to_string())?, joints.as_ref(), body);
    write_retargeted(files, body, out, settings, "BVH files", &read, progress)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::rotation::{apply, matrix_from_axis_angle};
    use crate::asset::skeleton::{BODY_JOINT_COUNT, BODY_JOINT_PARENTS};
    use crate::asset::{Motion, Pose, Provenance};
    use crate::import::rig::{joint_map, retarget};
    use std::fmt::Write as _;

    #[rustfmt::skip]
    const CMU: [&str; BODY_JOINT_COUNT] = [
        "Hips", "LeftUpLeg", "RightUpLeg", "LowerBack", "LeftLeg", "RightLeg", "Spine", "LeftFoot", "RightFoot", "Spine1",
        "LeftToeBase", "RightToeBase", "Neck", "LeftShoulder", "RightShoulder", "Head", "LeftArm", "RightArm", "LeftForeArm",
        "RightForeArm", "LeftHand", "RightHand",
    ];

    fn poses_of(text: &str, joints: &[[f64; 3]]) -> Vec<Pose> {
        let bvh = parse(text, Path::new("t.bvh")).unwrap();
        retarget(&bvh, joint_map(&bvh, None).unwrap(), joints)
    }

    /// A skeleton with CMU's names whose rest joints are `rest` (body order), with the given local rotations in degrees
    /// (z, x, y order) per body joint in each frame.
    fn synthetic(rest: &[[f64; 3]], frames: &[[[f64; 3]; BODY_JOINT_COUNT]]) -> String {
        let names = CMU;
        fn joint(text: &mut String, names: &[&str], rest: &[[f64; 3]], j: usize, order: &mut Vec<usize>) {
            order.push(j);
            let parent = BODY_JOINT_PARENTS[j].map_or([0.0; 3], |p| rest[p]);
            let kind = if j == 0 { "ROOT" } else { "JOINT" };
            let _ = writeln!(
                text,
                "{kind} {}\n{{\nOFFSET {} {} {}\nCHANNELS 3 Zrotation Xrotation Yrotation",
                names[j],
                rest[j][0] - parent[0],
                rest[j][1] - parent[1],
                rest[j][2] - parent[2]
            );
            for c in (0..BODY_JOINT_COUNT).filter(|c| BODY_JOINT_PARENTS[*c] == Some(j)) {
                joint(text, names, rest, c, order);
            }
            text.push_str("}\n");
        }
        let (mut text, mut order) = ("HIERARCHY\n".to_string(), Vec::new());
        joint(&mut text, &names, rest, 0, &mut order);
        let _ = writeln!(text, "MOTION\nFrames: {}\nFrame Time: 0.01", frames.len());
        for frame in frames {
            for j in &order {
                let _ = write!(text, "{} {} {} ", frame[*j][0], frame[*j][1], frame[*j][2]);
            }
            text.push('\n');
        }
        text
    }

    fn t_pose_joints() -> Vec<[f64; 3]> {
        let mut joints = vec![[0.0; 3]; BODY_JOINT_COUNT];
        for (j, offset) in [
            (1, [0.1, -0.08, 0.0]),
            (2, [-0.1, -0.08, 0.0]),
            (3, [0.0, 0.1, 0.0]),
            (4, [0.02, -0.4, 0.0]),
            (5, [-0.02, -0.4, 0.0]),
            (6, [0.0, 0.15, 0.0]),
            (7, [0.0, -0.4, -0.03]),
            (8, [0.0, -0.4, -0.03]),
            (9, [0.0, 0.1, 0.0]),
            (10, [0.03, -0.05, 0.12]),
            (11, [-0.03, -0.05, 0.12]),
            (12, [0.0, 0.2, 0.0]),
            (13, [0.07, 0.12, 0.0]),
            (14, [-0.07, 0.12, 0.0]),
            (15, [0.0, 0.1, 0.02]),
            (16, [0.1, 0.03, 0.0]),
            (17, [-0.1, 0.03, 0.0]),
            (18, [0.27, 0.0, 0.0]),
            (19, [-0.27, 0.0, 0.0]),
            (20, [0.25, 0.0, 0.0]),
            (21, [-0.25, 0.0, 0.0]),
        ] {
            let parent = joints[BODY_JOINT_PARENTS[j].unwrap()];
            joints[j] = std::array::from_fn(|a| parent[a] + offset[a]);
        }
        joints
    }

    #[test]
    fn identity_motion_on_the_same_skeleton_is_the_t_pose_and_local_rotations_pass_through() {
        let joints = t_pose_joints();
        let mut turned = [[0.0; 3]; BODY_JOINT_COUNT];
        turned[18] = [0.0, 0.0, 60.0];
        turned[4] = [0.0, 40.0, 0.0];
        let text = synthetic(&joints, &[[[0.0; 3]; BODY_JOINT_COUNT], turned]);
        let poses = poses_of(&text, &joints);
        assert!(poses[0].rotations.iter().flatten().all(|x| x.abs() < 1e-9), "{:?}", poses[0]);
        for (j, r) in poses[1].rotations.iter().enumerate() {
            let expected = match j {
                18 => [0.0, 60f64.to_radians(), 0.0],
                4 => [40f64.to_radians(), 0.0, 0.0],
                _ => [0.0; 3],
            };
            assert!(r.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{j}: {r:?}");
        }
    }

    #[test]
    fn a_skeleton_with_hanging_arms_at_rest_gives_hanging_arms_with_straight_wrists() {
        let joints = t_pose_joints();
        let mut hanging = joints.clone();
        for (shoulder, elbow, wrist) in [(16, 18, 20), (17, 19, 21)] {
            hanging[elbow] = std::array::from_fn(|a| hanging[shoulder][a] + [0.0, -0.27, 0.0][a]);
            hanging[wrist] = std::array::from_fn(|a| hanging[elbow][a] + [0.0, -0.25, 0.0][a]);
        }
        let text = synthetic(&hanging, &[[[0.0; 3]; BODY_JOINT_COUNT]]);
        let poses = poses_of(&text, &joints);
        let down = apply(&matrix_from_axis_angle(poses[0].rotations[16]), [1.0, 0.0, 0.0]);
        assert!((down[1] + 1.0).abs() < 1e-9);
        for j in [18, 19, 20, 21] {
            assert!(poses[0].rotations[j].iter().all(|x| x.abs() < 1e-9), "{j}: {:?}", poses[0].rotations[j]);
        }
    }

    #[test]
    fn a_skeleton_that_faces_backwards_at_rest_still_stands_in_t_pose() {
        let joints = t_pose_joints();
        let back: Vec<[f64; 3]> = joints.iter().map(|p| [-p[0], p[1], -p[2]]).collect();
        let text = synthetic(&back, &[[[0.0; 3]; BODY_JOINT_COUNT]]);
        let poses = poses_of(&text, &joints);
        let (rest, yaw) = poses[0].without_heading();
        assert!((yaw.abs() - std::f64::consts::PI).abs() < 1e-9);
        assert!(rest.rotations.iter().flatten().all(|x| x.abs() < 1e-9));
    }

    #[test]
    fn a_skeleton_with_z_up_stands_in_a_world_with_either_axis_up() {
        let joints = t_pose_joints();
        // (x, y, z) in y up is (x, −z, y) in z up.
        let z_up: Vec<[f64; 3]> = joints.iter().map(|p| [p[0], -p[2], p[1]]).collect();
        let mut bent = [[0.0; 3]; BODY_JOINT_COUNT];
        // About z, which is y in y up.
        bent[18] = [60.0, 0.0, 0.0];
        let mut stood_up = bent;
        stood_up[0] = [0.0, -90.0, 0.0];
        for frame in [bent, stood_up] {
            let poses = poses_of(&synthetic(&z_up, &[frame]), &joints);
            for (j, r) in poses[0].rotations.iter().enumerate() {
                let expected = if j == 18 { [0.0, 60f64.to_radians(), 0.0] } else { [0.0; 3] };
                assert!(r.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{j}: {r:?}");
            }
        }
    }

    #[test]
    fn a_clip_says_where_it_comes_from_and_nothing_more() {
        let folder = tempfile::tempdir().unwrap();
        let clip = folder.path().join("walk.bvh");
        std::fs::write(&clip, synthetic(&t_pose_joints(), &[[[0.0; 3]; BODY_JOINT_COUNT]; 3])).unwrap();
        let body = crate::generate::mannequin();
        let imported = |provenance: Provenance| {
            let settings = RetargetSettings { provenance, ..RetargetSettings::default() };
            let (files, out) = ([clip.clone()], folder.path().join("out"));
            import_bvh(&files, &body, &out, &settings, None, &mut |_, _, _| ()).unwrap();
            Motion::load(&out.join("walk.npz")).unwrap().source
        };
        let own = imported(Provenance::default());
        assert_eq!((own.source.as_str(), own.author.as_str(), own.licence.as_str()), ("walk", "", ""));
        let given = Provenance { source: "my studio".into(), author: "me".into(), licence: "CC0".into() };
        assert_eq!(imported(given.clone()), Provenance { source: "my studio (walk)".into(), ..given });
    }
}
