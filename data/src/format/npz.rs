//! NumPy `.npz` archives: numeric and text arrays of any width, byte order and memory order, stored or deflated.
//!
//! Object arrays are Python pickles, that is, programs; they are listed but never read.

use super::atomic;
use npyz::{DType, Endianness, NpyHeader, Order, TypeChar, TypeStr, WriterBuilder};
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Why an npz archive or an array in it cannot be used.
#[derive(Debug, Error)]
pub enum NpzError {
    /// The file cannot be opened or read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
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
        let file = File::open(path).map_err(|source| NpzError::Io { path: path.into(), source })?;
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
        let count = count.filter(|n| *n / width.max(1) <= LARGEST_ARRAY);
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
        (TypeChar::Float, 2) => |b| half_to_f64(u16::from_le_bytes([b[0], b[1]])),
        (TypeChar::Float, 4) => |b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        (TypeChar::Float, 8) => f64::from_le_bytes,
        _ => return None,
    })
}

/// IEEE 754 binary16.
pub(super) fn half_to_f64(bits: u16) -> f64 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    match exponent {
        0 => sign * fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => sign * f64::INFINITY,
        31 => f64::NAN,
        _ => sign * (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    }
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
    pub fn save(self, path: &Path) -> Result<(), NpzError> {
        let failed = |source| NpzError::Io { path: path.into(), source };
        if let Some(reason) = self.error {
            return Err(failed(std::io::Error::other(reason)));
        }
        let bytes = self.zip.finish().map_err(|e| failed(std::io::Error::other(e.to_string())))?;
        atomic::write(path, bytes.get_ref()).map_err(failed)
    }
}

#[cfg(test)]
mod tests;
