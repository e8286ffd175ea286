//! Fewer frames of a clip: a lower rate, and no frames in which nothing moves.

use crate::asset::Pose;
use crate::asset::rotation::{axis_angle_from_matrix, matrix_from_axis_angle, product, transpose};

/// Which frames are kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Thinning {
    /// Every n-th frame is kept, with the n that comes nearest to this rate (frames/s).
    pub frame_rate: f64,
    /// A frame that differs from the last one kept by less than this in every joint is dropped (rad); 0 keeps all, and with
    /// them a constant rate.
    pub static_threshold: f64,
}

/// What thinning left.
#[derive(Clone, Debug, PartialEq)]
pub struct Thinned {
    /// The frames kept.
    pub poses: Vec<Pose>,
    /// Rate of the frames but for the static ones (frames/s).
    pub frame_rate: f64,
    /// What was kept of what: "120 of 243 frames at 60 frames/s (one in 2, 2 static ones dropped)".
    pub note: String,
}

/// Applies `thinning` to a clip of `rate` frames per second.
pub fn thin(poses: Vec<Pose>, rate: f64, thinning: &Thinning) -> Thinned {
    let step = (rate / thinning.frame_rate.max(1e-6)).round().clamp(1.0, 1e6) as usize;
    let count = poses.len();
    let mut kept: Vec<Pose> = Vec::new();
    let mut static_frames = 0;
    for pose in poses.into_iter().step_by(step) {
        let moved = |last: &Pose| largest_turn(last, &pose, 0) >= thinning.static_threshold;
        if kept.last().is_none_or(moved) {
            kept.push(pose);
        } else {
            static_frames += 1;
        }
    }
    let note = note(count, kept.len(), rate, step, static_frames);
    Thinned { poses: kept, frame_rate: rate / step as f64, note }
}

fn note(count: usize, kept: usize, rate: f64, step: usize, static_frames: usize) -> String {
    let frames = if count == 1 { "frame" } else { "frames" };
    let of = if kept < count { format!("{kept} of {count}") } else { count.to_string() };
    // Two digits tell 29.97 from 30; whole rates need none.
    let rate = format!("{rate:.2}");
    let rate = rate.strip_suffix(".00").unwrap_or(&rate);
    let mut left_out = Vec::new();
    if step > 1 {
        left_out.push(format!("one in {step}"));
    }
    if static_frames > 0 {
        let ones = if static_frames == 1 { "one" } else { "ones" };
        left_out.push(format!("{static_frames} static {ones} dropped"));
    }
    match left_out.is_empty() {
        true => format!("{of} {frames} at {rate} frames/s"),
        false => format!("{of} {frames} at {rate} frames/s ({})", left_out.join(", ")),
    }
}

/// Largest angle by which any joint from `first` on turns between two poses (rad).
pub fn largest_turn(a: &Pose, b: &Pose, first: usize) -> f64 {
    a.rotations.iter().zip(&b.rotations).skip(first).fold(0.0, |largest, (x, y)| {
        let turn = product(&transpose(&matrix_from_axis_angle(*x)), &matrix_from_axis_angle(*y));
        f64::max(largest, axis_angle_from_matrix(&turn).iter().map(|x| x * x).sum::<f64>().sqrt())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(angle: f64) -> Pose {
        let mut pose = Pose::t_pose(22);
        pose.rotations[16] = [0.0, 0.0, angle];
        pose
    }

    #[test]
    fn the_rate_is_reduced_by_the_nearest_whole_step() {
        let poses: Vec<Pose> = (0..121).map(|i| pose(0.01 * f64::from(i))).collect();
        let settings = Thinning { frame_rate: 30.0, static_threshold: 0.0 };
        for (rate, step) in [(120.000045, 4), (100.0, 3), (59.94, 2), (30.0, 1), (25.0, 1)] {
            let thinned = thin(poses.clone(), rate, &settings);
            assert_eq!(thinned.note.contains("of 121 frames"), step > 1, "{}", thinned.note);
            assert_eq!(thinned.poses, poses.iter().step_by(step).cloned().collect::<Vec<_>>());
            assert!((thinned.frame_rate - rate / step as f64).abs() < 1e-12);
        }
    }

    #[test]
    fn standing_still_is_dropped_and_slow_motion_adds_up() {
        let settings = Thinning { frame_rate: 30.0, static_threshold: 0.1 };
        let still: Vec<Pose> = (0..50).map(|_| pose(0.3)).chain([pose(0.5), pose(0.5)]).collect();
        let thinned = thin(still, 30.0, &settings);
        assert_eq!(thinned.poses, [pose(0.3), pose(0.5)]);
        assert_eq!(thinned.note, "2 of 52 frames at 30 frames/s (50 static ones dropped)");
        let slow: Vec<Pose> = (0..100).map(|i| pose(0.0101 * f64::from(i))).collect();
        assert_eq!(thin(slow, 30.0, &settings).poses.len(), 10);
    }

    #[test]
    fn the_note_reads_as_a_sentence() {
        for (numbers, expected) in [
            ((1, 1, 30.0, 1, 0), "1 frame at 30 frames/s"),
            (
                (243, 120, 59.94, 2, 2),
                "120 of 243 frames at 59.94 frames/s (one in 2, 2 static ones dropped)",
            ),
            ((12, 11, 30.0, 1, 1), "11 of 12 frames at 30 frames/s (1 static one dropped)"),
            ((121, 31, 120.000045, 4, 0), "31 of 121 frames at 120 frames/s (one in 4)"),
        ] {
            let (count, kept, rate, step, static_frames) = numbers;
            assert_eq!(note(count, kept, rate, step, static_frames), expected);
        }
    }
}
