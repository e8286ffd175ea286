//! What an importer reports.

use crate::asset::BodyError;
use crate::format::FileError;
use std::fmt;
use std::path::PathBuf;
use thiserror::Error;

/// Why nothing is imported. What is wrong with a single item stands in the summary.
#[derive(Debug, Error)]
pub enum ImportError {
    /// A file or folder cannot be used or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The inputs do not fit together, or none of them can be used.
    #[error("{0}")]
    Refused(String),
}

impl From<BodyError> for ImportError {
    fn from(e: BodyError) -> Self {
        Self::Refused(e.to_string())
    }
}

/// What an importer did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// What was taken: name, and a line about it.
    pub taken: Vec<(String, String)>,
    /// What was left out: name, and why.
    pub skipped: Vec<(String, String)>,
    /// Assumptions and measurements worth knowing.
    pub notes: Vec<String>,
    /// The files written.
    pub written: Vec<PathBuf>,
}

/// One line per item and the counts.
impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, about) in &self.taken {
            writeln!(f, "taken    {name}: {about}")?;
        }
        for (name, reason) in &self.skipped {
            writeln!(f, "skipped  {name}: {reason}")?;
        }
        for note in &self.notes {
            writeln!(f, "note     {note}")?;
        }
        for file in &self.written {
            writeln!(f, "written  {}", file.display())?;
        }
        write!(f, "{} taken, {} skipped", self.taken.len(), self.skipped.len())
    }
}

/// Called with what is being done, how much of it is done, and how much there is.
pub type Progress<'a> = &'a mut dyn FnMut(&str, usize, usize);
