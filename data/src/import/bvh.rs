//! Motion capture in BVH form, retargeted to the 22 SMPL body joints.
//!
//! Joints are found by their names and their place in the tree ([`rig`]), or by a file ([`JointFile`]); see
//! [`super::retarget`] for how they are matched.

mod hierarchy;
mod joint_file;
mod joint_name;
mod rig;

pub use hierarchy::{Bvh, BvhJoint, Channel};
pub use joint_file::JointFile;

use super::motions::{RetargetSettings, Retargeted, write_retargeted};
use super::retarget::{JointMap, Retarget};
use super::summary::{ImportError, Progress, Summary};
use super::thinning::largest_turn;
use super::up_axis::UpAxis;
use crate::asset::rotation::{IDENTITY, Matrix3, apply, product, transpose};
use crate::asset::{Body, Pose};
use std::path::{Path, PathBuf};

/// A first frame is dropped that jumps to the second one by more than this angle (rad) and by more than ten times the usual
/// step: some collections insert a T-pose there.
const INSERTED_FRAME_ANGLE: f64 = 0.2;

/// Retargets every frame of `bvh`, whose joints are those of `map`, to the 22 body joints of a skeleton whose T-pose joints are
/// `joints`.
pub fn retarget(bvh: &Bvh, map: JointMap, joints: &[[f64; 3]]) -> Vec<Pose> {
    let rest = bvh.rest_positions();
    let (rest_turn, world_turn) = turns_to_y_up(bvh, &map, &rest);
    let rest: Vec<[f64; 3]> = rest.into_iter().map(|p| apply(&rest_turn, p)).collect();
    let retarget = Retarget::new(map, &rest, joints);
    // A rotation carries the rest skeleton to the world: both may be turned.
    let from_rest = transpose(&rest_turn);
    let turned = |rotation: Matrix3| product(&product(&world_turn, &rotation), &from_rest);
    let is_turned = rest_turn != IDENTITY || world_turn != IDENTITY;
    (0..bvh.frame_count())
        .map(|frame| {
            let world = bvh.world_rotations(frame);
            match is_turned {
                true => retarget.pose(&world.into_iter().map(turned).collect::<Vec<_>>()),
                false => retarget.pose(&world),
            }
        })
        .collect()
}

/// Turns to y up of the rest skeleton and of the world. A skeleton that rests along z has z up (Blender writes such
/// files); its world has z up as well, unless its root stands it up along y.
fn turns_to_y_up(bvh: &Bvh, map: &JointMap, rest: &[[f64; 3]]) -> (Matrix3, Matrix3) {
    let (Some(pelvis), Some(top)) = (map[0], map[15].or(map[12])) else { return (IDENTITY, IDENTITY) };
    let up: [f64; 3] = std::array::from_fn(|a| rest[top][a] - rest[pelvis][a]);
    if UpAxis::of(up.map(|x| x / up.iter().map(|x| x * x).sum::<f64>().sqrt())) != Some(UpAxis::Z) {
        return (IDENTITY, IDENTITY);
    }
    let mut mean = [0.0; 3];
    for frame in 0..bvh.frame_count() {
        let direction = apply(&bvh.world_rotations(frame)[pelvis], up);
        (0..3).for_each(|a| mean[a] += direction[a]);
    }
    let turn = UpAxis::Z.to_y_up();
    (turn, if mean[1] > mean[2] { IDENTITY } else { turn })
}

/// The joints of the rig of `bvh`: those that `file` names, or those whose names are known.
fn joint_map(bvh: &Bvh, file: Option<&JointFile>) -> Result<JointMap, String> {
    if let Some(file) = file {
        return file.resolve(bvh).map_err(|e| e.to_string());
    }
    let map = rig::resolve(bvh);
    let missing = rig::missing(&map);
    if missing.is_empty() {
        return Ok(map);
    }
    let names: Vec<&str> = bvh.joints.iter().map(|joint| joint.name.as_str()).collect();
    Err(format!(
        "no joint of the rig is known as {}; name them in a file and pass it as --joints FILE. Its joints are: {}\nThe file, with what \
         is known (\"\" follows its parent):\n{}",
        missing.join(", "),
        names.join(", "),
        joint_file::template(bvh, &map)
    ))
}

/// Whether the first frame does not belong to the motion.
fn first_frame_is_inserted(poses: &[Pose]) -> bool {
    if poses.len() < 3 {
        return false;
    }
    let mut steps: Vec<f64> =
        poses.windows(2).skip(1).take(200).map(|w| largest_turn(&w[0], &w[1], 1)).collect();
    steps.sort_by(f64::total_cmp);
    let jump = largest_turn(&poses[0], &poses[1], 1);
    jump > INSERTED_FRAME_ANGLE && jump > 10.0 * steps[steps.len() / 2]
}

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
    let read = |file: &Path| read_file(file, body, joints.as_ref());
    write_retargeted(files, body, out, settings, "BVH files", &read, progress)
}

fn read_file(file: &Path, body: &Body, joints: Option<&JointFile>) -> Result<Retargeted, String> {
    let bvh = Bvh::load(file).map_err(|e| e.to_string())?;
    let map = joint_map(&bvh, joints)?;
    let mut poses = retarget(&bvh, map, &body.joint_template);
    let inserted = first_frame_is_inserted(&poses);
    if inserted {
        poses.remove(0);
    }
    Ok(Retargeted {
        poses,
        frame_rate: 1.0 / bvh.frame_time,
        skeleton: format!(
            "{} of 22 body joints in a rig of {}",
            map.iter().flatten().count(),
            bvh.joints.len()
        ),
        remark: if inserted { "; dropped frame 0, which jumps to frame 1" } else { "" },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::rotation::matrix_from_axis_angle;
    use crate::asset::skeleton::{BODY_JOINT_COUNT, BODY_JOINT_PARENTS};
    use crate::asset::{Motion, Provenance};
    use std::fmt::Write as _;

    #[rustfmt::skip]
    const CMU: [&str; BODY_JOINT_COUNT] = [
        "Hips", "LeftUpLeg", "RightUpLeg", "LowerBack", "LeftLeg", "RightLeg", "Spine", "LeftFoot", "RightFoot", "Spine1",
        "LeftToeBase", "RightToeBase", "Neck", "LeftShoulder", "RightShoulder", "Head", "LeftArm", "RightArm", "LeftForeArm",
        "RightForeArm", "LeftHand", "RightHand",
    ];

    fn poses_of(text: &str, joints: &[[f64; 3]]) -> Vec<Pose> {
        let bvh = Bvh::parse(text, Path::new("t.bvh")).unwrap();
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

    #[test]
    fn an_inserted_first_frame_is_found_and_a_smooth_start_is_not() {
        let pose = |angle: f64| {
            let mut pose = Pose::t_pose(22);
            pose.rotations[16] = [0.0, 0.0, angle];
            pose
        };
        let smooth: Vec<Pose> = (0..50).map(|i| pose(1.0 + 0.01 * i as f64)).collect();
        assert!(!first_frame_is_inserted(&smooth));
        let mut inserted = smooth.clone();
        inserted.insert(0, pose(0.0));
        assert!(first_frame_is_inserted(&inserted));
    }
}
