//! Files that appear whole or not at all, with errors that name them.

use clothcombo_data::format::atomic;
use miette::{IntoDiagnostic, Report, WrapErr};
use serde::Serialize;
use std::hash::{BuildHasher, RandomState};
use std::path::Path;
use std::{fs, io};

/// Writes `bytes` to the file `path`.
///
/// # Errors
/// Names the file.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Report> {
    atomic::write(path, bytes).into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))
}

/// Writes `value` as JSON.
///
/// # Errors
/// Names the file; and when `value` has no JSON form.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), Report> {
    write_file(path, &serde_json::to_vec_pretty(value).into_diagnostic()?)
}

/// Whether files can be made in `folder`, which need not be there: tried in the innermost folder that is, where nothing is left.
///
/// # Errors
/// What the system says.
pub fn check_writable(folder: &Path) -> io::Result<()> {
    // The last ancestor of a relative path is the empty one, the working folder.
    let found = folder.ancestors().find(|path| path.as_os_str().is_empty() || path.is_dir());
    let place = found.filter(|path| !path.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let probe = place.join(format!(".clothcombo-probe-{:016x}", RandomState::new().hash_one(0)));
    // A folder where one would be made: some file systems take files only.
    match place == folder {
        true => fs::write(&probe, "").and_then(|()| fs::remove_file(&probe)),
        false => fs::create_dir(&probe).and_then(|()| fs::remove_dir(&probe)),
    }
}
