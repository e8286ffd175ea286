//! Writing `.npz` archives.

use crate::format::atomic;
use crate::format::error::FileError;
use npyz::{DType, TypeStr, WriterBuilder};
use std::io::{Cursor, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Collects arrays and writes them as one deflated archive that NumPy reads. The bytes depend on the arrays alone.
pub struct NpzWriter {
    zip: ZipWriter<Cursor<Vec<u8>>>,
    error: Option<String>,
}

impl Default for NpzWriter {
    fn default() -> Self {
        Self::new()
    }
}

impl NpzWriter {
    /// An empty archive.
    pub fn new() -> Self {
        Self { zip: ZipWriter::new(Cursor::new(Vec::new())), error: None }
    }

    /// Adds an `f32` array.
    pub fn f32(&mut self, key: &str, shape: &[usize], data: &[f32]) -> &mut Self {
        self.add(key, "<f4", shape, data.len(), data.iter().flat_map(|x| x.to_le_bytes()))
    }

    /// Adds an `f64` array.
    pub fn f64(&mut self, key: &str, shape: &[usize], data: &[f64]) -> &mut Self {
        self.add(key, "<f8", shape, data.len(), data.iter().flat_map(|x| x.to_le_bytes()))
    }

    /// Adds a `u32` array.
    pub fn u32(&mut self, key: &str, shape: &[usize], data: &[u32]) -> &mut Self {
        self.add(key, "<u4", shape, data.len(), data.iter().flat_map(|x| x.to_le_bytes()))
    }

    /// Adds an `i64` array.
    pub fn i64(&mut self, key: &str, shape: &[usize], data: &[i64]) -> &mut Self {
        self.add(key, "<i8", shape, data.len(), data.iter().flat_map(|x| x.to_le_bytes()))
    }

    /// Adds an array of strings; an empty `shape` makes a scalar of the first one.
    pub fn strings<S: AsRef<str>>(&mut self, key: &str, shape: &[usize], data: &[S]) -> &mut Self {
        let longest = data.iter().map(|s| s.as_ref().chars().count()).max().unwrap_or(0).max(1);
        let bytes = data.iter().flat_map(|s| {
            let padded = s.as_ref().chars().map(u32::from).chain(std::iter::repeat(0)).take(longest);
            padded.flat_map(u32::to_le_bytes).collect::<Vec<u8>>()
        });
        self.add(key, &format!("<U{longest}"), shape, data.len(), bytes)
    }

    fn add(
        &mut self,
        key: &str,
        kind: &str,
        shape: &[usize],
        count: usize,
        bytes: impl Iterator<Item = u8>,
    ) -> &mut Self {
        let attempt = (|| -> Result<(), String> {
            if shape.iter().product::<usize>() != count {
                return Err(format!("array '{key}': {count} values for shape {shape:?}"));
            }
            let kind: TypeStr = kind.parse().map_err(|_| format!("dtype {kind}"))?;
            let extents: Vec<u64> = shape.iter().map(|n| *n as u64).collect();
            let mut array = npyz::WriteOptions::new_header_only()
                .dtype(DType::Plain(kind))
                .shape(&extents)
                .writer(Vec::new())
                .write_header_only()
                .map_err(|e| e.to_string())?;
            array.extend(bytes);
            let options = SimpleFileOptions::default()
                .compression_method(CompressionMethod::Deflated)
                .large_file(array.len() > u32::MAX as usize);
            self.zip
                .start_file(npyz::npz::file_name_from_array_name(key), options)
                .map_err(|e| e.to_string())?;
            self.zip.write_all(&array).map_err(|e| e.to_string())
        })();
        if let Err(reason) = attempt {
            self.error.get_or_insert(reason);
        }
        self
    }

    /// Writes the archive to `path`, whole or not at all.
    ///
    /// # Errors
    /// If an array did not fit its shape, or the file cannot be written.
    pub fn save(self, path: &Path) -> Result<(), FileError> {
        let failed = FileError::io(path);
        if let Some(reason) = self.error {
            return Err(failed(std::io::Error::other(reason)));
        }
        let bytes = self.zip.finish().map_err(|e| failed(std::io::Error::other(e.to_string())))?;
        atomic::write(path, bytes.get_ref()).map_err(failed)
    }
}
