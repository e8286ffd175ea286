//! AMASS: SMPL-H (`*_poses.npz`) and SMPL-X (`*_stageii.npz`) motions.
//!
//! Mahmood et al., "AMASS: Archive of Motion Capture as Surface Shapes", 2019. The first 66 numbers of a row of `poses` are
//! the root and the 21 body joints in either layout; hands, jaw, eyes, soft tissue, shape and translation are left out, because
//! clothes are draped about the pelvis of a body of their own. The world's z axis is up there; the turn to y up goes into
//! the root. The heading stays in the root, as in every motion file here; whoever samples poses removes it.

use super::motions::{Clip, NamedFile, named, stem, write_motions};
use super::summary::{ImportError, Progress, Summary};
use super::thinning::{Thinned, Thinning, thin};
use crate::asset::motion::{along_z, stands_along_z};
use crate::asset::rotation::{Matrix3, axis_angle_from_matrix, matrix_from_axis_angle, product};
use crate::asset::{Motion, Pose, Provenance};
use crate::check::impossible_turn;
use crate::format::{FileError, NpzFile, folder};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

/// How motions are imported.
#[derive(Clone, Debug, PartialEq)]
pub struct AmassSettings {
    /// Which frames are kept.
    pub thinning: Thinning,
    /// Whether z is up in the files, as AMASS and CLOTH3D have it, instead of y.
    pub z_up: bool,
}

impl Default for AmassSettings {
    fn default() -> Self {
        let thinning = Thinning { frame_rate: 30.0, static_threshold: 0.5f64.to_radians() };
        Self { thinning, z_up: true }
    }
}

const EXPECTED: &str = "AMASS motions (.npz)";
const DEEPEST: usize = 32;

/// Turns a z-up world into a y-up one: (x, y, z) becomes (x, z, −y).
pub(super) const Y_UP_FROM_Z_UP: Matrix3 = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];

/// Turns the root of a pose from a z-up world into a y-up one.
pub(super) fn turn_root_to_y_up(pose: &mut Pose) {
    if let Some(root) = pose.rotations.first_mut() {
        *root = axis_angle_from_matrix(&product(&Y_UP_FROM_Z_UP, &matrix_from_axis_angle(*root)));
    }
}

/// Imports AMASS motions from files and, recursively, from folders as motion npz files in the folder `out`. A clip is called
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
    let mut files: Vec<NamedFile> = Vec::new();
    progress("looking for motions", 0, 1);
    for input in inputs {
        let mut found = Vec::new();
        // What was imported before is no input, unless it is asked for.
        let below =
            fs::canonicalize(out).ok().filter(|out| fs::canonicalize(input).ok().as_ref() != Some(out));
        let mut seen = HashSet::from_iter(below);
        find(input, &mut found, &mut seen, 0)?;
        files.extend(found.into_iter().map(|path| NamedFile { name: clip_name(input, &path), path }));
    }
    progress("looking for motions", 1, 1);
    if files.is_empty() {
        let shown: Vec<String> = inputs.iter().map(|i| i.display().to_string()).collect();
        let where_ = if shown.is_empty() { String::new() } else { format!("{}: ", shown.join(", ")) };
        return Err(ImportError::Refused(format!("{where_}no {EXPECTED} found")));
    }
    let files = named(files.into_iter().map(|f| (f.path, f.name)));
    let import = |file: &Path| import_file(file, settings);
    let mut summary = write_motions(&files, None, out, EXPECTED, &import, progress)?;
    summary.notes.push(format!(
        "kept are the root and the 21 body joints; {}; a frame that differs from the last one kept by less than {:.2}° in \
         every joint is dropped",
        if settings.z_up { "the root was turned from z up to y up" } else { "y was taken as the up axis" },
        settings.thinning.static_threshold.to_degrees()
    ));
    Ok(summary)
}

/// All `.npz` files below `path`, in order of their names. Links that lead back are followed once.
fn find(
    path: &Path,
    found: &mut Vec<PathBuf>,
    seen: &mut HashSet<PathBuf>,
    depth: usize,
) -> Result<(), FileError> {
    let failed = FileError::io(path);
    if !fs::metadata(path).map_err(&failed)?.is_dir() {
        found.push(path.into());
        return Ok(());
    }
    if depth > DEEPEST || !seen.insert(fs::canonicalize(path).map_err(&failed)?) {
        return Ok(());
    }
    for entry in folder::entries(path)? {
        if entry.is_dir() || folder::has_extension(&entry, "npz") {
            find(&entry, found, seen, depth + 1)?;
        }
    }
    Ok(())
}

/// The path below `root` with underscores, without what every file of AMASS ends in.
fn clip_name(root: &Path, path: &Path) -> String {
    let below = path.strip_prefix(root).ok().and_then(|p| p.parent());
    let folders = below.into_iter().flat_map(Path::iter).map(|part| part.to_string_lossy().into_owned());
    let stem = stem(path);
    let stem = stem.strip_suffix("_poses").or_else(|| stem.strip_suffix("_stageii")).unwrap_or(&stem);
    folders.chain([stem.to_string()]).collect::<Vec<_>>().join("_")
}

fn import_file(path: &Path, settings: &AmassSettings) -> Result<Clip, String> {
    let mut file = NpzFile::open(path).map_err(|e| short(e, path))?;
    if !file.contains("poses") {
        return Err(format!(
            "not a motion: no key 'poses', only {}",
            if file.keys().is_empty() { "no arrays at all".into() } else { file.keys().join(", ") }
        ));
    }
    let subject = gender(&mut file);
    let layout = |columns: usize| match columns {
        66 => "body joints only",
        72 => "SMPL",
        156 => "SMPL-H",
        165 => "SMPL-X",
        _ => "unknown layout",
    };
    drop(file);
    let (mut motion, columns) = Motion::load_with_columns(path).map_err(|e| short(e, path))?;
    if motion.poses.is_empty() {
        return Err("it has no frames".into());
    }
    let rate = motion.frame_rate;
    if settings.z_up {
        motion.poses.iter_mut().for_each(turn_root_to_y_up);
    }
    let lying = mean_uprightness(&motion.poses);
    let Thinned { poses, frame_rate, note } =
        thin(std::mem::take(&mut motion.poses), rate, &settings.thinning);
    let mut note = format!("{} ({columns} columns), {note}", layout(columns));
    if !subject.is_empty() {
        note.push_str(&format!(", {subject}"));
    }
    let was_turned_wrongly = if settings.z_up { looks_y_up(&poses) } else { stands_along_z(&poses) };
    if lying < -0.2 || (lying.abs() < 0.2 && was_turned_wrongly) {
        note.push_str("; the body is not upright on average, check the up axis (--up)");
    }
    if let Some(turn) = impossible_turn(&poses) {
        note.push_str(&format!("; {turn}"));
    }
    motion.poses = poses;
    motion.frame_rate = frame_rate;
    if motion.source == Provenance::default() {
        motion.source = provenance(path);
    }
    Ok(Clip { motion, subject, note })
}

/// Mean of the world's vertical component of the body's own vertical axis: 1 upright, 0 lying, −1 upside down.
fn mean_uprightness(poses: &[Pose]) -> f64 {
    poses.iter().map(|p| matrix_from_axis_angle(p.rotation(0))[1][1]).sum::<f64>() / poses.len().max(1) as f64
}

/// Whether undoing the turn from z up would make the body stand.
fn looks_y_up(poses: &[Pose]) -> bool {
    // Row 1 of Yᵀ·R is −row 2 of R.
    along_z(poses) < -0.7
}

/// Text or bytes, also as Python prints bytes; empty if it is not there or something else.
fn gender(file: &mut NpzFile) -> String {
    let text = file.text("gender").ok().flatten().unwrap_or_default();
    let text = text.strip_prefix("b'").and_then(|t| t.strip_suffix('\'')).unwrap_or(&text);
    text.trim().to_ascii_lowercase()
}

fn provenance(path: &Path) -> Provenance {
    // Collection, subject and clip are the last three parts of AMASS's paths.
    let parts: Vec<_> = path.iter().map(|p| p.to_string_lossy().into_owned()).collect();
    let below = parts[parts.len().saturating_sub(3)..].join("/");
    Provenance {
        source: format!("AMASS, {below}"),
        author: "Mahmood et al. 2019 and the authors of the collection".into(),
        licence: "AMASS licence (non-commercial scientific research); see https://amass.is.tue.mpg.de".into(),
    }
}

/// The message without the path, which the summary shows beside it.
fn short(error: FileError, path: &Path) -> String {
    let (message, prefix) = (error.to_string(), format!("{}: ", path.display()));
    message.strip_prefix(&prefix).unwrap_or(&message).to_string()
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

    #[test]
    fn a_body_standing_in_a_z_up_world_stands_in_a_y_up_one_and_keeps_its_heading() {
        use std::f64::consts::FRAC_PI_2;
        let mut pose = Pose::t_pose(22);
        pose.rotations[0] = [FRAC_PI_2, 0.0, 0.0];
        turn_root_to_y_up(&mut pose);
        assert!(pose.rotations[0].iter().all(|x| x.abs() < 1e-12));
        // Turned by 1 rad about the world's vertical.
        let turned =
            product(&matrix_from_axis_angle([0.0, 0.0, 1.0]), &matrix_from_axis_angle([FRAC_PI_2, 0.0, 0.0]));
        pose.rotations[0] = axis_angle_from_matrix(&turned);
        turn_root_to_y_up(&mut pose);
        let expected = [0.0, 1.0, 0.0];
        assert!(pose.rotations[0].iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
        assert!(mean_uprightness(&[pose]) > 0.999);
        let mut wrong = Pose::t_pose(22);
        turn_root_to_y_up(&mut wrong);
        assert!(looks_y_up(&[wrong]));
    }
}
