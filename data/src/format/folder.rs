//! What lies in a folder.

use super::error::FileError;
use std::fs;
use std::path::{Path, PathBuf};

/// The paths in a folder, sorted.
///
/// # Errors
/// If the folder cannot be read.
pub fn entries(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let failed = FileError::io(folder);
    let found = fs::read_dir(folder).map_err(&failed)?;
    let mut paths = found.map(|entry| Ok(entry.map_err(&failed)?.path())).collect::<Result<Vec<_>, _>>()?;
    paths.sort();
    Ok(paths)
}

/// Whether the extension of `path` is `extension` in upper or lower case.
pub fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}
