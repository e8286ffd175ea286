//! Motion capture in Acclaim form, as the CMU Graphics Lab Motion Capture Database has it: a skeleton (`.asf`) and its motions
//! (`.amc`), retargeted to the 22 SMPL body joints; see [`super::rig`].

mod motion;
mod skeleton;
mod words;

use super::find_files::find_files;
use super::motions::{RetargetSettings, write_retargeted};
use super::rig::{JointFile, Recording, retargeted};
use super::summary::{ImportError, Progress, Summary};
use crate::asset::Body;
use crate::asset::motion::check_frame_rate;
use crate::format::{FileError, folder};
use skeleton::AcclaimSkeleton;
use std::fs;
use std::path::{Path, PathBuf};

/// How ASF/AMC motions are imported.
#[derive(Clone, Debug, PartialEq)]
pub struct AmcSettings {
    /// What all retargeted motions share.
    pub retarget: RetargetSettings,
    /// Frame rate of the motions, whose files do not say it (frames/s). That of the CMU database is 120.
    pub rate: f64,
    /// The skeleton of all motions; `None` takes the one beside each.
    pub skeleton: Option<PathBuf>,
}

/// Imports AMC files, and those that are found in folders, as motion npz files in the folder `out`, retargeted to `body`. The
/// file `joints` names the joints of rigs whose names are not known. Files that cannot be used are skipped with their reason.
///
/// # Errors
/// If a folder or `joints` cannot be used, no file can, or a result cannot be written.
pub fn import_amc(
    inputs: &[PathBuf],
    body: &Body,
    out: &Path,
    settings: &AmcSettings,
    joints: Option<&Path>,
    progress: Progress<'_>,
) -> Result<Summary, ImportError> {
    check_frame_rate(settings.rate).map_err(ImportError::Refused)?;
    let joints = joints.map(JointFile::load).transpose()?;
    let mut files = Vec::new();
    for input in inputs {
        files.extend(find_files(input, "amc", out)?);
    }
    let read = |file: &Path| {
        let skeleton = settings.skeleton.clone().map_or_else(|| skeleton_beside(file), Ok)?;
        let recording = load(&skeleton, file, settings.rate).map_err(|e| e.to_string())?;
        // What is wrong with the rig is wrong with the skeleton.
        retargeted(&recording, joints.as_ref(), body).map_err(|e| format!("{}: {e}", skeleton.display()))
    };
    write_retargeted(&files, body, out, &settings.retarget, "AMC files", &read, progress)
}

/// Reads a skeleton and one of its motions, of `rate` frames per second.
///
/// # Errors
/// [`FileError`] naming file and line.
pub fn load(skeleton: &Path, motion: &Path, rate: f64) -> Result<Recording, FileError> {
    let text = |path: &Path| -> Result<String, FileError> {
        Ok(String::from_utf8_lossy(&fs::read(path).map_err(FileError::io(path))?).into_owned())
    };
    let bones = AcclaimSkeleton::parse(&text(skeleton)?, skeleton)?;
    let values = motion::parse(&text(motion)?, motion, &bones)?;
    Ok(Recording::new(bones.joints(), rate, values))
}

/// The skeleton in the folder of `motion`: the only one, or the one that its name begins with (`01.asf` of `01_02.amc`).
fn skeleton_beside(motion: &Path) -> Result<PathBuf, String> {
    let parent = motion.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut found = folder::entries(parent).map_err(|e| e.to_string())?;
    found.retain(|path| folder::has_extension(path, "asf"));
    let name = super::motions::stem(motion);
    let begins = |path: &PathBuf| name.starts_with(&super::motions::stem(path));
    let longest = found.iter().filter(|p| begins(p)).max_by_key(|p| super::motions::stem(p).len());
    match (&found[..], longest) {
        ([only], _) => Ok(only.clone()),
        (_, Some(named)) => Ok(named.clone()),
        ([], _) => {
            Err(format!("no skeleton (.asf) beside it in {}; name it with --skeleton FILE", parent.display()))
        }
        _ => Err(format!(
            "none of the {} skeletons (.asf) in {} begins its name; name it with --skeleton FILE",
            found.len(),
            parent.display()
        )),
    }
}

#[cfg(test)]
mod tests;
