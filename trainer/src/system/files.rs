//! Files that appear whole or not at all, with errors that name them.

use clothcombo_data::format::atomic;
use miette::{IntoDiagnostic, Report, WrapErr};
use serde::Serialize;
use std::path::Path;

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
