//! A folder of motion npz files.

use crate::asset::Motion;
use crate::asset::motion::MotionError;
use crate::format::FileError;
use std::fs;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a motion folder cannot be used.
#[derive(Debug, Error)]
pub enum MotionFolderError {
    /// The folder cannot be read.
    #[error(transparent)]
    Io(#[from] FileError),
    /// No motion in it.
    #[error("{}: no motions; expected .npz files with poses and mocap_framerate", path.display())]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// A file is unusable.
    #[error(transparent)]
    Motion(#[from] MotionError),
}

/// Reads every `.npz` of a folder as a motion, sorted by file name.
///
/// # Errors
/// [`MotionFolderError`] naming folder, or file and key.
pub fn load_motion_folder(folder: &Path) -> Result<Vec<Motion>, MotionFolderError> {
    let failed = FileError::at(folder);
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(&failed)? {
        let path = entry.map_err(&failed)?.path();
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npz")) {
            files.push(path);
        }
    }
    if files.is_empty() {
        return Err(MotionFolderError::Empty { path: folder.into() });
    }
    files.sort();
    Ok(files.iter().map(|f| Motion::load(f)).collect::<Result<_, _>>()?)
}
