//! Turns that no joint makes: the mark of a broken import, not of an athlete.
//!
//! Recorded people leave the clinical ranges of single angles all the time, by tens of degrees. What tells a wrong
//! mapping or other axes is coarser: knees and elbows that bend backwards or sideways, and joints that turn through
//! nearly half a circle. Every rotation is split into swing, by which the bone leaves its direction at rest, and twist
//! about the bone. In 9,000 frames of gymnastics, boxing and dance the bend of knees and elbows stays within 54° of its
//! plane, and no joint comes within 15° of a bound of [`turn_range`].

use crate::asset::rotation::{apply, matrix_from_axis_angle, quaternion_from_axis_angle};
use crate::asset::{BODY_JOINT_COUNT, BODY_JOINT_NAMES, Pose};
use std::f64::consts::PI;

/// Bone at rest, largest swing and twist (degrees), and whether a joint is a hinge, by the direction into which it bends.
struct TurnRange {
    bone: [f64; 3],
    swing: f64,
    twist: f64,
    hinge: Option<[f64; 3]>,
}

const UPWARD: [f64; 3] = [0.0, 1.0, 0.0];
const DOWNWARD: [f64; 3] = [0.0, -1.0, 0.0];
const TO_LEFT: [f64; 3] = [1.0, 0.0, 0.0];
const TO_RIGHT: [f64; 3] = [-1.0, 0.0, 0.0];
const FORWARDS: [f64; 3] = [0.0, 0.0, 1.0];
const BACKWARDS: [f64; 3] = [0.0, 0.0, -1.0];

fn ball(bone: [f64; 3], swing: f64, twist: f64) -> TurnRange {
    TurnRange { bone, swing, twist, hinge: None }
}

fn hinge(bone: [f64; 3], bends: [f64; 3], twist: f64) -> TurnRange {
    TurnRange { bone, swing: 170.0, twist, hinge: Some(bends) }
}

/// Of a body joint, by its number in SMPL order.
fn turn_range(joint: usize) -> TurnRange {
    match joint {
        1 | 2 => ball(DOWNWARD, 165.0, 130.0),
        3 | 6 | 9 => ball(UPWARD, 90.0, 90.0),
        4 | 5 => hinge(DOWNWARD, BACKWARDS, 75.0),
        7 | 8 | 10 | 11 => ball(FORWARDS, 110.0, 90.0),
        12 => ball(UPWARD, 100.0, 110.0),
        13 => ball(TO_LEFT, 80.0, 75.0),
        14 => ball(TO_RIGHT, 80.0, 75.0),
        15 => ball(UPWARD, 110.0, 120.0),
        16 => ball(TO_LEFT, 160.0, 150.0),
        17 => ball(TO_RIGHT, 160.0, 150.0),
        18 => hinge(TO_LEFT, FORWARDS, 130.0),
        19 => hinge(TO_RIGHT, FORWARDS, 130.0),
        20 => ball(TO_LEFT, 120.0, 130.0),
        21 => ball(TO_RIGHT, 120.0, 130.0),
        // The pelvis may lie or turn over.
        _ => ball(UPWARD, 180.0, 180.0),
    }
}

/// A hinge bent by more than this (degrees) …
const BENT: f64 = 50.0;
/// … is bent sideways where its bend is this far out of its plane, and backwards beyond the second one (degrees).
const OUT_OF_PLANE: [f64; 2] = [80.0, 110.0];
/// The twist of a bone that points nearly backwards is no number.
const TWIST_IS_KNOWN: f64 = 150.0;
/// A recording may have a bad frame; a broken import has many: the least share of frames.
const LEAST_FRAME_SHARE: f64 = 0.01;

/// The likely causes of a hinge that bends the wrong way, and of too wide a turn.
const WRONG_WAY: &str = "are left and right swapped, or joints mapped to others (`--joints` of the import)?";
const TOO_WIDE: &str =
    "are the angles in degrees, the axes other ones, or joints mapped to others (`--joints` of the import)?";

/// A rotation that no joint has.
#[derive(Clone, Copy, Debug)]
struct ImpossibleTurn {
    what: &'static str,
    /// Degrees.
    angle: f64,
    cause: &'static str,
}

/// What is impossible about a joint's rotation.
fn impossible(joint: usize, rotation: [f64; 3]) -> Option<ImpossibleTurn> {
    let TurnRange { bone, swing: most_swing, twist: most_twist, hinge } = turn_range(joint);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let turned = apply(&matrix_from_axis_angle(rotation), bone);
    let swing = dot(turned, bone).clamp(-1.0, 1.0).acos().to_degrees();
    if swing > most_swing {
        return Some(ImpossibleTurn { what: "is bent", angle: swing, cause: TOO_WIDE });
    }
    if let Some(bends) = hinge.filter(|_| swing > BENT) {
        let along = dot(turned, bends);
        let side = (1.0 - dot(turned, bone).powi(2) - along * along).max(0.0).sqrt();
        let out_of_plane = side.atan2(along).to_degrees();
        if out_of_plane > OUT_OF_PLANE[1] {
            return Some(ImpossibleTurn { what: "is bent backwards", angle: swing, cause: WRONG_WAY });
        }
        if out_of_plane > OUT_OF_PLANE[0] {
            return Some(ImpossibleTurn { what: "is bent sideways", angle: swing, cause: WRONG_WAY });
        }
    }
    let [w, x, y, z] = quaternion_from_axis_angle(rotation);
    let twist = 2.0 * dot([x, y, z], bone).atan2(w);
    let twist = (twist + PI).rem_euclid(2.0 * PI) - PI;
    let twist = twist.abs().to_degrees();
    let is_twisted = swing < TWIST_IS_KNOWN && twist > most_twist;
    is_twisted.then_some(ImpossibleTurn { what: "is twisted", angle: twist, cause: TOO_WIDE })
}

/// Whether no joint of a pose but the pelvis turns as none does.
pub fn is_possible(pose: &Pose) -> bool {
    (1..BODY_JOINT_COUNT).all(|joint| impossible(joint, pose.rotation(joint)).is_none())
}

/// A warning about joints that turn as none does, in more than a stray frame: joint, frame, angle and the likely cause; `None` if
/// there are none.
pub fn impossible_turn<'a>(poses: impl IntoIterator<Item = &'a Pose>) -> Option<String> {
    // Of every joint: in how many frames, and the worst of them.
    let mut found: [(usize, Option<(usize, ImpossibleTurn)>); BODY_JOINT_COUNT] =
        [(0, None); BODY_JOINT_COUNT];
    let mut frames = 0;
    for (frame, pose) in poses.into_iter().enumerate() {
        frames = frame + 1;
        for (joint, (count, worst)) in found.iter_mut().enumerate().skip(1) {
            if let Some(turn) = impossible(joint, pose.rotation(joint)) {
                *count += 1;
                if worst.is_none_or(|(_, before)| turn.angle > before.angle) {
                    *worst = Some((frame, turn));
                }
            }
        }
    }
    let often =
        |joint: &usize| found[*joint].0 > 0 && found[*joint].0 as f64 >= LEAST_FRAME_SHARE * frames as f64;
    let mut joints: Vec<usize> = (1..BODY_JOINT_COUNT).filter(often).collect();
    joints.sort_by_key(|joint| std::cmp::Reverse(found[*joint].0));
    let (&worst, others) = joints.split_first()?;
    let (count, worst_turn) = found[worst];
    let (frame, ImpossibleTurn { what, angle, cause }) = worst_turn?;
    let also: Vec<&str> = others.iter().map(|joint| BODY_JOINT_NAMES[*joint]).collect();
    Some(format!(
        "{} {what} by {angle:.0}° in frame {frame}, and beyond the human range in {count} of {frames} frames{}: {cause}",
        BODY_JOINT_NAMES[worst],
        if also.is_empty() { String::new() } else { format!(", as {} are", also.join(", ")) },
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::PoseSampler;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Frames of which every `every`-th has this joint turned by degrees.
    fn clip(joint: usize, rotation: [f64; 3], every: usize) -> Vec<Pose> {
        let pose = |frame: usize| {
            let mut pose = Pose::t_pose(22);
            if frame % every == every - 1 {
                pose.rotations[joint] = rotation.map(f64::to_radians);
            }
            pose
        };
        (0..200).map(pose).collect()
    }

    #[test]
    fn hinges_that_bend_the_wrong_way_are_told_with_joint_frame_and_angle() {
        for (joint, rotation, part) in [
            (18, [0.0, 60.0, 0.0], "left_elbow is bent backwards by 60° in frame 9"),
            (19, [0.0, -60.0, 0.0], "right_elbow is bent backwards by 60°"),
            (4, [-60.0, 0.0, 0.0], "left_knee is bent backwards by 60°"),
            (5, [0.0, 0.0, 70.0], "right_knee is bent sideways by 70°"),
            (16, [0.0, 175.0, 0.0], "left_shoulder is bent by 175°"),
            (12, [0.0, 140.0, 0.0], "neck is twisted by 140°"),
        ] {
            let warning = impossible_turn(&clip(joint, rotation, 10)).unwrap();
            assert!(warning.contains(part) && warning.contains("20 of 200 frames"), "{warning}");
            assert!(warning.contains("--joints"), "{warning}");
        }
        // A stray frame is none of an import.
        assert_eq!(impossible_turn(&clip(18, [0.0, 60.0, 0.0], 150)), None);
    }

    #[test]
    fn extreme_but_human_poses_are_let_pass() {
        for (joint, rotation) in [
            (18, [0.0, -150.0, 0.0]),
            (19, [0.0, 150.0, 30.0]),
            (4, [160.0, 0.0, 0.0]),
            (5, [-10.0, 0.0, 0.0]),
            (1, [-145.0, 0.0, 0.0]),
            (2, [0.0, 0.0, -100.0]),
            (16, [0.0, -110.0, 70.0]),
            (20, [100.0, 20.0, 40.0]),
        ] {
            assert_eq!(impossible_turn(&clip(joint, rotation, 1)), None, "joint {joint}, {rotation:?}");
        }
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let poses: Vec<Pose> = (0..300).map(|_| PoseSampler.sample(&mut rng)).collect();
        assert_eq!(impossible_turn(&poses), None);
    }
}
