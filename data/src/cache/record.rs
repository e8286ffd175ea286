//! One record: named arrays in one safetensors file, with the BLAKE3 hash of each among its metadata.

use crate::format::FileError;
use memmap2::Mmap;
use safetensors::tensor::{Dtype, Metadata, SafeTensorError, SafeTensors, TensorView};
use std::collections::HashMap;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Metadata entry of the hashes: a name and its hash on each line. One entry only, because the order of several is random.
const HASHES: &str = "blake3";
/// A header is about a thousand bytes; more is not one of ours.
const LARGEST_HEADER: u64 = 1 << 16;

/// A type of number that arrays hold.
pub trait Element: bytemuck::Pod {
    /// Its name in the file.
    const DTYPE: Dtype;
}

impl Element for f32 {
    const DTYPE: Dtype = Dtype::F32;
}

impl Element for f64 {
    const DTYPE: Dtype = Dtype::F64;
}

impl Element for u32 {
    const DTYPE: Dtype = Dtype::U32;
}

/// An array to be stored.
#[derive(Clone, Copy, Debug)]
pub struct StoredArray<'a> {
    dtype: Dtype,
    count: usize,
    bytes: &'a [u8],
}

impl<'a, T: Element> From<&'a [T]> for StoredArray<'a> {
    fn from(values: &'a [T]) -> Self {
        Self { dtype: T::DTYPE, count: values.len(), bytes: bytemuck::cast_slice(values) }
    }
}

/// A memory-mapped record.
pub struct Record {
    path: PathBuf,
    map: Mmap,
    header: Metadata,
    /// Where the arrays begin (bytes).
    start: usize,
}

impl Record {
    /// Opens a record and checks its header; arrays are checked when they are read.
    ///
    /// # Errors
    /// [`FileError`].
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let failed = FileError::io(path);
        let file = File::open(path).map_err(&failed)?;
        // SAFETY: records are written under another name and renamed into place, and nobody writes to one afterwards, so
        // the mapped bytes do not change. (Whoever truncates a file of the cache by hand ends the process with SIGBUS,
        // as for every mapped file.)
        let map = unsafe { Mmap::map(&file) }.map_err(failed)?;
        let (start, header) = read_header(&map).map_err(damaged(path))?;
        Ok(Self { path: path.into(), map, header, start })
    }

    /// The numbers of an array.
    ///
    /// # Errors
    /// [`FileError::Content`] if there is none of that name and type, or its bytes have changed.
    pub fn array<T: Element>(&self, name: &str) -> Result<&[T], FileError> {
        let damaged = damaged(&self.path);
        let info = self.header.info(name).filter(|info| info.dtype == T::DTYPE);
        let info = info.ok_or_else(|| damaged(format!("it has no array {name:?} of {:?}", T::DTYPE)))?;
        let (from, to) = info.data_offsets;
        let bytes = &self.map[self.start + from..self.start + to];
        if self.hash(name) != Some(blake3::hash(bytes).to_hex().as_str()) {
            return Err(damaged(format!("the bytes of array {name:?} have changed")));
        }
        bytemuck::try_cast_slice(bytes).map_err(|e| damaged(format!("array {name:?}: {e}")))
    }

    fn hash(&self, name: &str) -> Option<&str> {
        let hashes = self.header.metadata().as_ref()?.get(HASHES)?;
        hashes.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '))
    }
}

/// What does not fit, for `map_err`.
fn damaged(path: &Path) -> impl Fn(String) -> FileError + '_ {
    |reason| FileError::content(path)(format!("damaged cache record ({reason})"))
}

/// The bytes of a record.
pub(super) fn encode(arrays: &[(&str, StoredArray<'_>)]) -> Result<Vec<u8>, SafeTensorError> {
    let hashes =
        arrays.iter().map(|(name, array)| format!("{name} {}\n", blake3::hash(array.bytes).to_hex()));
    let metadata = HashMap::from([(HASHES.to_string(), hashes.collect())]);
    let views = arrays
        .iter()
        .map(|(name, array)| Ok((*name, TensorView::new(array.dtype, vec![array.count], array.bytes)?)));
    safetensors::serialize(views.collect::<Result<Vec<_>, SafeTensorError>>()?, Some(metadata))
}

/// Where the arrays begin (bytes), and what the header says of them. It is not parsed before its length is checked.
fn read_header(file: &[u8]) -> Result<(usize, Metadata), String> {
    let length = file.first_chunk().map(|bytes| u64::from_le_bytes(*bytes));
    if length.is_none_or(|length| length > LARGEST_HEADER) {
        return Err("it does not start with the length of a header".into());
    }
    let (length, header) = SafeTensors::read_metadata(file).map_err(|e| e.to_string())?;
    Ok((8 + length, header))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Vec<u8> {
        encode(&[
            ("mass", [1.5, -2.0, f64::MAX][..].into()),
            ("faces", [0u32, 1, 2, 7][..].into()),
            ("empty", [0f32; 0][..].into()),
            ("basis", [0.25f32; 33][..].into()),
        ])
        .unwrap()
    }

    fn open(bytes: &[u8]) -> Result<Record, FileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("record");
        std::fs::write(&path, bytes).unwrap();
        Record::open(&path)
    }

    #[test]
    fn arrays_come_back_as_they_were() {
        let record = open(&example()).unwrap();
        assert_eq!(record.array::<f64>("mass").unwrap(), [1.5, -2.0, f64::MAX]);
        assert_eq!(record.array::<u32>("faces").unwrap(), [0, 1, 2, 7]);
        assert_eq!(record.array::<f32>("basis").unwrap(), [0.25; 33]);
        assert!(record.array::<f32>("empty").unwrap().is_empty());
        assert!(matches!(record.array::<f32>("mass"), Err(FileError::Content { .. })), "another type");
        assert!(matches!(record.array::<f32>("none"), Err(FileError::Content { .. })));
        assert_eq!(example(), example());
    }

    #[test]
    fn every_changed_byte_and_every_truncation_is_noticed() {
        let good = example();
        let reads = |bytes: &[u8]| -> Option<(Vec<f64>, Vec<u32>, Vec<f32>, Vec<f32>)> {
            let r = open(bytes).ok()?;
            Some((
                r.array("mass").ok()?.to_vec(),
                r.array("faces").ok()?.to_vec(),
                r.array("empty").ok()?.to_vec(),
                r.array("basis").ok()?.to_vec(),
            ))
        };
        let expected = reads(&good).unwrap();
        for position in 0..good.len() {
            let mut bad = good.clone();
            bad[position] ^= 0x10;
            if let Some(found) = reads(&bad) {
                assert_eq!(found, expected, "byte {position} changed what is read");
            }
        }
        for length in 0..good.len() {
            assert!(reads(&good[..length]).is_none(), "cut to {length} bytes");
        }
    }

    #[test]
    fn a_header_of_another_writer_is_refused() {
        let with_header = |header: &str, data: &[u8]| {
            open(&[&(header.len() as u64).to_le_bytes(), header.as_bytes(), data].concat())
        };
        let entry = |dtype: &str, shape: &str, offsets: &str| {
            format!(r#"{{"a":{{"dtype":"{dtype}","shape":{shape},"data_offsets":{offsets}}}}}"#)
        };
        assert!(open(&[0xff; 64]).is_err());
        assert!(with_header(&"{".repeat(1 << 17), &[]).is_err());
        assert!(with_header(&entry("F32", "[4611686018427387904,4]", "[0,16]"), &[0; 16]).is_err());
        assert!(with_header(&entry("F32", "[4]", "[0,18446744073709551615]"), &[0; 16]).is_err());
        assert!(with_header(&entry("F32", "[4]", "[16,0]"), &[0; 16]).is_err());
        // Neither a hash nor a multiple of eight bytes before the numbers.
        let record = with_header(&entry("F32", "[4]", "[0,16]"), &[0; 16]).unwrap();
        assert!(matches!(record.array::<f32>("a"), Err(FileError::Content { .. })));
    }
}
