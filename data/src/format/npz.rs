//! NumPy `.npz` archives: numeric and text arrays of any width, byte order and memory order, stored or deflated.
//!
//! Object arrays are Python pickles, that is, programs; they are listed but never read.

use super::error::FileError;
use npyz::{DType, Endianness, NpyHeader, Order, TypeChar, TypeStr};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

mod error;
mod writer;

pub use error::NpzError;
pub use writer::NpzWriter;

/// A dense array, row-major whatever the order in the file was.
#[derive(Clone, Debug, PartialEq)]
pub struct Array<T> {
    /// Extent of each axis; empty for a scalar.
    pub shape: Vec<usize>,
    /// The numbers, last axis fastest.
    pub data: Vec<T>,
}

/// An open npz archive.
pub struct NpzFile {
    path: PathBuf,
    archive: ZipArchive<BufReader<File>>,
}

struct RawArray {
    kind: TypeStr,
    shape: Vec<usize>,
    order: Order,
    bytes: Vec<u8>,
}

impl NpzFile {
    /// Opens an archive; arrays are read when asked for.
    ///
    /// # Errors
    /// If the file cannot be opened or is not a zip archive.
    pub fn open(path: &Path) -> Result<Self, NpzError> {
        let file = File::open(path).map_err(FileError::at(path))?;
        let archive = ZipArchive::new(BufReader::new(file))
            .map_err(|e| NpzError::NotAnArchive { path: path.into(), reason: e.to_string() })?;
        Ok(Self { path: path.into(), archive })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of all arrays, sorted.
    pub fn keys(&self) -> Vec<String> {
        let names = self.archive.file_names().filter_map(Result::ok);
        let mut keys: Vec<String> =
            names.filter_map(|name| npyz::npz::array_name_from_file_name(&name).map(String::from)).collect();
        keys.sort();
        keys
    }

    /// Whether there is an array of that name.
    pub fn contains(&self, key: &str) -> bool {
        self.archive.index_for_name(&npyz::npz::file_name_from_array_name(key)).is_some()
    }

    /// Whether the array of that name is an object array, that is, a Python pickle; reads its header only.
    pub fn is_pickled(&mut self, key: &str) -> bool {
        let Some(index) = self.archive.index_for_name(&npyz::npz::file_name_from_array_name(key)) else {
            return false;
        };
        let header = self.archive.by_index(index).ok().and_then(|mut member| read_header(&mut member).ok());
        header.is_some_and(|h| matches!(h.dtype(), DType::Plain(kind) if kind.uses_pickled_array()))
    }

    /// The shape of an array; reads its header only.
    ///
    /// # Errors
    /// [`NpzError`] naming file and key.
    pub fn shape(&mut self, key: &str) -> Result<Vec<usize>, NpzError> {
        let Some(index) = self.archive.index_for_name(&npyz::npz::file_name_from_array_name(key)) else {
            let (key, hint) = (key.into(), String::new());
            return Err(NpzError::Missing { path: self.path.clone(), key, hint, present: self.keys() });
        };
        let header = (self.archive.by_index(index).map_err(|e| e.to_string()))
            .and_then(|mut member| read_header(&mut member).map_err(|e| e.to_string()));
        let shape =
            header.map(|h| h.shape().iter().map(|n| usize::try_from(*n).unwrap_or(usize::MAX)).collect());
        shape.map_err(|reason| NpzError::Damaged { path: self.path.clone(), key: key.into(), reason })
    }

    /// A numeric or boolean array, converted to `f64`. `hint` says what kind of file was expected, should the key be missing.
    ///
    /// # Errors
    /// [`NpzError`] naming file and key.
    pub fn numbers(&mut self, key: &str, hint: &str) -> Result<Array<f64>, NpzError> {
        let raw = self.raw(key, hint)?;
        self.decode(key, raw, |x| x)
    }

    /// As [`Self::numbers`], converted to `f32`: half the memory for large arrays.
    ///
    /// # Errors
    /// [`NpzError`] naming file and key.
    pub fn numbers_f32(&mut self, key: &str, hint: &str) -> Result<Array<f32>, NpzError> {
        let raw = self.raw(key, hint)?;
        self.decode(key, raw, |x| x as f32)
    }

    /// An array of text (`<U…`) or bytes (`|S…`), as strings.
    ///
    /// # Errors
    /// [`NpzError`] naming file and key.
    pub fn strings(&mut self, key: &str, hint: &str) -> Result<Array<String>, NpzError> {
        let raw = self.raw(key, hint)?;
        let width = raw.kind.num_bytes().unwrap_or(0).max(1);
        let big = raw.kind.endianness() == Endianness::Big;
        let text = |cell: &[u8]| -> Option<String> {
            match raw.kind.type_char() {
                TypeChar::ByteStr => Some(String::from_utf8_lossy(cell).trim_end_matches('\0').to_string()),
                TypeChar::UnicodeStr => {
                    let points = cell.chunks_exact(4).map(|c| {
                        let bytes = [c[0], c[1], c[2], c[3]];
                        let code = if big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) };
                        char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER)
                    });
                    Some(points.collect::<String>().trim_end_matches('\0').to_string())
                }
                _ => None,
            }
        };
        let data: Option<Vec<String>> = raw.bytes.chunks_exact(width).map(text).collect();
        match data {
            Some(data) => Ok(Array { data: to_row_major(data, &raw.shape, raw.order), shape: raw.shape }),
            None => Err(self.kind_error(key, &raw.kind, "text (<U or |S)")),
        }
    }

    fn kind_error(&self, key: &str, kind: &TypeStr, expected: &'static str) -> NpzError {
        NpzError::Kind { path: self.path.clone(), key: key.into(), found: format!("{kind}"), expected }
    }

    fn raw(&mut self, key: &str, hint: &str) -> Result<RawArray, NpzError> {
        let path = self.path.clone();
        let damaged = |reason: String| NpzError::Damaged { path: path.clone(), key: key.into(), reason };
        let Some(index) = self.archive.index_for_name(&npyz::npz::file_name_from_array_name(key)) else {
            let (key, hint) = (key.into(), hint.into());
            return Err(NpzError::Missing { path: self.path.clone(), key, hint, present: self.keys() });
        };
        let mut member = self.archive.by_index(index).map_err(|e| damaged(e.to_string()))?;
        let header = read_header(&mut member).map_err(|e| damaged(e.to_string()))?;
        let DType::Plain(kind) = header.dtype() else {
            return Err(NpzError::Kind {
                path: self.path.clone(),
                key: key.into(),
                found: header.dtype().descr(),
                expected: "a plain array, not a structured one",
            });
        };
        if kind.uses_pickled_array() {
            return Err(NpzError::Kind {
                path: self.path.clone(),
                key: key.into(),
                found: "object (a Python pickle)".into(),
                expected: "plain numbers or text; pickles are never executed",
            });
        }
        let width = kind.num_bytes().ok_or_else(|| damaged(format!("dtype {kind} has no size")))?;
        let shape: Option<Vec<usize>> = header.shape().iter().map(|n| usize::try_from(*n).ok()).collect();
        let shape = shape.ok_or_else(|| damaged("shape does not fit in memory".into()))?;
        let count =
            shape.iter().try_fold(1usize, |a, n| a.checked_mul(*n)).and_then(|n| n.checked_mul(width));
        let most = match kind.type_char() {
            TypeChar::Bool | TypeChar::Int | TypeChar::Uint | TypeChar::Float => width * LARGEST_ARRAY,
            _ => LARGEST_TEXT,
        };
        let count = count.filter(|bytes| *bytes <= most);
        let count = count.ok_or_else(|| damaged(format!("shape {shape:?} does not fit in memory")))?;
        // Grows with what is there, so that a lying header cannot reserve memory.
        let mut bytes = Vec::new();
        member.take(count as u64).read_to_end(&mut bytes).map_err(|e| damaged(e.to_string()))?;
        if bytes.len() != count {
            return Err(damaged(format!("truncated: {} of {count} bytes for shape {shape:?}", bytes.len())));
        }
        Ok(RawArray { kind, shape, order: header.order(), bytes })
    }

    fn decode<T: Copy>(&self, key: &str, raw: RawArray, convert: fn(f64) -> T) -> Result<Array<T>, NpzError> {
        let width = raw.kind.num_bytes().unwrap_or(0);
        let Some(number) = number_reader(raw.kind.type_char(), width) else {
            return Err(self.kind_error(key, &raw.kind, "integers or floats of at most 64 bits"));
        };
        let big = raw.kind.endianness() == Endianness::Big;
        let data = raw.bytes.chunks_exact(width.max(1)).map(|cell| {
            let mut little = [0u8; 8];
            little[..width].copy_from_slice(cell);
            if big {
                little[..width].reverse();
            }
            convert(number(little))
        });
        Ok(Array { data: to_row_major(data.collect(), &raw.shape, raw.order), shape: raw.shape })
    }
}

/// More numbers than any model or motion holds (SMPL-X's largest array has 15 million); a deflated file of a few kilobytes
/// can claim any size.
const LARGEST_ARRAY: usize = 1 << 26;
/// More bytes than the names and notices in any file; one cell of text may claim to be of any width.
const LARGEST_TEXT: usize = 1 << 24;

/// The header of an `.npy` member. Its text is looked at before it is parsed: it cannot be long or deeply nested, or else it
/// exhausts memory or stack.
fn read_header(member: &mut impl Read) -> std::io::Result<NpyHeader> {
    const LONGEST: usize = 1 << 16;
    const MOST_BRACKETS: usize = 64;
    let invalid = |reason: &str| std::io::Error::new(std::io::ErrorKind::InvalidData, reason.to_string());
    let mut start = [0u8; 12];
    member.read_exact(&mut start[..10])?;
    let mut length = usize::from(u16::from_le_bytes([start[8], start[9]]));
    let mut known = 10;
    if start[6] > 1 {
        member.read_exact(&mut start[10..])?;
        length = u32::from_le_bytes([start[8], start[9], start[10], start[11]]) as usize;
        known = 12;
    }
    if !start.starts_with(b"\x93NUMPY") || length > LONGEST {
        return Err(invalid("it is not a NumPy array"));
    }
    let mut bytes = start[..known].to_vec();
    member.take(length as u64).read_to_end(&mut bytes)?;
    if bytes.iter().filter(|b| matches!(b, b'(' | b'[' | b'{')).count() > MOST_BRACKETS {
        return Err(invalid("its header is too deeply nested"));
    }
    NpyHeader::from_reader(&bytes[..])
}

/// The conversion of one little-endian cell, zero-padded to eight bytes.
fn number_reader(kind: TypeChar, width: usize) -> Option<fn([u8; 8]) -> f64> {
    Some(match (kind, width) {
        (TypeChar::Bool, 1) => |b| f64::from(u8::from(b[0] != 0)),
        (TypeChar::Int, 1) => |b| f64::from(b[0] as i8),
        (TypeChar::Int, 2) => |b| f64::from(i16::from_le_bytes([b[0], b[1]])),
        (TypeChar::Int, 4) => |b| f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        (TypeChar::Int, 8) => |b| i64::from_le_bytes(b) as f64,
        (TypeChar::Uint, 1 | 2 | 4 | 8) => |b| u64::from_le_bytes(b) as f64,
        (TypeChar::Float, 2) => |b| half::f16::from_le_bytes([b[0], b[1]]).to_f64(),
        (TypeChar::Float, 4) => |b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        (TypeChar::Float, 8) => f64::from_le_bytes,
        _ => return None,
    })
}

fn to_row_major<T: Clone>(data: Vec<T>, shape: &[usize], order: Order) -> Vec<T> {
    if order == Order::C { data } else { row_major_from_fortran(data, shape) }
}

/// Reorders an array whose first axis is the fastest.
pub(super) fn row_major_from_fortran<T: Clone>(data: Vec<T>, shape: &[usize]) -> Vec<T> {
    if shape.len() < 2 || data.is_empty() {
        return data;
    }
    // Walk the row-major positions; the first axis has stride one in Fortran order.
    let strides: Vec<usize> = shape.iter().scan(1, |s, n| Some(std::mem::replace(s, *s * n))).collect();
    let mut index = vec![0; shape.len()];
    let mut source = 0;
    (0..data.len())
        .map(|_| {
            let value = data[source].clone();
            for axis in (0..shape.len()).rev() {
                index[axis] += 1;
                source += strides[axis];
                if index[axis] < shape[axis] {
                    break;
                }
                source -= strides[axis] * shape[axis];
                index[axis] = 0;
            }
            value
        })
        .collect()
}

#[cfg(test)]
mod tests;
