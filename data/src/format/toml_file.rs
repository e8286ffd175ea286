//! TOML files: the manifests of folders.

use super::atomic;
use super::error::FileError;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs;
use std::path::Path;

/// Reads a file; `None` if there is none.
///
/// # Errors
/// [`FileError`] with line and column.
pub fn load<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, FileError> {
    match fs::read_to_string(path).map_err(FileError::io(path)) {
        Ok(text) => match toml::from_str(&text) {
            Ok(value) => Ok(Some(value)),
            Err(e) => Err(FileError::content(path)(e.to_string().trim_end())),
        },
        Err(e) if e.is_not_found() => Ok(None),
        Err(e) => Err(e),
    }
}

/// Writes a file, whole or not at all.
///
/// # Errors
/// If it cannot be written.
pub fn save<T: Serialize>(path: &Path, value: &T) -> Result<(), FileError> {
    let text = toml::to_string(value).map_err(FileError::content(path))?;
    atomic::write(path, text.as_bytes()).map_err(FileError::io(path))
}
