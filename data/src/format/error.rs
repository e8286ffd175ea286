//! What can be wrong with a file of any format.

use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The system refuses to read or write a file or folder.
#[derive(Debug, Error)]
#[error("{}: {reason}", path.display())]
pub struct FileError {
    /// File or folder.
    pub path: PathBuf,
    /// What the system said.
    pub reason: io::Error,
}

impl FileError {
    /// Adds the path to an error of the system: for `map_err`.
    pub fn at(path: &Path) -> impl Fn(io::Error) -> Self + '_ {
        |reason| Self { path: path.into(), reason }
    }
}

/// A line of a text file is wrong.
#[derive(Debug, Error)]
#[error("{}:{line}: {message}", path.display())]
pub struct LineError {
    /// The file.
    pub path: PathBuf,
    /// The line, from 1; the first one of a statement that goes over several, the last one if the file ends too early.
    pub line: usize,
    /// What is wrong with it.
    pub message: String,
}
