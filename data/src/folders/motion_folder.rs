//! A folder of motion npz files.

use crate::asset::Motion;
use crate::format::{FileError, folder};
use std::path::Path;

/// Reads every `.npz` of a folder as a motion, sorted by file name.
///
/// # Errors
/// [`FileError`] naming folder, or file and key.
pub fn load_motion_folder(path: &Path) -> Result<Vec<Motion>, FileError> {
    let mut files = folder::entries(path)?;
    files.retain(|file| folder::has_extension(file, "npz"));
    if files.is_empty() {
        let message = "no motions; expected .npz files with poses and mocap_framerate";
        return Err(FileError::content(path)(message));
    }
    files.iter().map(|file| Motion::load(file)).collect()
}
