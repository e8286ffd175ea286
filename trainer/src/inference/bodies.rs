//! The bodies of a drape: one pose, the frames of a motion, or a posed mesh.

use super::error::DraperError;
use super::warnings::{check_poses, warn_about_shape};
use super::{BodyState, Drape, DrapeProgress, Draper, Outfit, Smoothing, smooth};
use crate::dataset::DatasetError;
use clothcombo_data::asset::{Body, KnownShape, Motion, Pose, recover_body};
use clothcombo_data::generate::named_pose;
use serde::Serialize;
use std::path::Path;
use std::str::FromStr;

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
    ) -> Result<Self, DraperError> {
        let count = motion.poses.len();
        let end = frames.end.unwrap_or(count);
        if frames.first >= count || end > count {
            let frame = frames.first.max(end.saturating_sub(1));
            return Err(DraperError::NoFrame { of: name.to_owned(), frame, count });
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
    ) -> Result<Self, DraperError> {
        let found = recover_body(body, known, &surface)
            .map_err(|e| DraperError::Recover { of: name.to_owned(), reason: e.to_string() })?;
        let recovered_within_mm = Some(1e3 * found.mean_distance);
        let report = BodyReport { recovered_within_mm, ..report(body, &found.shape, name) };
        let state =
            BodyState { shape: found.shape, pose: found.pose, surface: Some(surface), place: found.place };
        Ok(Self { states: vec![state], moments: Vec::new(), report })
    }

    /// Whether `draper` can dress them; what is unusual about them is logged as a warning.
    ///
    /// # Errors
    /// When shape, pose or surface do not fit its body, or angles cannot be in radians.
    pub fn check(&self, draper: &Draper) -> Result<(), DraperError> {
        // The frames of a motion are alike in what may be wrong with them.
        self.states.first().map_or(Ok(()), |state| draper.check_body(state))?;
        warn_about_shape(&self.report.shape, draper.trained().config.data.shape_range);
        let poses: Vec<Pose> = self.states.iter().map(|state| state.pose.clone()).collect();
        check_poses(&poses, &self.report.pose)
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
pub fn read_pose(text: &str) -> Result<Pose, DraperError> {
    let (path, frame) = file_and_frame(text);
    if !Path::new(path).exists() {
        // A word without a dot or a slash is a name, not a file that happens to be missing.
        let is_name = !text.contains('/') && Path::new(path).extension().is_none();
        match named_pose(text) {
            Some(pose) => return Ok(pose),
            None if is_name => return Err(DraperError::UnknownPose { text: text.to_owned() }),
            None => {}
        }
    }
    let number = frame
        .parse()
        .map_err(|_| DraperError::FrameNumber { text: text.to_owned(), frame: frame.to_owned() })?;
    let motion = Motion::load(Path::new(path)).map_err(DatasetError::data)?;
    let count = motion.poses.len();
    let pose = motion.poses.into_iter().nth(number);
    pose.ok_or_else(|| DraperError::NoFrame { of: path.to_owned(), frame: number, count })
}

/// Frames this near to each other show the same cloth (s); a little more than 0.05, for rounding.
const CLOSE_FRAMES: f64 = 0.050_001;

/// Frames to each side over which a motion is smoothed: where nothing else is asked for, two of frames that are
/// [close](CLOSE_FRAMES), so that only what trembles is averaged.
fn smoothing_radius(asked: Option<u16>, moments: &[Moment]) -> usize {
    let is_close = |pair: &[Moment]| pair[1].seconds - pair[0].seconds <= CLOSE_FRAMES;
    let usual = if moments.windows(2).all(is_close) { 2 } else { 0 };
    asked.map_or(usual, usize::from)
}

impl Draper {
    /// Drapes `outfit` on all of `bodies`, as [`drape_motion`](Self::drape_motion). A motion is smoothed over `radius` frames to
    /// each side; `None`: over two where they are at most 0.05 s apart, else not.
    ///
    /// # Errors
    /// When shape or pose do not fit the body model, or the networks diverge.
    pub fn drape_bodies(
        &self,
        outfit: &Outfit,
        bodies: &Bodies,
        radius: Option<u16>,
        progress: impl FnMut(DrapeProgress),
    ) -> Result<(Vec<Drape>, Option<Smoothing>), DraperError> {
        let radius = smoothing_radius(radius, &bodies.moments);
        let mut drapes = self.drape_motion(outfit, &bodies.states, radius, progress)?;
        let is_smoothed = radius > 0 && !bodies.moments.is_empty();
        let smoothing = is_smoothed.then(|| smooth(self, outfit, &mut drapes, radius)).transpose()?;
        Ok((drapes, smoothing))
    }
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

    #[test]
    fn frames_far_from_each_other_are_only_smoothed_if_asked_for() {
        let moments = |rate: f64| -> Vec<Moment> {
            (0..5).map(|frame| Moment { frame, seconds: frame as f64 / rate }).collect()
        };
        assert_eq!(
            [60.0, 30.0, 20.0, 19.0, 3.0].map(|rate| smoothing_radius(None, &moments(rate))),
            [2, 2, 2, 0, 0]
        );
        assert_eq!([0, 3].map(|asked| smoothing_radius(Some(asked), &moments(3.0))), [0, 3]);
    }
}
