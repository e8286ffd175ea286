//! Looking for the files of an importer in folders.

use crate::format::{FileError, folder};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

const DEEPEST_FOLDER: usize = 32;

/// `input` itself if it is a file, else all files of this extension below it, in order of their names. Links that lead back are
/// followed once. What was imported into `out` before is no input, unless `out` is what is asked for.
pub(super) fn find_files(input: &Path, extension: &str, out: &Path) -> Result<Vec<PathBuf>, FileError> {
    let below = fs::canonicalize(out).ok().filter(|out| fs::canonicalize(input).ok().as_ref() != Some(out));
    let mut found = Vec::new();
    find(input, extension, &mut found, &mut HashSet::from_iter(below), 0)?;
    Ok(found)
}

fn find(
    path: &Path,
    extension: &str,
    found: &mut Vec<PathBuf>,
    seen: &mut HashSet<PathBuf>,
    depth: usize,
) -> Result<(), FileError> {
    let failed = FileError::io(path);
    if !fs::metadata(path).map_err(&failed)?.is_dir() {
        found.push(path.into());
        return Ok(());
    }
    if depth > DEEPEST_FOLDER || !seen.insert(fs::canonicalize(path).map_err(&failed)?) {
        return Ok(());
    }
    for entry in folder::entries(path)? {
        if entry.is_dir() || folder::has_extension(&entry, extension) {
            find(&entry, extension, found, seen, depth + 1)?;
        }
    }
    Ok(())
}
