//! One outfit to be draped, and the bodies it is draped on.

use crate::cli::values::shape_parameter;
use crate::dataset::DatasetError;
use crate::inference::{Bodies, Draper, FrameRange, check_body_mesh, file_and_frame, read_pose};
use clap::Args;
use clothcombo_data::asset::{GarmentMaterial, KnownShape, Motion, Pose};
use clothcombo_data::fit::FitSettings;
use clothcombo_data::format::load_mesh;
use miette::{Report, miette};
use std::path::{Path, PathBuf};

/// Shape, pose or motion of the body.
#[derive(Args, Clone, Debug, Default)]
pub(super) struct SceneArguments {
    /// Shape parameters; missing ones are 0
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_name = "NUMBERS",
          value_parser = shape_parameter)]
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
    /// Takes every Nth frame of the motion
    #[arg(long, value_name = "N", requires = "moving", value_parser = clap::value_parser!(u32).range(1..))]
    pub every: Option<u32>,
    /// A mesh of the posed body, with the vertices of the body model: the pose is recovered from it
    #[arg(long, value_name = "MESH")]
    pub posed: Option<PathBuf>,
    /// The same body in T-pose, from which the shape is recovered; without it, it is that of --shape
    #[arg(long, value_name = "MESH", requires = "posed", conflicts_with = "shape")]
    pub t_pose: Option<PathBuf>,
}

/// A garment that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RequestedGarment {
    /// File or name.
    pub name: String,
    /// What is known about it.
    pub hints: FitSettings,
    /// What it is made of, where that is said.
    pub material: GarmentMaterial,
}

/// One outfit to be draped.
#[derive(Clone, Debug)]
pub(super) struct Job {
    /// Name of its folder among several.
    pub name: String,
    /// Innermost first.
    pub garments: Vec<RequestedGarment>,
    /// The body.
    pub scene: SceneArguments,
}

impl Job {
    /// Files that are read beside those of the garments.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        let SceneArguments { pose, motion, posed, t_pose, .. } = &self.scene;
        let pose = pose.iter().map(|pose| PathBuf::from(file_and_frame(pose).0));
        let scene = pose.chain([motion, posed, t_pose].into_iter().flatten().cloned());
        let bodies = self.garments.iter().filter_map(|garment| garment.hints.from_body.as_deref());
        let bodies = bodies.map(|body| body.path().to_owned());
        bodies.chain(scene)
    }

    /// Reads pose, motion or meshes.
    pub fn bodies(&self, draper: &Draper) -> Result<Bodies, Report> {
        let (body, scene) = (draper.body(), &self.scene);
        let read = |flag: &str, path: &Path| {
            let positions = load_mesh(path).map_err(DatasetError::data)?.positions;
            check_body_mesh(body, &format!("{flag} {}", path.display()), &positions)?;
            Ok::<_, Report>(positions)
        };
        if let Some(path) = &scene.motion {
            let motion = Motion::load(path).map_err(DatasetError::data)?;
            let (frames, every) = (scene.frames.unwrap_or_default(), scene.every.unwrap_or(1) as usize);
            let name = path.display().to_string();
            return Bodies::in_motion(body, &scene.shape, &motion, &name, frames, every);
        }
        if let Some(path) = &scene.posed {
            let surface = read("--posed", path)?;
            let rest = scene.t_pose.as_deref().map(|path| read("--t-pose", path)).transpose()?;
            let known = match &rest {
                Some(rest) => KnownShape::TPose(rest),
                None => KnownShape::Parameters(&scene.shape),
            };
            return Bodies::of_surface(body, surface, known, &path.display().to_string());
        }
        let (pose, name) = match &scene.pose {
            None => (Pose::t_pose(0), "T-pose"),
            Some(text) => (read_pose(text)?, text.as_str()),
        };
        Ok(Bodies::in_pose(body, &scene.shape, pose, name))
    }
}

/// `garments` in the order of `numbers`.
pub(super) fn ordered(
    garments: Vec<RequestedGarment>,
    numbers: Option<&[usize]>,
) -> Result<Vec<RequestedGarment>, Report> {
    let Some(numbers) = numbers else { return Ok(garments) };
    let mut sorted = numbers.to_vec();
    sorted.sort_unstable();
    if !sorted.iter().copied().eq(0..garments.len()) {
        let example: Vec<String> = (0..garments.len()).rev().map(|n| n.to_string()).collect();
        return Err(miette!(
            help = format!(
                "name each of the {} garments once, for example --order {}",
                garments.len(),
                example.join(",")
            ),
            "--order {} is no order of {} garments",
            numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(","),
            garments.len()
        ));
    }
    Ok(numbers.iter().map(|n| garments[*n].clone()).collect())
}
