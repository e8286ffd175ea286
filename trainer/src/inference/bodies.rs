//! The bodies of a drape: one pose, the frames of a motion, or a posed mesh.

use crate::dataset::DatasetError;
use clothcombo_data::asset::{Body, KnownShape, Motion, Pose, recover_body};
use clothcombo_data::generate::{POSE_NAMES, named_pose};
use miette::{Report, miette};
use serde::Serialize;
use std::path::Path;
use std::str::FromStr;

/// A body to be dressed.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyState {
    /// Shape parameters β; missing ones are 0.
    pub shape: Vec<f64>,
    /// Pose θ.
    pub pose: Pose,
    /// The posed surface `[V, 3]` (m) that counts for contact, where it is known better than by shape and pose: a scan, or
    /// another program's correctives.
    pub surface: Option<Vec<[f64; 3]>>,
    /// Where its pelvis stands (m); `surface` is there already.
    pub place: [f64; 3],
}

impl BodyState {
    /// The body model's own surface at this shape and pose.
    pub fn new(shape: Vec<f64>, pose: Pose) -> Self {
        Self { shape, pose, surface: None, place: [0.0; 3] }
    }
}

/// Bodies to be dressed one after the other.
#[derive(Clone, Debug)]
pub struct Bodies {
    /// At least one.
    pub states: Vec<BodyState>,
    /// When they are, if they are a motion.
    pub moments: Vec<Moment>,
    /// What a report says of them.
    pub report: BodyReport,
}

/// A draped frame and when it is.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Number in the motion.
    pub frame: usize,
    /// Time (s).
    pub seconds: f64,
}

/// What a report says of the body.
#[derive(Clone, Debug, Serialize)]
pub struct BodyReport {
    /// Its name.
    pub name: String,
    /// Shape parameters β.
    pub shape: Vec<f64>,
    /// Where the pose comes from.
    pub pose: String,
    /// Vertices.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// For a body recovered from meshes: mean distance of its vertices to theirs (mm).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recovered_within_mm: Option<f64>,
}

/// Frames `[first, end)`; the default is all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameRange {
    /// The first.
    pub first: usize,
    /// The first that is left out; `None`: to the end of the motion.
    pub end: Option<usize>,
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("'{text}' is no range of frames such as 0..120, 30.. or ..60");
        let (first, end) = text.split_once("..").ok_or_else(wrong)?;
        let number = |part: &str, empty| match part {
            "" => Ok(empty),
            digits => digits.parse::<usize>().map(Some).map_err(|_| wrong()),
        };
        let range = Self { first: number(first, Some(0))?.unwrap_or(0), end: number(end, None)? };
        match range.end.is_some_and(|end| end <= range.first) {
            true => Err(format!("'{text}' holds no frame")),
            false => Ok(range),
        }
    }
}

impl Bodies {
    /// One body of a shape and pose; `name` says where the pose comes from.
    pub fn in_pose(body: &Body, shape: &[f64], pose: Pose, name: &str) -> Self {
        let states = vec![BodyState::new(shape.to_vec(), pose)];
        Self { states, moments: Vec::new(), report: report(body, shape, name) }
    }

    /// Every `every`-th of the frames of `motion`; `name` says where it comes from.
    ///
    /// # Errors
    /// When the motion has no such frames.
    pub fn in_motion(
        body: &Body,
        shape: &[f64],
        motion: &Motion,
        name: &str,
        frames: FrameRange,
        every: usize,
    ) -> Result<Self, Report> {
        let count = motion.poses.len();
        let end = frames.end.unwrap_or(count);
        if frames.first >= count || end > count {
            let frame = frames.first.max(end.saturating_sub(1));
            return Err(no_frame(name, frame, count));
        }
        let frames = (frames.first..end).step_by(every.max(1));
        let (states, moments) = frames
            .map(|frame| {
                let seconds = frame as f64 / motion.frame_rate;
                (BodyState::new(shape.to_vec(), motion.poses[frame].clone()), Moment { frame, seconds })
            })
            .unzip();
        Ok(Self { states, moments, report: report(body, shape, name) })
    }

    /// The body whose posed `surface` `[V, 3]` (m) is known: its pose, and unless `known` its shape, are recovered from it.
    /// `name` says where it comes from.
    ///
    /// # Errors
    /// When it is no pose of the body model.
    pub fn of_surface(
        body: &Body,
        surface: Vec<[f64; 3]>,
        known: KnownShape,
        name: &str,
    ) -> Result<Self, Report> {
        check_body_mesh(body, name, &surface)?;
        if let KnownShape::TPose(rest) = known {
            check_body_mesh(body, "the body in T-pose", rest)?;
        }
        let found = recover_body(body, known, &surface).map_err(|reason| no_body_mesh(name, &reason))?;
        let recovered_within_mm = Some(1e3 * found.mean_distance);
        let report = BodyReport { recovered_within_mm, ..report(body, &found.shape, name) };
        let state =
            BodyState { shape: found.shape, pose: found.pose, surface: Some(surface), place: found.place };
        Ok(Self { states: vec![state], moments: Vec::new(), report })
    }
}

fn report(body: &Body, shape: &[f64], pose: &str) -> BodyReport {
    BodyReport {
        name: body.name.clone(),
        shape: shape.to_vec(),
        pose: pose.to_owned(),
        vertices: body.vertex_count(),
        triangles: body.faces.len(),
        recovered_within_mm: None,
    }
}

/// A body mesh so many times as large as the body model, or as small, is in another unit.
const RESCALED: f64 = 3.0;

/// The post-process takes what is within a kilometre of the origin; garments stand away from the body (m).
const FARTHEST_BODY: f64 = 900.0;

/// Whether `positions` can be those of a mesh of `body`, in metres; errors say that it is `of`.
///
/// # Errors
/// When they cannot.
pub fn check_body_mesh(body: &Body, of: &str, positions: &[[f64; 3]]) -> Result<(), Report> {
    let (found, expected) = (positions.len(), body.vertex_count());
    if found != expected {
        let reason = format!("the mesh has {found} vertices, body '{}' has {expected}", body.name);
        return Err(no_body_mesh(of, &reason));
    }
    let [own, model] = [positions, &body.template].map(extent);
    if own > RESCALED * model || model > RESCALED * own {
        let reason = format!("the mesh measures {own:.3} from end to end, body '{}' {model:.3}", body.name);
        return Err(no_body_mesh(of, &reason));
    }
    // Not a number is nowhere.
    match positions.iter().position(|p| !p.iter().all(|x| x.abs() <= FARTHEST_BODY)) {
        None => Ok(()),
        Some(vertex) => {
            let place = positions[vertex];
            let reason = format!(
                "vertex {vertex} (from 0) is at {place:?}, not within {FARTHEST_BODY} m of the origin"
            );
            Err(no_body_mesh(of, &reason))
        }
    }
}

/// The longest side of the box around `positions`.
fn extent(positions: &[[f64; 3]]) -> f64 {
    let side = |axis: usize| {
        let along = || positions.iter().map(|p| p[axis]);
        along().fold(f64::MIN, f64::max) - along().fold(f64::MAX, f64::min)
    };
    (0..3).map(side).fold(0.0, f64::max)
}

fn no_body_mesh(of: &str, reason: &dyn std::fmt::Display) -> Report {
    miette!(
        help = "the mesh must be a pose of the body model: the same vertices in the same order, metres, y up; and its shape \
                known, by --t-pose or --shape",
        "{of}: {reason}"
    )
}

/// The parts of `FILE.npz` or `FILE.npz:FRAME`.
pub fn file_and_frame(text: &str) -> (&str, &str) {
    match text.rsplit_once(':') {
        // What is no number is one that was meant as one where the rest is a file.
        Some((path, frame))
            if !Path::new(text).exists()
                && (frame.bytes().all(|b| b.is_ascii_digit()) || Path::new(path).is_file()) =>
        {
            (path, frame)
        }
        _ => (text, "0"),
    }
}

/// The pose of that name, or that of a frame of a motion file, `FILE.npz` or `FILE.npz:FRAME`.
///
/// # Errors
/// When there is neither.
pub fn read_pose(text: &str) -> Result<Pose, Report> {
    let (path, frame) = file_and_frame(text);
    if !Path::new(path).exists() {
        // A word without a dot or a slash is a name, not a file that happens to be missing.
        let is_name = !text.contains('/') && Path::new(path).extension().is_none();
        match named_pose(text) {
            Some(pose) => return Ok(pose),
            None if is_name => {
                let names = POSE_NAMES.join(", ");
                return Err(miette!(
                    help = format!("its names: {names}; or give a frame of a motion file, FILE.npz:FRAME"),
                    "--pose {text}: neither a file nor the name of a pose"
                ));
            }
            None => {}
        }
    }
    let number = frame.parse().map_err(|_| miette!("--pose {text}: {frame:?} is no number of a frame"))?;
    let motion = Motion::load(Path::new(path)).map_err(DatasetError::data)?;
    let count = motion.poses.len();
    let pose = motion.poses.into_iter().nth(number);
    pose.ok_or_else(|| no_frame(path, number, count))
}

fn no_frame(of: &str, frame: usize, count: usize) -> Report {
    let help = if count == 0 { "export it again with its poses" } else { "frames count from 0" };
    miette!(help = help, "{of} has {count} frames, no frame {frame}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_frames_are_half_open_and_never_empty() {
        let range = |text: &str| text.parse::<FrameRange>().map(|r| (r.first, r.end));
        assert_eq!(range("3..9"), Ok((3, Some(9))));
        assert_eq!(
            (range("3.."), range("..9"), range("..")),
            (Ok((3, None)), Ok((0, Some(9))), Ok((0, None)))
        );
        for wrong in ["", "7", "9..3", "4..4", "a..b", "-1..4"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }
}
