//! NumPy `.npz` archives: numeric and text arrays of any width, byte order and memory order, stored or deflated.
//!
//! Object arrays are Python pickles, that is, programs; they are listed but never read.

use super::error::FileError;
use super::foreign::way_out;
use super::scalar::Scalar;
use npyz::{DType, Endianness, NpyHeader, Order, TypeChar, TypeStr};
use std::fmt::Display;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

mod writer;

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
    archive: ZipArchive<Box<dyn ArchiveSource>>,
}

/// What an archive is read from.
trait ArchiveSource: Read + Seek + Send {}

impl<T: Read + Seek + Send> ArchiveSource for T {}

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
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let file = File::open(path).map_err(FileError::io(path))?;
        Self::read(path, Box::new(BufReader::new(file)))
    }

    /// Opens an archive in memory, which messages call `path`.
    ///
    /// # Errors
    /// If it is not a zip archive.
    pub fn of_bytes(path: &Path, bytes: &'static [u8]) -> Result<Self, FileError> {
        Self::read(path, Box::new(Cursor::new(bytes)))
    }

    fn read(path: &Path, source: Box<dyn ArchiveSource>) -> Result<Self, FileError> {
        let archive = ZipArchive::new(source)
            .map_err(|e| {
                FileError::content(path)(way_out(path).unwrap_or_else(|| {
                    format!(
                        "not an npz archive ({e}); npz files are zip archives made by numpy.savez, and pickles (.pkl) are never executed"
                    )
                }))
            })?;
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

    /// Whether the array of that name is an object array, that is, a Python pickle.
    pub fn is_pickled(&mut self, key: &str) -> bool {
        let header = self.header(key, "");
        header.is_ok_and(|h| matches!(h.dtype(), DType::Plain(kind) if kind.uses_pickled_array()))
    }

    /// Whether the array of that name is text.
    fn is_text(&mut self, key: &str) -> Result<bool, FileError> {
        let header = self.header(key, "")?;
        let is_text = |kind: &TypeStr| matches!(kind.type_char(), TypeChar::ByteStr | TypeChar::UnicodeStr);
        Ok(matches!(header.dtype(), DType::Plain(kind) if is_text(&kind)))
    }

    /// The shape of an array.
    ///
    /// # Errors
    /// [`FileError`] naming file and key.
    pub fn shape(&mut self, key: &str) -> Result<Vec<usize>, FileError> {
        let header = self.header(key, "")?;
        Ok(header.shape().iter().map(|n| usize::try_from(*n).unwrap_or(usize::MAX)).collect())
    }

    /// The header of an array.
    fn header(&mut self, key: &str, hint: &str) -> Result<NpyHeader, FileError> {
        let damaged = damaged(&self.path, key);
        let mut member = self.archive.by_index(self.index(key, hint)?).map_err(|e| damaged(e.to_string()))?;
        read_header(&mut member).map_err(|e| damaged(e.to_string()))
    }

    fn index(&self, key: &str, hint: &str) -> Result<usize, FileError> {
        let index = self.archive.index_for_name(&npyz::npz::file_name_from_array_name(key));
        index.ok_or_else(|| {
            let present = self.keys().join(", ");
            self.wrong(format!("key '{key}' is missing; {hint}; keys present: {present}"))
        })
    }

    fn wrong(&self, message: String) -> FileError {
        FileError::content(&self.path)(message)
    }

    /// An array has another shape than `expected`.
    pub fn wrong_shape(&self, key: &str, found: &[usize], expected: &str) -> FileError {
        self.wrong(format!("key '{key}' has shape {found:?}, expected {expected}"))
    }

    /// The numbers of `array`, which must be of this shape.
    ///
    /// # Errors
    /// [`FileError`] naming file and key.
    pub fn of_shape<T>(&self, key: &str, array: Array<T>, shape: &[usize]) -> Result<Vec<T>, FileError> {
        match array.shape == shape {
            true => Ok(array.data),
            false => Err(self.wrong_shape(key, &array.shape, &format!("{shape:?}"))),
        }
    }

    /// A numeric or boolean array, converted to `f64`. `hint` says what kind of file was expected, should the key be missing.
    ///
    /// # Errors
    /// [`FileError`] naming file and key.
    pub fn numbers(&mut self, key: &str, hint: &str) -> Result<Array<f64>, FileError> {
        let raw = self.raw(key, hint)?;
        self.decode(key, raw, |x| x)
    }

    /// As [`Self::numbers`], converted to `f32`: half the memory for large arrays.
    ///
    /// # Errors
    /// [`FileError`] naming file and key.
    pub fn numbers_f32(&mut self, key: &str, hint: &str) -> Result<Array<f32>, FileError> {
        let raw = self.raw(key, hint)?;
        self.decode(key, raw, |x| x as f32)
    }

    /// An array of text (`<U…`) or bytes (`|S…`), as strings.
    ///
    /// # Errors
    /// [`FileError`] naming file and key.
    pub fn strings(&mut self, key: &str, hint: &str) -> Result<Array<String>, FileError> {
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
            None => Err(self.wrong_kind(key, &raw.kind, "text (<U or |S)")),
        }
    }

    /// The first text of an array; `None` where there is no array of that name, or none of text.
    ///
    /// # Errors
    /// [`FileError`] naming file and key of an array that is damaged.
    pub fn text(&mut self, key: &str) -> Result<Option<String>, FileError> {
        Ok(self.texts(key)?.and_then(|texts| texts.into_iter().next()))
    }

    /// As [`Self::text`], all of them.
    ///
    /// # Errors
    /// As [`Self::text`].
    pub fn texts(&mut self, key: &str) -> Result<Option<Vec<String>>, FileError> {
        if !self.contains(key) || !self.is_text(key)? {
            return Ok(None);
        }
        Ok(Some(self.strings(key, "")?.data))
    }

    fn wrong_kind(&self, key: &str, found: impl Display, expected: &str) -> FileError {
        self.wrong(format!("key '{key}' has dtype {found}, expected {expected}"))
    }

    fn raw(&mut self, key: &str, hint: &str) -> Result<RawArray, FileError> {
        let damaged = damaged(&self.path, key);
        let header = self.header(key, hint)?;
        let DType::Plain(kind) = header.dtype() else {
            return Err(self.wrong_kind(key, header.dtype().descr(), "a plain array, not a structured one"));
        };
        if kind.uses_pickled_array() {
            let expected = "plain numbers or text; pickles are never executed";
            return Err(self.wrong_kind(key, "object (a Python pickle)", expected));
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
        let mut member = self.archive.by_index(self.index(key, hint)?).map_err(|e| damaged(e.to_string()))?;
        read_header(&mut member).map_err(|e| damaged(e.to_string()))?;
        // Grows with what is there, so that a lying header cannot reserve memory.
        let mut bytes = Vec::new();
        member.take(count as u64).read_to_end(&mut bytes).map_err(|e| damaged(e.to_string()))?;
        if bytes.len() != count {
            return Err(damaged(format!("truncated: {} of {count} bytes for shape {shape:?}", bytes.len())));
        }
        Ok(RawArray { kind, shape, order: header.order(), bytes })
    }

    fn decode<T: Copy>(
        &self,
        key: &str,
        raw: RawArray,
        convert: fn(f64) -> T,
    ) -> Result<Array<T>, FileError> {
        let width = raw.kind.num_bytes().unwrap_or(0);
        let Some(scalar) = scalar_type(raw.kind.type_char(), width) else {
            return Err(self.wrong_kind(key, &raw.kind, "integers or floats of at most 64 bits"));
        };
        let big = raw.kind.endianness() == Endianness::Big;
        let is_truth_value = raw.kind.type_char() == TypeChar::Bool;
        let data = raw.bytes.chunks_exact(width).map(|cell| {
            let number = scalar.read(cell, big);
            convert(if is_truth_value { f64::from(u8::from(number != 0.0)) } else { number })
        });
        Ok(Array { data: to_row_major(data.collect(), &raw.shape, raw.order), shape: raw.shape })
    }
}

/// What is wrong with the array of `key`, for `map_err`.
fn damaged(path: &Path, key: &str) -> impl Fn(String) -> FileError + use<> {
    let (path, key) = (path.to_path_buf(), key.to_string());
    move |reason| FileError::content(&path)(format!("key '{key}' cannot be read: {reason}"))
}

/// More numbers than any model or motion holds (SMPL-X's largest array has 15 million); a deflated file of a few kilobytes
/// can claim any size.
const LARGEST_ARRAY: usize = 1 << 26;
/// More bytes than the names and notices in any file; one cell of text may claim to be of any width.
const LARGEST_TEXT: usize = 1 << 24;

/// The header of an `.npy` member. Its text is looked at before it is parsed: it cannot be long or deeply nested, or else it
/// exhausts memory or stack.
fn read_header(member: &mut impl Read) -> std::io::Result<NpyHeader> {
    const LONGEST_HEADER: usize = 1 << 16;
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
    if !start.starts_with(b"\x93NUMPY") || length > LONGEST_HEADER {
        return Err(invalid("it is not a NumPy array"));
    }
    let mut bytes = start[..known].to_vec();
    member.take(length as u64).read_to_end(&mut bytes)?;
    if bytes.iter().filter(|b| matches!(b, b'(' | b'[' | b'{')).count() > MOST_BRACKETS {
        return Err(invalid("its header is too deeply nested"));
    }
    NpyHeader::from_reader(&bytes[..])
}

/// How the numbers of an array are stored; truth values as bytes.
fn scalar_type(kind: TypeChar, width: usize) -> Option<Scalar> {
    Some(match (kind, width) {
        (TypeChar::Int, 1) => Scalar::I8,
        (TypeChar::Bool | TypeChar::Uint, 1) => Scalar::U8,
        (TypeChar::Int, 2) => Scalar::I16,
        (TypeChar::Uint, 2) => Scalar::U16,
        (TypeChar::Int, 4) => Scalar::I32,
        (TypeChar::Uint, 4) => Scalar::U32,
        (TypeChar::Int, 8) => Scalar::I64,
        (TypeChar::Uint, 8) => Scalar::U64,
        (TypeChar::Float, 2) => Scalar::F16,
        (TypeChar::Float, 4) => Scalar::F32,
        (TypeChar::Float, 8) => Scalar::F64,
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
    let steps: Vec<usize> = shape.iter().scan(1, |s, n| Some(std::mem::replace(s, *s * n))).collect();
    let mut index = vec![0; shape.len()];
    let mut source = 0;
    (0..data.len())
        .map(|_| {
            let value = data[source].clone();
            for axis in (0..shape.len()).rev() {
                index[axis] += 1;
                source += steps[axis];
                if index[axis] < shape[axis] {
                    break;
                }
                source -= steps[axis] * shape[axis];
                index[axis] = 0;
            }
            value
        })
        .collect()
}

#[cfg(test)]
mod tests;
