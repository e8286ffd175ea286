//! A motion file.

use super::anatomy::impossible_turn;
use super::checked::CheckedFile;
use crate::asset::motion::mean_up;
use crate::asset::{BODY_JOINT_NAMES, Motion, Pose};
use crate::generate::pose::JOINT_LIMITS;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Measurements of a motion file.
#[derive(Clone, Debug, Serialize)]
pub struct MotionCheck {
    /// Frames.
    pub frames: usize,
    /// Frames per second.
    pub frame_rate: f64,
    /// Duration (s).
    pub duration: f64,
    /// Frames in which a joint is outside its range of motion by more than a degree.
    pub frames_outside_limits: usize,
    /// Frames outside the range of motion, by joint.
    pub joints_outside_limits: BTreeMap<String, usize>,
    /// Largest excess over a limit (degrees).
    pub largest_excess_degrees: f64,
}

/// Excess over a limit that is measurement noise (degrees).
const LIMIT_TOLERANCE: f64 = 1.0;

/// How far every joint but the pelvis is outside its range of motion, in the angle that is farthest (degrees); 0 within. The
/// heading of the pelvis is free, and falls and floor poses turn it anyhow.
fn excesses(pose: &Pose) -> impl Iterator<Item = (usize, f64)> + '_ {
    (1..JOINT_LIMITS.len()).map(|joint| {
        let (rotation, limits) = (pose.rotation(joint), &JOINT_LIMITS[joint]);
        let excess = (0..3).map(|a| {
            let angle = rotation[a].to_degrees();
            (limits.low[a] - angle).max(angle - limits.high[a])
        });
        (joint, excess.fold(0.0, f64::max))
    })
}

/// A warning about a body that stands along another axis than y.
pub fn not_upright(poses: &[Pose]) -> Option<String> {
    let [_, y, z] = mean_up(poses);
    if y < -0.5 {
        return Some("the body stands on its head on average: is y down in the file, as in the coordinates of a camera? (an npz: \
                     `import amass --up y-down`)".into());
    }
    (y.abs() < 0.3 && z.abs() > 0.7).then(|| {
        "the body lies along z on average: is z up in the file? (an npz: `import amass --up z`)".into()
    })
}

/// Excess over a limit that no file of angles in radians has (degrees): a whole turn.
const NOT_RADIANS: f64 = 360.0;

fn beyond_range(excess: f64) -> Option<String> {
    (excess > NOT_RADIANS).then(|| format!("joints turn {excess:.0}° beyond their range: angles in degrees?"))
}

/// Why the angles of poses cannot be in radians, if so.
pub fn not_radians<'a>(poses: impl IntoIterator<Item = &'a Pose>) -> Option<String> {
    let largest = |pose| excesses(pose).map(|(_, excess)| excess).fold(0.0, f64::max);
    beyond_range(poses.into_iter().map(largest).fold(0.0, f64::max))
}

/// Measurements and warnings, or why the motion cannot be used.
pub(super) fn check(path: &Path) -> Result<CheckedFile<MotionCheck>, String> {
    // NaN, wrong shapes and rates are refused here, with frame and joint.
    let motion = Motion::load(path).map_err(|e| e.to_string())?;
    if motion.poses.is_empty() {
        return Err(format!("{}: no frames", path.display()));
    }
    let mut check = MotionCheck {
        frames: motion.poses.len(),
        frame_rate: motion.frame_rate,
        duration: motion.poses.len() as f64 / motion.frame_rate,
        frames_outside_limits: 0,
        joints_outside_limits: BTreeMap::new(),
        largest_excess_degrees: 0.0,
    };
    for pose in &motion.poses {
        let mut outside = false;
        for (joint, excess) in excesses(pose) {
            check.largest_excess_degrees = check.largest_excess_degrees.max(excess);
            if excess > LIMIT_TOLERANCE {
                outside = true;
                *check.joints_outside_limits.entry(BODY_JOINT_NAMES[joint].to_string()).or_default() += 1;
            }
        }
        check.frames_outside_limits += usize::from(outside);
    }
    let warnings = [impossible_turn(&motion.poses), not_upright(&motion.poses)];
    let reason = match check.frames {
        1 => Some("a single frame is no motion; join still poses in one file".to_owned()),
        _ => beyond_range(check.largest_excess_degrees),
    };
    let unusable = reason.map(|reason| format!("{}: {reason}", path.display()));
    Ok(CheckedFile { measured: check, warnings: warnings.into_iter().flatten().collect(), unusable })
}
