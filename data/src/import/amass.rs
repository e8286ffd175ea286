//! SMPL motions as public tools write them: AMASS (`*_poses.npz`, `*_stageii.npz`), AIST++, SMPLify-X and their like.
//!
//! Mahmood et al., "AMASS: Archive of Motion Capture as Surface Shapes", 2019. [`MotionFile`] reads the layouts. The root and the
//! 21 body joints are kept; hands, jaw, eyes, soft tissue, shape and translation are left out, because clothes are draped about
//! the pelvis of a body of their own. The turn to y up goes into the root. The heading stays in the root, as in every motion file
//! here; whoever samples poses removes it.

use super::find_files::find_files;
use super::motions::{named, short, stem, write_motions};
use super::summary::{ImportError, Progress, Summary};
use super::thinning::{Thinned, Thinning, thin};
use super::up_axis::{WorldUp, undecided};
use crate::asset::motion::{MotionFile, check_frame_rate, holds_poses, mean_up};
use crate::asset::{Motion, Provenance};
use crate::check::impossible_turn;
use crate::format::NpzFile;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// How motions are imported.
#[derive(Clone, Debug, PartialEq)]
pub struct AmassSettings {
    /// Which frames are kept.
    pub thinning: Thinning,
    /// The axis that is up in the files; `None` takes the one along which the bodies below an input stand on average.
    pub up: Option<WorldUp>,
    /// Frame rate of files without one (frames/s); a file with another one is refused.
    pub rate: Option<f64>,
}

impl Default for AmassSettings {
    fn default() -> Self {
        let thinning = Thinning { frame_rate: 30.0, static_threshold: 0.5f64.to_radians() };
        Self { thinning, up: None, rate: None }
    }
}

const EXPECTED: &str = "AMASS motions (.npz)";

/// So many files of a folder are asked for its up axis.
const ASKED_FOR_UP: usize = 32;

/// Imports SMPL motions from files and, recursively, from folders as motion npz files in the folder `out`. A clip is called
/// after its path below the folder given (`CMU/01/01_01_poses.npz` in `AMASS` becomes `CMU_01_01_01`). Files that hold no
/// motion are skipped with their reason.
///
/// # Errors
/// If a folder cannot be read, no file can be used, or a result cannot be written.
pub fn import_amass(
    inputs: &[PathBuf],
    out: &Path,
    settings: &AmassSettings,
    progress: Progress<'_>,
) -> Result<Summary, ImportError> {
    let mut files = Vec::new();
    let mut axes = HashMap::new();
    let mut notes = Vec::new();
    progress("looking for motions", 0, 1);
    for input in inputs {
        let found = find_files(input, "npz", out)?;
        let axis = settings.up.map_or_else(|| standing_axis(&found, settings.rate), Ok);
        if let (Ok(axis), None) = (&axis, settings.up) {
            notes.push(format!("{}: {} is up, as the bodies stand (--up)", input.display(), axis.name()));
        }
        axes.extend(found.iter().map(|path| (path.clone(), axis.clone())));
        files.extend(found.into_iter().map(|path| (path.clone(), clip_name(input, &path))));
    }
    progress("looking for motions", 1, 1);
    if files.is_empty() {
        let shown: Vec<String> = inputs.iter().map(|i| i.display().to_string()).collect();
        let where_ = if shown.is_empty() { String::new() } else { format!("{}: ", shown.join(", ")) };
        return Err(ImportError::Refused(format!("{where_}no {EXPECTED} found")));
    }
    let files = named(files);
    let import = |file: &Path| {
        let axis = axes.get(file).cloned().unwrap_or(Ok(WorldUp::Y));
        import_file(file, axis, settings)
    };
    let mut summary = write_motions(&files, None, out, EXPECTED, &import, progress)?;
    summary.notes.extend(notes);
    summary.notes.push(format!(
        "kept are the root, turned to y up, and the 21 body joints; a frame that differs from the last one kept by less than \
         {:.2}° in every joint is dropped",
        settings.thinning.static_threshold.to_degrees()
    ));
    Ok(summary)
}

/// The axis along which the bodies in `files`, which come from one source, stand on average, or why it is not plain. A clip of
/// somebody who lies on the floor is thus read as its neighbours are.
fn standing_axis(files: &[PathBuf], rate: Option<f64>) -> Result<WorldUp, String> {
    let mut mean = [0.0; 3];
    let step = files.len().div_ceil(ASKED_FOR_UP).max(1);
    let readable = files.iter().step_by(step).filter_map(|file| MotionFile::read(file).ok());
    // Only what can be imported has a say.
    let usable = |file: &MotionFile| {
        let has_rate = file.frame_rate(rate).is_ok_and(|rate| check_frame_rate(rate).is_ok());
        has_rate && !file.poses.is_empty()
    };
    let finite = |up: &[f64; 3]| up.iter().all(|x| x.is_finite());
    let directions: Vec<[f64; 3]> =
        readable.filter(usable).map(|file| mean_up(&file.poses)).filter(finite).collect();
    for direction in &directions {
        (0..3).for_each(|axis| mean[axis] += direction[axis] / directions.len() as f64);
    }
    // Files that cannot be read are refused one by one.
    if directions.is_empty() {
        return Ok(WorldUp::Y);
    }
    WorldUp::of(mean).ok_or_else(|| undecided(mean))
}

/// The path below `root` with underscores, without what every file of AMASS ends in.
fn clip_name(root: &Path, path: &Path) -> String {
    let below = path.strip_prefix(root).ok().and_then(|p| p.parent());
    let folders = below.into_iter().flat_map(Path::iter).map(|part| part.to_string_lossy().into_owned());
    let stem = stem(path);
    let stem = stem.strip_suffix("_poses").or_else(|| stem.strip_suffix("_stageii")).unwrap_or(&stem);
    folders.chain([stem.to_string()]).collect::<Vec<_>>().join("_")
}

fn import_file(
    path: &Path,
    up: Result<WorldUp, String>,
    settings: &AmassSettings,
) -> Result<(Motion, String), String> {
    let mut file = NpzFile::open(path).map_err(|e| short(&e.to_string(), path))?;
    if !holds_poses(&file) {
        return Err(format!(
            "not a motion: no key 'poses', only {}",
            if file.keys().is_empty() { "no arrays at all".into() } else { file.keys().join(", ") }
        ));
    }
    let subject = gender(&mut file);
    let own_source = Provenance::read(&mut file);
    drop(file);
    let file = MotionFile::read(path).map_err(|e| short(&e.to_string(), path))?;
    let frame_rate = file.frame_rate(settings.rate)?;
    let MotionFile { poses, keys, joints, pickled, .. } = file;
    let mut motion = Motion { name: stem(path), frame_rate, poses, source: own_source };
    motion.check()?;
    if motion.poses.is_empty() {
        return Err("it has no frames".into());
    }
    let up = up?;
    let (mean, uprightness) = (mean_up(&motion.poses), up.uprightness(&motion.poses));
    // Somebody may lie on the floor; but not stand along another axis, or on the head.
    let stands_elsewhere = uprightness < 0.2 && WorldUp::of(mean).is_some_and(|axis| axis != up);
    motion.poses.iter_mut().for_each(|pose| up.turn_root_to_y_up(pose));
    let Thinned { poses, frame_rate, note } =
        thin(std::mem::take(&mut motion.poses), frame_rate, &settings.thinning);
    let mut note = format!("{} ({keys}, {joints} joints), {note}", layout(joints));
    if !subject.is_empty() {
        note.push_str(&format!(", {subject}"));
    }
    if !pickled.is_empty() {
        note.push_str(&format!("; not read, Python pickles: {}", pickled.join(", ")));
    }
    if stands_elsewhere || uprightness < -0.2 {
        note.push_str(&format!(
            "; with {} up the body is not upright on average, check the up axis (--up)",
            up.name()
        ));
    }
    if let Some(turn) = impossible_turn(&poses) {
        note.push_str(&format!("; {turn}"));
    }
    motion.poses = poses;
    motion.frame_rate = frame_rate;
    if motion.source == Provenance::default() {
        motion.source = provenance(path, joints);
    }
    Ok((motion, note))
}

/// What a skeleton of so many joints is called.
fn layout(joints: usize) -> &'static str {
    match joints {
        22 => "body joints only",
        24 => "SMPL",
        52 => "SMPL-H",
        55 => "SMPL-X",
        _ => "unknown layout",
    }
}

/// Text or bytes, also as Python prints bytes; empty if it is not there or something else.
fn gender(file: &mut NpzFile) -> String {
    let text = file.text("gender").ok().flatten().unwrap_or_default();
    let text = text.strip_prefix("b'").and_then(|t| t.strip_suffix('\'')).unwrap_or(&text);
    text.trim().to_ascii_lowercase()
}

/// AMASS's for its layouts; of other files nothing is known but the name.
fn provenance(path: &Path, joints: usize) -> Provenance {
    // Collection, subject and clip are the last three parts of AMASS's paths.
    let parts: Vec<_> = path.iter().map(|p| p.to_string_lossy().into_owned()).collect();
    let below = parts[parts.len().saturating_sub(3)..].join("/");
    if !matches!(joints, 52 | 55) {
        return Provenance { source: stem(path), ..Provenance::default() };
    }
    Provenance {
        source: format!("AMASS, {below}"),
        author: "Mahmood et al. 2019 and the authors of the collection".into(),
        licence: "AMASS licence (non-commercial scientific research); see https://amass.is.tue.mpg.de".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clips_are_called_after_their_path_below_the_folder() {
        let name = |root: &str, path: &str| clip_name(Path::new(root), Path::new(path));
        assert_eq!(name("/d/AMASS", "/d/AMASS/CMU/01/01_01_poses.npz"), "CMU_01_01_01");
        assert_eq!(name("a", "a/walk_stageii.npz"), "walk");
        assert_eq!(name("x/walk_poses.npz", "x/walk_poses.npz"), "walk");
        let input = |p: &str| (PathBuf::from(p), "walk".to_string());
        let names: Vec<String> =
            named([input("a"), input("b"), input("c")]).into_iter().map(|i| i.name).collect();
        assert_eq!(names, ["walk", "walk_2", "walk_3"]);
    }
}
