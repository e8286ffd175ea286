//! A folder of motion npz files.

use crate::asset::Motion;
use crate::format::{FileError, folder};
use std::path::{Path, PathBuf};

/// Every `.npz` of a folder, sorted by file name; at least one.
///
/// # Errors
/// [`FileError`] naming the folder.
pub fn list_motion_folder(path: &Path) -> Result<Vec<PathBuf>, FileError> {
    let mut files = folder::entries(path)?;
    files.retain(|file| folder::has_extension(file, "npz"));
    if files.is_empty() {
        let message = "no motions; expected .npz files with poses and mocap_framerate";
        return Err(FileError::content(path)(message));
    }
    Ok(files)
}

/// Reads every `.npz` of a folder as a motion, sorted by file name.
///
/// # Errors
/// [`FileError`] naming folder, or file and key.
pub fn load_motion_folder(path: &Path) -> Result<Vec<Motion>, FileError> {
    list_motion_folder(path)?.iter().map(|file| Motion::load(file)).collect()
}
