//! A file of lines that is appended to.

use miette::{IntoDiagnostic, Report, WrapErr};
use std::fmt::Display;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

/// A log. What was written is on its way to the disk after [`flush`](Self::flush).
pub(super) struct LogFile {
    path: PathBuf,
    file: BufWriter<File>,
}

impl LogFile {
    /// Goes on with the file `path` after `prepare`.
    ///
    /// # Errors
    /// Names the file.
    pub fn append(path: PathBuf, prepare: io::Result<()>) -> Result<Self, Report> {
        let opened = prepare.and_then(|()| OpenOptions::new().create(true).append(true).open(&path));
        let file = BufWriter::new(named(opened, &path)?);
        Ok(Self { path, file })
    }

    /// Adds a line.
    ///
    /// # Errors
    /// Names the file.
    pub fn line(&mut self, text: impl Display) -> Result<(), Report> {
        named(writeln!(self.file, "{text}"), &self.path)
    }

    /// Has the system write what was added.
    ///
    /// # Errors
    /// Names the file.
    pub fn flush(&mut self) -> Result<(), Report> {
        named(self.file.flush(), &self.path)
    }
}

fn named<T>(result: io::Result<T>, path: &std::path::Path) -> Result<T, Report> {
    result.into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))
}
