//! What can be wrong with an archive.

use crate::format::error::FileError;
use std::path::PathBuf;
use thiserror::Error;

/// Why an npz archive or an array in it cannot be used.
#[derive(Debug, Error)]
pub enum NpzError {
    /// The file cannot be opened, read or written.
    #[error(transparent)]
    Io(#[from] FileError),
    /// Not a zip archive.
    #[error("{}: not an npz archive ({reason}); npz files are zip archives made by numpy.savez, and pickles (.pkl) are never executed", path.display())]
    NotAnArchive {
        /// The file.
        path: PathBuf,
        /// What the zip reader said.
        reason: String,
    },
    /// No such array.
    #[error("{}: key '{key}' is missing; {hint}; keys present: {}", path.display(), present.join(", "))]
    Missing {
        /// The file.
        path: PathBuf,
        /// The key asked for.
        key: String,
        /// What the file should be.
        hint: String,
        /// The keys it has.
        present: Vec<String>,
    },
    /// The array is not of a usable kind.
    #[error("{}: key '{key}' has dtype {found}, expected {expected}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// The key.
        key: String,
        /// Its dtype.
        found: String,
        /// What was expected.
        expected: &'static str,
    },
    /// The array has the wrong shape.
    #[error("{}: key '{key}' has shape {found:?}, expected {expected}", path.display())]
    Shape {
        /// The file.
        path: PathBuf,
        /// The key.
        key: String,
        /// Its shape.
        found: Vec<usize>,
        /// What was expected.
        expected: String,
    },
    /// The array is damaged.
    #[error("{}: key '{key}' cannot be read: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The key.
        key: String,
        /// What is wrong.
        reason: String,
    },
}
