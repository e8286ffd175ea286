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

use super::overwrite::{OverwriteError, refuse_overwriting};
use super::{Progress, Summary};
use crate::asset::motion::MotionError;
use crate::asset::{Body, Motion, Provenance, skeleton::BODY_JOINT_COUNT};
use crate::format::{FileError, atomic};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Name of the manifest in a motion folder.
pub const MANIFEST: &str = "motions.toml";

/// Why motions cannot be imported at all. What is wrong with a single file stands in the summary.
#[derive(Debug, Error)]
pub enum MotionImportError {
    /// No input.
    #[error("{where_}no {expected} found")]
    NoInput {
        /// The inputs and a colon, or nothing.
        where_: String,
        /// What was looked for.
        expected: &'static str,
    },
    /// None of the inputs could be used.
    #[error("none of the {count} {expected} could be used; the first, {first}: {reason}")]
    NothingUsable {
        /// How many there were.
        count: usize,
        /// What they should be.
        expected: &'static str,
        /// The first of them.
        first: String,
        /// Its problem.
        reason: String,
    },
    /// A folder or the manifest cannot be read or written.
    #[error(transparent)]
    Io(#[from] FileError),
    /// The manifest that is already there is not one.
    #[error("{}: {message}; remove it or choose another folder", path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// What the TOML reader said.
        message: String,
    },
    /// A result cannot be written.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// An input would be written over.
    #[error(transparent)]
    Overwrite(#[from] OverwriteError),
    /// The body lacks joints.
    #[error("body '{body}' has {joints} joints; retargeting needs the {BODY_JOINT_COUNT} SMPL body joints")]
    Body {
        /// The body.
        body: String,
        /// How many joints it has.
        joints: usize,
    },
}

/// Refuses bodies without the 22 joints motions are carried over to.
pub(super) fn require_body_joints(body: &Body) -> Result<(), MotionImportError> {
    if body.joint_count() < BODY_JOINT_COUNT {
        return Err(MotionImportError::Body { body: body.name.clone(), joints: body.joint_count() });
    }
    Ok(())
}

/// A clip made from one file.
pub(super) struct Clip {
    /// The motion; its name is overwritten.
    pub motion: Motion,
    /// Gender or name of the person, empty where unknown.
    pub subject: String,
    /// A line about it.
    pub note: String,
}

/// A file and the name its clip gets.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Input {
    pub path: PathBuf,
    pub name: String,
}

#[derive(Default, Serialize, Deserialize)]
struct Manifest {
    #[serde(default)]
    motion: Vec<Entry>,
}

#[derive(Serialize, Deserialize)]
struct Entry {
    file: String,
    frames: usize,
    frame_rate: f64,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    subject: String,
    source: String,
    author: String,
    licence: String,
}

/// Names clips after their files; equal names get a number.
pub(super) fn named(files: impl IntoIterator<Item = (PathBuf, String)>) -> Vec<Input> {
    let mut taken = HashSet::new();
    let mut inputs = Vec::new();
    for (path, wanted) in files {
        let mut name = wanted.clone();
        let mut number = 2;
        while !taken.insert(name.clone()) {
            name = format!("{wanted}_{number}");
            number += 1;
        }
        inputs.push(Input { path, name });
    }
    inputs
}

/// The file's name without its extension.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "motion".into(), |s| s.to_string_lossy().into_owned())
}

/// Where the motion of `file` comes from: what was given, with the file's name.
pub(super) fn provenance_of(file: &Path, given: &Provenance) -> Provenance {
    let source = match given.source.as_str() {
        "" => stem(file),
        source => format!("{source} ({})", stem(file)),
    };
    Provenance { source, ..given.clone() }
}

/// Imports each file with `import`, several at a time; writes the clips to `out` and records them in its manifest. What cannot
/// be used is skipped with its reason. Nothing is written over an input, nor over `body_file`.
pub(super) fn write_motions(
    inputs: &[Input],
    body_file: Option<&Path>,
    out: &Path,
    expected: &'static str,
    import: &(dyn Fn(&Path) -> Result<Clip, String> + Sync),
    progress: Progress<'_>,
) -> Result<Summary, MotionImportError> {
    let written = |name: &str| out.join(format!("{name}.npz"));
    let outputs = inputs.iter().map(|input| written(&input.name)).chain([out.join(MANIFEST)]);
    refuse_overwriting(inputs.iter().map(|input| input.path.as_path()).chain(body_file), outputs)?;
    let mut summary = Summary::default();
    let mut manifest = read_manifest(out)?;
    let (mut done, mut frames, mut seconds) = (0, 0, 0.0);
    for chunk in inputs.chunks(16) {
        let clips: Vec<_> = chunk.par_iter().map(|input| import(&input.path)).collect();
        for (Input { path, name }, clip) in chunk.iter().zip(clips) {
            done += 1;
            progress("importing motions", done, inputs.len());
            // What no motion file may hold is not written either.
            let valid = clip.and_then(|clip| match clip.motion.check() {
                Ok(()) => Ok(clip),
                Err(defect) => Err(defect.to_string()),
            });
            let Clip { mut motion, subject, note } = match valid {
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
            manifest.motion.push(Entry {
                file,
                frames: motion.poses.len(),
                frame_rate: motion.frame_rate,
                subject,
                source: motion.source.source,
                author: motion.source.author,
                licence: motion.source.licence,
            });
        }
    }
    if let (Some((first, reason)), true) = (summary.skipped.first(), summary.taken.is_empty()) {
        let (first, reason) = (first.clone(), reason.clone());
        return Err(MotionImportError::NothingUsable { count: inputs.len(), expected, first, reason });
    }
    summary.written.push(write_manifest(out, manifest)?);
    summary.notes.push(format!(
        "{frames} frames ({:.1} minutes) in {} clips",
        seconds / 60.0,
        summary.taken.len()
    ));
    Ok(summary)
}

fn read_manifest(out: &Path) -> Result<Manifest, MotionImportError> {
    let path = out.join(MANIFEST);
    match fs::read_to_string(&path) {
        Ok(text) => toml::from_str(&text)
            .map_err(|e| MotionImportError::Manifest { path, message: e.to_string().trim_end().to_string() }),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(Manifest::default()),
        Err(reason) => Err(FileError { path, reason }.into()),
    }
}

fn write_manifest(out: &Path, mut manifest: Manifest) -> Result<PathBuf, MotionImportError> {
    let path = out.join(MANIFEST);
    manifest.motion.sort_by(|a, b| a.file.cmp(&b.file));
    let text = toml::to_string(&manifest)
        .map_err(|e| MotionImportError::Manifest { path: path.clone(), message: e.to_string() })?;
    atomic::write(&path, text.as_bytes()).map_err(FileError::at(&path))?;
    Ok(path)
}
