//! What the motion importers share: names for clips, writing them, and the manifest `motions.toml` beside them.
//!
//! ```toml
//! [[motion]]
//! file = "CMU_01_01_01.npz"
//! frames = 1240
//! frame_rate = 30.0
//! subject = "male"          # where the source says so
//! source = "…"
//! author = "…"
//! licence = "…"
//! ```

use super::overwrite::refuse_overwriting;
use super::summary::{ImportError, Progress, Summary};
use super::thinning::{Thinned, Thinning, thin};
use crate::asset::{Body, Motion, Pose, Provenance, skeleton::BODY_JOINT_COUNT};
use crate::check::{impossible_turn, not_upright};
use crate::format::{FileError, toml_file};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Name of the manifest in a motion folder.
pub const MOTION_MANIFEST: &str = "motions.toml";

/// How motions of other skeletons are imported.
#[derive(Clone, Debug, PartialEq)]
pub struct RetargetSettings {
    /// Which frames are kept.
    pub thinning: Thinning,
    /// Where the motions come from; the files themselves do not say.
    pub provenance: Provenance,
    /// The file that the body came from, which no motion may take the place of.
    pub body_file: Option<PathBuf>,
}

impl Default for RetargetSettings {
    fn default() -> Self {
        let thinning = Thinning { frame_rate: 60.0, static_threshold: 0.0 };
        Self { thinning, provenance: Provenance::default(), body_file: None }
    }
}

/// The motion of another skeleton, carried over to the body joints.
pub(super) struct Retargeted {
    pub poses: Vec<Pose>,
    /// Frames per second.
    pub frame_rate: f64,
    /// What the skeleton is called.
    pub skeleton: String,
    /// What else to say, or nothing.
    pub remark: &'static str,
}

/// Imports each file with `retarget` as a motion of `body`; see [`write_motions`].
pub(super) fn write_retargeted(
    files: &[PathBuf],
    body: &Body,
    out: &Path,
    settings: &RetargetSettings,
    expected: &str,
    retarget: &(dyn Fn(&Path) -> Result<Retargeted, String> + Sync),
    progress: Progress<'_>,
) -> Result<Summary, ImportError> {
    if files.is_empty() {
        return Err(ImportError::Refused(format!("no {expected} found")));
    }
    if body.joint_count() < BODY_JOINT_COUNT {
        return Err(ImportError::Refused(format!(
            "body '{}' has {} joints; retargeting needs the {BODY_JOINT_COUNT} SMPL body joints",
            body.name,
            body.joint_count()
        )));
    }
    let inputs = named(files.iter().map(|f| (f.clone(), stem(f))));
    let import = |file: &Path| {
        let Retargeted { poses, frame_rate, skeleton, remark } =
            retarget(file).map_err(|e| short(&e, file))?;
        let warnings = [impossible_turn(&poses), not_upright(&poses)];
        let warning: String = warnings.into_iter().flatten().map(|warning| format!("; {warning}")).collect();
        let Thinned { poses, frame_rate, note } = thin(poses, frame_rate, &settings.thinning);
        let source = provenance_of(file, &settings.provenance);
        let motion = Motion { name: String::new(), frame_rate, poses, source };
        Ok(ImportedClip {
            motion,
            subject: String::new(),
            note: format!("{skeleton}, {note}{remark}{warning}"),
        })
    };
    write_motions(&inputs, settings.body_file.as_deref(), out, expected, &import, progress)
}

/// A clip made from one file.
pub(super) struct ImportedClip {
    /// The motion; its name is overwritten.
    pub motion: Motion,
    /// Gender or name of the person, empty where unknown.
    pub subject: String,
    /// A line about it.
    pub note: String,
}

/// A file and the name its clip gets.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NamedFile {
    pub path: PathBuf,
    pub name: String,
}

#[derive(Default, Serialize, Deserialize)]
struct MotionManifest {
    #[serde(default)]
    motion: Vec<MotionEntry>,
}

#[derive(Serialize, Deserialize)]
struct MotionEntry {
    file: String,
    frames: usize,
    frame_rate: f64,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    subject: String,
    #[serde(flatten)]
    source: Provenance,
}

/// Names clips after their files; equal names get a number.
pub(super) fn named(files: impl IntoIterator<Item = (PathBuf, String)>) -> Vec<NamedFile> {
    let mut taken = HashSet::new();
    let mut inputs = Vec::new();
    for (path, wanted) in files {
        let mut name = wanted.clone();
        let mut number = 2;
        while !taken.insert(name.clone()) {
            name = format!("{wanted}_{number}");
            number += 1;
        }
        inputs.push(NamedFile { path, name });
    }
    inputs
}

/// The file's name without its extension.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "motion".into(), |s| s.to_string_lossy().into_owned())
}

/// The message without the path, which the summary shows beside it.
pub(super) fn short(message: &str, path: &Path) -> String {
    message.strip_prefix(&format!("{}: ", path.display())).unwrap_or(message).to_string()
}

/// Where the motion of `file` comes from: what was given, with the file's name.
fn provenance_of(file: &Path, given: &Provenance) -> Provenance {
    let source = match given.source.as_str() {
        "" => stem(file),
        source => format!("{source} ({})", stem(file)),
    };
    Provenance { source, ..given.clone() }
}

/// Imports each file with `import`, several at a time; writes the clips to `out` and records them in its manifest. What cannot
/// be used is skipped with its reason. Nothing is written over an input, nor over `body_file`.
pub(super) fn write_motions(
    inputs: &[NamedFile],
    body_file: Option<&Path>,
    out: &Path,
    expected: &str,
    import: &(dyn Fn(&Path) -> Result<ImportedClip, String> + Sync),
    progress: Progress<'_>,
) -> Result<Summary, ImportError> {
    let written = |name: &str| out.join(format!("{name}.npz"));
    let outputs = inputs.iter().map(|input| written(&input.name)).chain([out.join(MOTION_MANIFEST)]);
    refuse_overwriting(inputs.iter().map(|input| input.path.as_path()).chain(body_file), outputs)?;
    let mut summary = Summary::default();
    let mut manifest = read_manifest(out)?;
    let (mut done, mut frames, mut seconds) = (0, 0, 0.0);
    for chunk in inputs.chunks(16) {
        let clips: Vec<_> = chunk.par_iter().map(|input| import(&input.path)).collect();
        for (NamedFile { path, name }, clip) in chunk.iter().zip(clips) {
            done += 1;
            progress("importing motions", done, inputs.len());
            // What no motion file may hold is not written either.
            let valid = clip.and_then(|clip| clip.motion.check().map(|()| clip));
            let ImportedClip { mut motion, subject, note } = match valid {
                Ok(clip) => clip,
                Err(reason) => {
                    summary.skipped.push((path.display().to_string(), reason));
                    continue;
                }
            };
            motion.name = name.clone();
            let (file, written) = (format!("{name}.npz"), written(name));
            motion.save(&written)?;
            frames += motion.poses.len();
            seconds += motion.poses.len() as f64 / motion.frame_rate;
            summary.taken.push((name.clone(), note));
            summary.written.push(written);
            manifest.motion.retain(|entry| entry.file != file);
            manifest.motion.push(MotionEntry {
                file,
                frames: motion.poses.len(),
                frame_rate: motion.frame_rate,
                subject,
                source: motion.source,
            });
        }
    }
    if let (Some((first, reason)), true) = (summary.skipped.first(), summary.taken.is_empty()) {
        return Err(ImportError::Refused(format!(
            "none of the {} {expected} could be used; the first, {first}: {reason}",
            inputs.len()
        )));
    }
    summary.written.push(write_manifest(out, manifest)?);
    summary.notes.push(format!(
        "{frames} frames ({:.1} minutes) in {} clips",
        seconds / 60.0,
        summary.taken.len()
    ));
    Ok(summary)
}

fn read_manifest(out: &Path) -> Result<MotionManifest, FileError> {
    match toml_file::load(&out.join(MOTION_MANIFEST)) {
        Err(FileError::Content { path, message }) => {
            Err(FileError::content(&path)(format!("{message}; remove it or choose another folder")))
        }
        manifest => Ok(manifest?.unwrap_or_default()),
    }
}

fn write_manifest(out: &Path, mut manifest: MotionManifest) -> Result<PathBuf, FileError> {
    let path = out.join(MOTION_MANIFEST);
    manifest.motion.sort_by(|a, b| a.file.cmp(&b.file));
    toml_file::save(&path, &manifest)?;
    Ok(path)
}
