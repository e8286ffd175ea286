//! One outfit to be draped, and the bodies it is draped on.

use crate::dataset::DatasetError;
use crate::inference::{BodyReport, BodyState, Draper, GivenGarment, Moment};
use clap::Args;
use clothcombo_data::asset::{KnownShape, Motion, Pose, recover_body};
use clothcombo_data::fit::FitSettings;
use clothcombo_data::format::load_mesh;
use clothcombo_data::generate::{POSE_NAMES, named_pose};
use miette::{Report as Failure, miette};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Shape, pose or motion of the body.
#[derive(Args, Clone, Debug, Default)]
pub(super) struct SceneArguments {
    /// Shape parameters; missing ones are 0
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_name = "NUMBERS")]
    pub shape: Vec<f64>,
    /// Pose: standing, walking, reaching, or a frame of a motion file, FILE.npz or FILE.npz:FRAME; default: the T-pose
    #[arg(long, value_name = "POSE", conflicts_with_all = ["motion", "posed"])]
    pub pose: Option<String>,
    /// Motion file (npz with poses and mocap_framerate, y up; `import amass` makes them of AMASS files): drapes every frame
    #[arg(long, value_name = "NPZ", conflicts_with = "posed")]
    pub motion: Option<PathBuf>,
    /// Frames of the motion: FIRST..END, FIRST.. or ..END, without END
    #[arg(long, value_name = "RANGE", requires = "moving")]
    pub frames: Option<FrameRange>,
    /// Takes every so-manieth frame of the motion
    #[arg(long, value_name = "N", requires = "moving", value_parser = clap::value_parser!(u32).range(1..))]
    pub every: Option<u32>,
    /// A mesh of the posed body, with the vertices of the body model: the pose is recovered from it
    #[arg(long, value_name = "MESH")]
    pub posed: Option<PathBuf>,
    /// The same body in T-pose, from which the shape is recovered; without it, it is that of --shape
    #[arg(long, value_name = "MESH", requires = "posed", conflicts_with = "shape")]
    pub t_pose: Option<PathBuf>,
}

/// Frames `[first, end)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FrameRange {
    first: usize,
    end: Option<usize>,
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

/// A garment that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WantedGarment {
    /// File or name.
    pub name: String,
    /// What is known about it.
    pub hints: FitSettings,
}

/// One outfit to be draped.
#[derive(Clone, Debug)]
pub(super) struct Job {
    /// Name of its folder among several.
    pub name: String,
    /// Innermost first.
    pub garments: Vec<WantedGarment>,
    /// Another order.
    pub order: Option<Vec<usize>>,
    /// The body.
    pub scene: SceneArguments,
}

/// The bodies of a job.
pub(super) struct Scenes {
    pub states: Vec<BodyState>,
    /// When they are, if they are a motion.
    pub moments: Vec<Moment>,
    pub body: BodyReport,
}

impl Job {
    /// Files that are read, names of garments among them.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        let SceneArguments { pose, motion, posed, t_pose, .. } = &self.scene;
        let pose = pose.iter().map(|pose| PathBuf::from(file_and_frame(pose).0));
        let scene = pose.chain([motion, posed, t_pose].into_iter().flatten().cloned());
        let bodies = self.garments.iter().filter_map(|garment| garment.hints.from_body.as_deref());
        let bodies = bodies.map(|body| body.path().to_owned());
        self.garments.iter().map(|garment| PathBuf::from(&garment.name)).chain(bodies).chain(scene)
    }

    /// Reads pose, motion or meshes.
    pub fn scenes(&self, draper: &Draper) -> Result<Scenes, Failure> {
        let (body, scene) = (draper.body(), &self.scene);
        let report = |pose: String| BodyReport {
            name: body.name.clone(),
            shape: scene.shape.clone(),
            pose,
            vertices: body.vertex_count(),
            triangles: body.faces.len(),
            recovered_within_mm: None,
        };
        if let Some(path) = &scene.motion {
            let motion = Motion::load(path).map_err(DatasetError::data)?;
            let range = scene.frames.unwrap_or(FrameRange { first: 0, end: None });
            let end = range.end.unwrap_or(motion.poses.len());
            if range.first >= motion.poses.len() || end > motion.poses.len() {
                return Err(no_frame(path, range.first.max(end.saturating_sub(1)), motion.poses.len()));
            }
            let frames = (range.first..end).step_by(scene.every.unwrap_or(1) as usize);
            let (states, moments) = frames
                .map(|frame| {
                    let seconds = frame as f64 / motion.frame_rate;
                    (
                        BodyState::new(scene.shape.clone(), motion.poses[frame].clone()),
                        Moment { frame, seconds },
                    )
                })
                .unzip();
            return Ok(Scenes { states, moments, body: report(path.display().to_string()) });
        }
        if let Some(path) = &scene.posed {
            return posed_body(draper, scene, path);
        }
        let (pose, name) = match &scene.pose {
            None => (Pose::t_pose(0), "T-pose".to_owned()),
            Some(text) => (one_pose(text)?, text.clone()),
        };
        let states = vec![BodyState::new(scene.shape.clone(), pose)];
        Ok(Scenes { states, moments: Vec::new(), body: report(name) })
    }
}

fn no_frame(path: &Path, frame: usize, count: usize) -> Failure {
    miette!(help = "frames count from 0", "{} has {count} frames, no frame {frame}", path.display())
}

/// `FILE.npz` or `FILE.npz:FRAME`.
fn file_and_frame(text: &str) -> (&str, &str) {
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

fn one_pose(text: &str) -> Result<Pose, Failure> {
    let (path, frame) = file_and_frame(text);
    if !Path::new(path).exists() {
        // A word without a dot or a slash is a name, not a file that happens to be missing.
        let is_name = !text.contains('/') && Path::new(path).extension().is_none();
        match named_pose(text) {
            Some(pose) => return Ok(pose),
            None if is_name => {
                return Err(miette!(
                    help = format!(
                        "its names: {}; or give a frame of a motion file, FILE.npz:FRAME",
                        POSE_NAMES.join(", ")
                    ),
                    "--pose {text}: neither a file nor the name of a pose"
                ));
            }
            None => {}
        }
    }
    let frame = frame.parse().map_err(|_| miette!("--pose {text}: {frame:?} is no number of a frame"))?;
    let motion = Motion::load(Path::new(path)).map_err(DatasetError::data)?;
    motion.poses.get(frame).cloned().ok_or_else(|| no_frame(Path::new(path), frame, motion.poses.len()))
}

fn posed_body(draper: &Draper, scene: &SceneArguments, posed: &Path) -> Result<Scenes, Failure> {
    let body = draper.body();
    let read = |path: &Path| Ok::<_, Failure>(load_mesh(path).map_err(DatasetError::data)?.positions);
    let surface = read(posed)?;
    let rest = scene.t_pose.as_deref().map(read).transpose()?;
    let known = match &rest {
        Some(rest) => KnownShape::TPose(rest),
        None => KnownShape::Parameters(&scene.shape),
    };
    let found = recover_body(body, known, &surface).map_err(|e| {
        miette!(
            help = "the mesh must be a pose of the body model: the same vertices in the same order, metres, y up; \
                    and its shape known, by --t-pose or --shape",
            "{}: {e}",
            posed.display()
        )
    })?;
    let report = BodyReport {
        name: body.name.clone(),
        shape: found.shape.clone(),
        pose: posed.display().to_string(),
        vertices: body.vertex_count(),
        triangles: body.faces.len(),
        recovered_within_mm: Some(1e3 * found.mean_distance),
    };
    let state =
        BodyState { shape: found.shape, pose: found.pose, surface: Some(surface), place: found.place };
    Ok(Scenes { states: vec![state], moments: Vec::new(), body: report })
}

/// `sources` in the order of `numbers`.
pub(super) fn ordered(
    sources: Vec<GivenGarment>,
    numbers: Option<&[usize]>,
) -> Result<Vec<GivenGarment>, Failure> {
    let Some(numbers) = numbers else { return Ok(sources) };
    let mut sorted = numbers.to_vec();
    sorted.sort_unstable();
    if !sorted.iter().copied().eq(0..sources.len()) {
        let example: Vec<String> = (0..sources.len()).rev().map(|n| n.to_string()).collect();
        return Err(miette!(
            help = format!(
                "name each of the {} garments once, for example --order {}",
                sources.len(),
                example.join(",")
            ),
            "--order {} is no order of {} garments",
            numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(","),
            sources.len()
        ));
    }
    let mut sources: Vec<Option<GivenGarment>> = sources.into_iter().map(Some).collect();
    Ok(numbers.iter().filter_map(|n| sources[*n].take()).collect())
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
