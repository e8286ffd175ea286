//! Why a file cannot be used or written: the same for all formats.

use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a file or folder cannot be used or written.
#[derive(Debug, Error)]
pub enum FileError {
    /// The system refuses.
    #[error("{}: {reason}{}", path.display(), advice(reason))]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What the system said.
        reason: io::Error,
    },
    /// A line of text is wrong.
    #[error("{}:{line}: {message}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1: the first one of a statement that goes over several, the last one if the file ends too early.
        line: usize,
        /// What is wrong with it.
        message: String,
    },
    /// What it holds is wrong.
    #[error("{}: {message}", path.display())]
    Content {
        /// File or folder.
        path: PathBuf,
        /// The place in it, what is wrong, and what to do.
        message: String,
    },
}

/// What to do about an error of the system that its text does not tell.
fn advice(reason: &io::Error) -> &'static str {
    match reason.kind() {
        io::ErrorKind::FileTooLarge => "; hint: raise the limit on the size of files (ulimit -f)",
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "; hint: make room on the disk, or write elsewhere"
        }
        _ => "",
    }
}

impl FileError {
    /// Adds the path to an error of the system, for `map_err`.
    pub fn io(path: &Path) -> impl Fn(io::Error) -> Self + '_ {
        |reason| Self::Io { path: path.into(), reason }
    }

    /// Adds the path to what is wrong with the content, for `map_err`.
    pub fn content<M: ToString>(path: &Path) -> impl Fn(M) -> Self + '_ {
        |message| Self::Content { path: path.into(), message: message.to_string() }
    }

    /// Adds path and line to what is wrong, for `map_err`.
    pub fn line<M: ToString>(path: &Path, line: usize) -> impl Fn(M) -> Self + '_ {
        move |message| Self::Line { path: path.into(), line, message: message.to_string() }
    }

    /// Whether there is no such file.
    pub fn is_not_found(&self) -> bool {
        matches!(self, Self::Io { reason, .. } if reason.kind() == io::ErrorKind::NotFound)
    }
}
