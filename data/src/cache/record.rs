//! One record: named arrays in one file.
//!
//! ```text
//! 0   8 bytes  magic "CLTHARR1"
//! 8   u32      length n of the table in bytes, little endian
//! 12  32       BLAKE3 of the table
//! 44  n        table: u16 count, then per array: u8 name length, name, u8 kind, u64 offset, u64 elements, 32 bytes BLAKE3
//! …            arrays, each on a multiple of 64 bytes, little endian
//! ```

use crate::format::FileError;
use memmap2::Mmap;
use std::fs::File;
use std::path::{Path, PathBuf};
use thiserror::Error;

const MAGIC: &[u8; 8] = b"CLTHARR1";
const HEADER: usize = 44;
const ALIGNMENT: usize = 64;
/// A table is a few hundred bytes; more is not one of ours.
const LARGEST_TABLE: usize = 1 << 16;

/// An array to be stored.
#[derive(Clone, Copy, Debug)]
pub enum Array<'a> {
    /// 32-bit floats.
    F32(&'a [f32]),
    /// 64-bit floats.
    F64(&'a [f64]),
    /// 32-bit unsigned integers.
    U32(&'a [u32]),
}

impl Array<'_> {
    fn bytes(&self) -> &[u8] {
        match self {
            Array::F32(values) => bytemuck::cast_slice(values),
            Array::F64(values) => bytemuck::cast_slice(values),
            Array::U32(values) => bytemuck::cast_slice(values),
        }
    }

    fn kind(&self) -> Kind {
        match self {
            Array::F32(_) => Kind::F32,
            Array::F64(_) => Kind::F64,
            Array::U32(_) => Kind::U32,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    F32 = 0,
    F64 = 1,
    U32 = 2,
}

impl Kind {
    fn from_code(code: u8) -> Option<Self> {
        [Kind::F32, Kind::F64, Kind::U32].into_iter().find(|k| *k as u8 == code)
    }

    fn width(self) -> u64 {
        match self {
            Kind::F32 | Kind::U32 => 4,
            Kind::F64 => 8,
        }
    }
}

/// Why a record cannot be read.
#[derive(Debug, Error)]
pub enum RecordError {
    /// The file cannot be opened or mapped.
    #[error(transparent)]
    Io(#[from] FileError),
    /// The file is not whole or was changed.
    #[error("{}: damaged cache record ({reason}); it is computed anew when the file is removed", path.display())]
    Damaged {
        /// The record.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
}

struct Entry {
    name: String,
    kind: Kind,
    offset: usize,
    bytes: usize,
    hash: [u8; 32],
}

/// A memory-mapped record.
pub struct Record {
    path: PathBuf,
    map: Mmap,
    entries: Vec<Entry>,
}

impl Record {
    /// Opens a record and checks its table; arrays are checked when they are read.
    ///
    /// # Errors
    /// [`RecordError`] naming the file.
    pub fn open(path: &Path) -> Result<Self, RecordError> {
        let failed = FileError::at(path);
        let file = File::open(path).map_err(&failed)?;
        // SAFETY: records are written under another name and renamed into place, and nobody writes to one afterwards, so
        // the mapped bytes do not change. (Whoever truncates a file of the cache by hand ends the process with SIGBUS,
        // as for every mapped file.)
        let map = unsafe { Mmap::map(&file) }.map_err(failed)?;
        let entries =
            read_table(&map).map_err(|reason| RecordError::Damaged { path: path.into(), reason })?;
        Ok(Self { path: path.into(), map, entries })
    }

    /// A 32-bit float array.
    ///
    /// # Errors
    /// [`RecordError::Damaged`] if there is none of that name and kind, or its bytes have changed.
    pub fn f32(&self, name: &str) -> Result<&[f32], RecordError> {
        Ok(bytemuck::cast_slice(self.array(name, Kind::F32)?))
    }

    /// A 64-bit float array.
    ///
    /// # Errors
    /// As [`Record::f32`].
    pub fn f64(&self, name: &str) -> Result<&[f64], RecordError> {
        Ok(bytemuck::cast_slice(self.array(name, Kind::F64)?))
    }

    /// A 32-bit unsigned integer array.
    ///
    /// # Errors
    /// As [`Record::f32`].
    pub fn u32(&self, name: &str) -> Result<&[u32], RecordError> {
        Ok(bytemuck::cast_slice(self.array(name, Kind::U32)?))
    }

    fn array(&self, name: &str, kind: Kind) -> Result<&[u8], RecordError> {
        let damaged = |reason: String| RecordError::Damaged { path: self.path.clone(), reason };
        let entry = self
            .entries
            .iter()
            .find(|e| e.name == name && e.kind == kind)
            .ok_or_else(|| damaged(format!("it has no array {name:?} of kind {kind:?}")))?;
        let bytes = &self.map[entry.offset..entry.offset + entry.bytes];
        match blake3::hash(bytes).as_bytes() == &entry.hash {
            true => Ok(bytes),
            false => Err(damaged(format!("the bytes of array {name:?} have changed"))),
        }
    }
}

/// The bytes of a record.
pub(super) fn encode(arrays: &[(&str, Array<'_>)]) -> Vec<u8> {
    let table_length: usize =
        2 + arrays.iter().map(|(name, _)| 1 + name.len() + 1 + 8 + 8 + 32).sum::<usize>();
    let aligned = |position: usize| position.next_multiple_of(ALIGNMENT);
    let mut position = aligned(HEADER + table_length);
    let mut table = Vec::with_capacity(table_length);
    table.extend((arrays.len() as u16).to_le_bytes());
    let mut offsets = Vec::with_capacity(arrays.len());
    for (name, array) in arrays {
        let bytes = array.bytes();
        table.push(name.len() as u8);
        table.extend(name.as_bytes());
        table.push(array.kind() as u8);
        table.extend((position as u64).to_le_bytes());
        table.extend((bytes.len() as u64 / array.kind().width()).to_le_bytes());
        table.extend(blake3::hash(bytes).as_bytes());
        offsets.push(position);
        position = aligned(position + bytes.len());
    }
    let mut out = Vec::with_capacity(position);
    out.extend(MAGIC);
    out.extend((table.len() as u32).to_le_bytes());
    out.extend(blake3::hash(&table).as_bytes());
    out.extend(&table);
    for ((_, array), offset) in arrays.iter().zip(offsets) {
        out.resize(offset, 0);
        out.extend(array.bytes());
    }
    out
}

fn read_table(file: &[u8]) -> Result<Vec<Entry>, String> {
    let header = file.get(..HEADER).ok_or("it is shorter than its header")?;
    if &header[..8] != MAGIC {
        return Err("it does not start with the mark of a record".into());
    }
    let length = u32::from_le_bytes(header[8..12].try_into().expect("four bytes")) as usize;
    if length > LARGEST_TABLE {
        return Err("its table is too long".into());
    }
    let table = file.get(HEADER..HEADER + length).ok_or("it ends within its table")?;
    if blake3::hash(table).as_bytes() != &header[12..44] {
        return Err("its table has changed".into());
    }
    // The table is as it was written; what follows fails only on a file that a writer of another format made.
    parse_table(table, file.len()).ok_or_else(|| "its table does not fit the file".into())
}

fn parse_table(table: &[u8], file_length: usize) -> Option<Vec<Entry>> {
    let mut rest = table;
    let mut take = |count: usize| -> Option<&[u8]> {
        let (head, tail) = rest.split_at_checked(count)?;
        rest = tail;
        Some(head)
    };
    let count = u16::from_le_bytes(take(2)?.try_into().ok()?);
    let mut entries = Vec::new();
    for _ in 0..count {
        let name_length = usize::from(take(1)?[0]);
        let name = String::from_utf8(take(name_length)?.to_vec()).ok()?;
        let kind = Kind::from_code(take(1)?[0])?;
        let offset = u64::from_le_bytes(take(8)?.try_into().ok()?);
        let elements = u64::from_le_bytes(take(8)?.try_into().ok()?);
        let hash = take(32)?.try_into().ok()?;
        let bytes = elements.checked_mul(kind.width())?;
        if offset % ALIGNMENT as u64 != 0 || offset.checked_add(bytes)? > file_length as u64 {
            return None;
        }
        entries.push(Entry { name, kind, offset: offset as usize, bytes: bytes as usize, hash });
    }
    Some(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Vec<u8> {
        encode(&[
            ("mass", Array::F64(&[1.5, -2.0, f64::MAX])),
            ("faces", Array::U32(&[0, 1, 2, 7])),
            ("empty", Array::F32(&[])),
            ("basis", Array::F32(&[0.25; 33])),
        ])
    }

    fn open(bytes: &[u8]) -> Result<Record, RecordError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("record");
        std::fs::write(&path, bytes).unwrap();
        Record::open(&path)
    }

    #[test]
    fn arrays_come_back_as_they_were() {
        let record = open(&example()).unwrap();
        assert_eq!(record.f64("mass").unwrap(), [1.5, -2.0, f64::MAX]);
        assert_eq!(record.u32("faces").unwrap(), [0, 1, 2, 7]);
        assert_eq!(record.f32("basis").unwrap(), [0.25; 33]);
        assert!(record.f32("empty").unwrap().is_empty());
        assert!(matches!(record.f32("mass"), Err(RecordError::Damaged { .. })), "another kind");
        assert!(matches!(record.f32("none"), Err(RecordError::Damaged { .. })));
    }

    /// Every byte that carries something is covered by a hash: only padding may change unseen.
    #[test]
    fn every_changed_byte_and_every_truncation_is_noticed() {
        let good = example();
        let reads = |bytes: &[u8]| -> Option<(Vec<f64>, Vec<u32>, Vec<f32>, Vec<f32>)> {
            let r = open(bytes).ok()?;
            Some((
                r.f64("mass").ok()?.to_vec(),
                r.u32("faces").ok()?.to_vec(),
                r.f32("empty").ok()?.to_vec(),
                r.f32("basis").ok()?.to_vec(),
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
}
