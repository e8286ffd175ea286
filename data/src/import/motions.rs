//! What the motion importers share: names for clips, and writing them.

use super::overwrite::refuse_overwriting;
use super::summary::{ImportError, Progress, Summary};
use super::thinning::{Thinned, Thinning, thin};
use crate::asset::{Body, Motion, Pose, Provenance, skeleton::BODY_JOINT_COUNT};
use crate::check::{impossible_turn, not_upright};
use rayon::prelude::*;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

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
        if file.is_dir() {
            return Err("a folder; name the files in it".into());
        }
        let Retargeted { poses, frame_rate, skeleton, remark } =
            retarget(file).map_err(|e| short(&e, file))?;
        let warnings = [impossible_turn(&poses), not_upright(&poses)];
        let warning: String = warnings.into_iter().flatten().map(|warning| format!("; {warning}")).collect();
        let Thinned { poses, frame_rate, note } = thin(poses, frame_rate, &settings.thinning);
        let source = provenance_of(file, &settings.provenance);
        let motion = Motion { name: String::new(), frame_rate, poses, source };
        Ok((motion, format!("{skeleton}, {note}{remark}{warning}")))
    };
    write_motions(&inputs, settings.body_file.as_deref(), out, expected, &import, progress)
}

/// A file and the name its clip gets.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NamedFile {
    pub path: PathBuf,
    pub name: String,
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

/// Imports each file with `import`, which gives a motion and a line about it, several at a time, and writes the motions to `out`.
/// What cannot be used is skipped with its reason. Nothing is written over an input, nor over `body_file`.
pub(super) fn write_motions(
    inputs: &[NamedFile],
    body_file: Option<&Path>,
    out: &Path,
    expected: &str,
    import: &(dyn Fn(&Path) -> Result<(Motion, String), String> + Sync),
    progress: Progress<'_>,
) -> Result<Summary, ImportError> {
    let written = |name: &str| out.join(format!("{name}.npz"));
    let outputs = inputs.iter().map(|input| written(&input.name));
    refuse_overwriting(inputs.iter().map(|input| input.path.as_path()).chain(body_file), outputs)?;
    let mut summary = Summary::default();
    let (mut done, mut frames, mut seconds) = (0, 0, 0.0);
    for chunk in inputs.chunks(16) {
        let clips: Vec<_> = chunk.par_iter().map(|input| import(&input.path)).collect();
        for (NamedFile { path, name }, clip) in chunk.iter().zip(clips) {
            done += 1;
            progress("importing motions", done, inputs.len());
            // What no motion file may hold is not written either.
            match clip.and_then(|(motion, note)| motion.check().map(|()| (motion, note))) {
                Ok((motion, note)) => {
                    let written = written(name);
                    motion.save(&written)?;
                    frames += motion.poses.len();
                    seconds += motion.poses.len() as f64 / motion.frame_rate;
                    summary.taken.push((name.clone(), note));
                    summary.written.push(written);
                }
                Err(reason) => summary.skipped.push((path.display().to_string(), reason)),
            }
        }
    }
    if let (Some((first, reason)), true) = (summary.skipped.first(), summary.taken.is_empty()) {
        return Err(ImportError::Refused(format!(
            "none of the {} {expected} could be used; the first, {first}: {reason}",
            inputs.len()
        )));
    }
    summary.notes.push(format!(
        "{frames} frames ({:.1} minutes) in {} clips",
        seconds / 60.0,
        summary.taken.len()
    ));
    Ok(summary)
}
