//! Motion capture of any skeleton, retargeted to the 22 SMPL body joints: what BVH and ASF/AMC files share.
//!
//! Joints are found by their names and their place in the tree ([`joint_map`]), or by a file ([`JointFile`]); see
//! [`super::retarget`] for how they are matched.

mod joint_file;
mod joint_map;
mod joint_name;
mod recording;

pub use joint_file::JointFile;
pub(super) use recording::check_angle;
pub use recording::{Channel, Recording, RigJoint};

use super::motions::Retargeted;
use super::retarget::{JointMap, Retarget};
use super::thinning::largest_turn;
use super::up_axis::WorldUp;
use crate::asset::rotation::{IDENTITY, Matrix3, apply, product, transpose};
use crate::asset::{Body, Pose};

/// A first frame is dropped that jumps to the second one by more than this angle (rad) and by more than ten times the usual
/// step: some collections insert a T-pose there.
const INSERTED_FRAME_ANGLE: f64 = 0.2;

/// `recording` on the skeleton of `body`; `joints` names the joints of a rig whose names are not known.
pub(super) fn retargeted(
    recording: &Recording,
    joints: Option<&JointFile>,
    body: &Body,
) -> Result<Retargeted, String> {
    let map = joint_map(recording, joints)?;
    let mut poses = retarget(recording, map, &body.joint_template);
    let inserted = first_frame_is_inserted(&poses);
    if inserted {
        poses.remove(0);
    }
    Ok(Retargeted {
        poses,
        frame_rate: recording.frame_rate,
        skeleton: format!(
            "{} of 22 body joints in a rig of {}",
            map.iter().flatten().count(),
            recording.joints.len()
        ),
        remark: if inserted { "; dropped frame 0, which jumps to frame 1" } else { "" },
    })
}

/// Retargets every frame of `recording`, whose joints are those of `map`, to the 22 body joints of a skeleton whose T-pose joints are
/// `joints`.
pub(super) fn retarget(recording: &Recording, map: JointMap, joints: &[[f64; 3]]) -> Vec<Pose> {
    let rest = recording.rest_positions();
    let (rest_turn, world_turn) = turns_to_y_up(recording, &map, &rest);
    let rest: Vec<[f64; 3]> = rest.into_iter().map(|p| apply(&rest_turn, p)).collect();
    let retarget = Retarget::new(map, &rest, joints);
    // A rotation carries the rest skeleton to the world: both may be turned.
    let from_rest = transpose(&rest_turn);
    let turned = |rotation: Matrix3| product(&product(&world_turn, &rotation), &from_rest);
    let is_turned = rest_turn != IDENTITY || world_turn != IDENTITY;
    (0..recording.frame_count())
        .map(|frame| {
            let world = recording.world_rotations(frame);
            match is_turned {
                true => retarget.pose(&world.into_iter().map(turned).collect::<Vec<_>>()),
                false => retarget.pose(&world),
            }
        })
        .collect()
}

/// Turns to y up of the rest skeleton and of the world. A skeleton that rests along z has z up (Blender writes such
/// files); its world has z up as well, unless its root stands it up along y.
fn turns_to_y_up(recording: &Recording, map: &JointMap, rest: &[[f64; 3]]) -> (Matrix3, Matrix3) {
    let (Some(pelvis), Some(top)) = (map[0], map[15].or(map[12])) else { return (IDENTITY, IDENTITY) };
    let up: [f64; 3] = std::array::from_fn(|a| rest[top][a] - rest[pelvis][a]);
    if WorldUp::of(up.map(|x| x / up.iter().map(|x| x * x).sum::<f64>().sqrt())) != Some(WorldUp::Z) {
        return (IDENTITY, IDENTITY);
    }
    let mut mean = [0.0; 3];
    for frame in 0..recording.frame_count() {
        let direction = apply(&recording.world_rotations(frame)[pelvis], up);
        (0..3).for_each(|a| mean[a] += direction[a]);
    }
    let turn = WorldUp::Z.to_y_up();
    (turn, if mean[1] > mean[2] { IDENTITY } else { turn })
}

/// The joints of the rig of `recording`: those that `file` names, or those whose names are known.
pub(super) fn joint_map(recording: &Recording, file: Option<&JointFile>) -> Result<JointMap, String> {
    if let Some(file) = file {
        return file.resolve(recording).map_err(|e| e.to_string());
    }
    let map = joint_map::resolve(recording);
    let missing = joint_map::missing(&map);
    if missing.is_empty() {
        return Ok(map);
    }
    let names: Vec<&str> = recording.joints.iter().map(|joint| joint.name.as_str()).collect();
    Err(format!(
        "no joint of the rig is known as {}; name them in a file and pass it as --joints FILE. Its joints are: {}\nThe file, with what \
         is known (\"\" follows its parent):\n{}",
        missing.join(", "),
        names.join(", "),
        joint_file::template(recording, &map)
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

#[cfg(test)]
mod tests {
    use super::*;

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
