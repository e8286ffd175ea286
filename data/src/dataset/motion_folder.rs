//! A folder of motion npz files.

use crate::asset::Motion;
use crate::format::FileError;
use std::fs;
use std::path::Path;

/// Reads every `.npz` of a folder as a motion, sorted by file name.
///
/// # Errors
/// [`FileError`] naming folder, or file and key.
pub fn load_motion_folder(folder: &Path) -> Result<Vec<Motion>, FileError> {
    let failed = FileError::io(folder);
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(&failed)? {
        let path = entry.map_err(&failed)?.path();
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npz")) {
            files.push(path);
        }
    }
    if files.is_empty() {
        let message = "no motions; expected .npz files with poses and mocap_framerate";
        return Err(FileError::content(folder)(message));
    }
    files.sort();
    files.iter().map(|f| Motion::load(f)).collect()
}
