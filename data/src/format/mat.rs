//! MATLAB files of level 5 ("MAT-5"; what `scipy.io.savemat` and MATLAB's `save -v6` and `-v7` write), for reading.
//!
//! Own reader, because the crates there are know numeric arrays only, and CLOTH3D keeps its garments as nested structures.
//! Read are numbers, text, structures and cells, compressed or not, in either byte order; what else there is (sparse
//! matrices, functions, objects) is kept as [`MatValue::Other`] with its name.

use super::error::FileError;
use super::npz::{Array, row_major_from_fortran};
use super::scalar::Scalar;
use flate2::read::ZlibDecoder;
use std::fs;
use std::io::Read;
use std::path::Path;

/// The value of a variable, a field or a cell.
#[derive(Clone, Debug, PartialEq)]
pub enum MatValue {
    /// A numeric or logical array, row-major; the imaginary part of complex ones is left out.
    Numbers(Array<f64>),
    /// Text; the rows of a character matrix are separated by line feeds.
    Text(String),
    /// A structure array: the fields of each of its elements, in file order.
    Struct(Vec<Vec<(String, MatValue)>>),
    /// A cell array, in file (column-major) order.
    Cell(Vec<MatValue>),
    /// Something this reader does not understand: what it is.
    Other(&'static str),
}

impl MatValue {
    /// The value of a field of a 1×1 structure.
    pub fn field(&self, name: &str) -> Option<&Self> {
        self.fields()?.iter().find(|(n, _)| n == name).map(|(_, value)| value)
    }

    /// All fields of a 1×1 structure.
    pub fn fields(&self) -> Option<&[(String, Self)]> {
        match self {
            Self::Struct(elements) => match &elements[..] {
                [one] => Some(one),
                _ => None,
            },
            _ => None,
        }
    }

    /// What it is, for messages.
    pub fn describe(&self) -> String {
        match self {
            Self::Numbers(a) => format!("numbers of shape {:?}", a.shape),
            Self::Text(_) => "text".into(),
            Self::Struct(elements) => format!("a structure array of {}", elements.len()),
            Self::Cell(cells) => format!("a cell array of {}", cells.len()),
            Self::Other(what) => (*what).into(),
        }
    }
}

/// Everything a MAT file holds, in file order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MatFile {
    /// Names and values.
    pub variables: Vec<(String, MatValue)>,
}

const MAT_HEADER: usize = 128;
/// Metadata files are small; whatever decompresses to more than this is an attack or a mistake (bytes).
const LARGEST_MAT_FILE: u64 = 1 << 28;
const DEEPEST_NESTING: usize = 32;
/// Codes of the data types ("mi…" in the format's description).
const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;

impl MatFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`FileError`] naming file and variable.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let failed = FileError::io(path);
        let file = fs::File::open(path).map_err(&failed)?;
        let mut bytes = Vec::new();
        file.take(LARGEST_MAT_FILE + 1).read_to_end(&mut bytes).map_err(failed)?;
        Self::parse(&bytes, path)
    }

    /// Parses the bytes of a file; `path` is for messages only.
    ///
    /// # Errors
    /// [`FileError`] naming file and variable.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, FileError> {
        let wrong = FileError::content(path);
        let not = |reason: &str| wrong(format!("not a MAT-5 file ({reason})"));
        if bytes.len() as u64 > LARGEST_MAT_FILE {
            return Err(not("larger than 256 MiB"));
        }
        if bytes.starts_with(b"\x89HDF") || bytes.starts_with(b"MATLAB 7.3") {
            return Err(not("it is a version 7.3 file, that is HDF5; save it again with -v7"));
        }
        let big = match bytes.get(126..MAT_HEADER) {
            Some(b"IM") => false,
            Some(b"MI") => true,
            _ => return Err(not("it has no level-5 header; a level-4 file must be saved again with -v7")),
        };
        let mut budget = LARGEST_MAT_FILE;
        let mut file = Self::default();
        let mut rest = MatReader { bytes: &bytes[MAT_HEADER..], big };
        while !rest.bytes.is_empty() {
            let number = file.variables.len() + 1;
            let damaged = |(name, reason): (String, String)| {
                let element =
                    if name.is_empty() { format!("variable {number}") } else { format!("variable '{name}'") };
                wrong(format!("{element} is damaged: {reason}"))
            };
            let unnamed = |reason| damaged((String::new(), reason));
            let (kind, data) = rest.element().map_err(unnamed)?;
            let inflated;
            let (kind, data) = if kind == COMPRESSED {
                inflated = inflate(data, &mut budget).map_err(unnamed)?;
                MatReader { bytes: &inflated, big }.element().map_err(unnamed)?
            } else {
                (kind, data)
            };
            if kind != MATRIX {
                return Err(unnamed(format!("its data type is {kind}, expected a matrix")));
            }
            let variable = matrix(MatReader { bytes: data, big }, 0).map_err(damaged)?;
            file.variables.push(variable);
        }
        Ok(file)
    }

    /// The value of a variable.
    pub fn get(&self, name: &str) -> Option<&MatValue> {
        self.variables.iter().find(|(n, _)| n == name).map(|(_, value)| value)
    }
}

fn inflate(data: &[u8], budget: &mut u64) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    ZlibDecoder::new(data).take(*budget + 1).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    *budget = budget.checked_sub(bytes.len() as u64).ok_or("it decompresses to more than 256 MiB")?;
    Ok(bytes)
}

/// A stretch of tagged data elements.
#[derive(Clone, Copy)]
struct MatReader<'a> {
    bytes: &'a [u8],
    big: bool,
}

impl<'a> MatReader<'a> {
    fn u32_at(&self, at: usize) -> Result<u32, String> {
        let cell: [u8; 4] = (self.bytes.get(at..at + 4).and_then(|b| b.try_into().ok()))
            .ok_or_else(|| "truncated in the middle of a tag".to_string())?;
        Ok(if self.big { u32::from_be_bytes(cell) } else { u32::from_le_bytes(cell) })
    }

    /// The next element's data type and data; the padding that follows it is skipped.
    fn element(&mut self) -> Result<(u32, &'a [u8]), String> {
        let word = self.u32_at(0)?;
        // Small elements pack type, size and up to four bytes of data into eight bytes.
        let (kind, start, size) = if word >> 16 == 0 {
            (word, 8, self.u32_at(4)? as usize)
        } else {
            (word & 0xffff, 4, (word >> 16) as usize)
        };
        if start == 4 && size > 4 {
            return Err(format!("a small element claims {size} bytes"));
        }
        let data = self.bytes.get(start..).and_then(|b| b.get(..size)).ok_or_else(|| {
            format!("truncated: {} of {size} bytes", self.bytes.len().saturating_sub(start))
        })?;
        let end = if start == 4 {
            8
        } else if kind == COMPRESSED {
            start + size
        } else {
            start + size.next_multiple_of(8)
        };
        self.bytes = self.bytes.get(end..).unwrap_or_default();
        Ok((kind, data))
    }

    fn numbers(&mut self) -> Result<Vec<f64>, String> {
        let (kind, data) = self.element()?;
        numbers(kind, data, self.big)
    }
}

/// The cells of a numeric element.
fn numbers(kind: u32, data: &[u8], big: bool) -> Result<Vec<f64>, String> {
    let scalar = match kind {
        1 => Scalar::I8,
        2 | 16 => Scalar::U8,
        3 => Scalar::I16,
        4 | 17 => Scalar::U16,
        5 => Scalar::I32,
        6 | 18 => Scalar::U32,
        7 => Scalar::F32,
        9 => Scalar::F64,
        12 => Scalar::I64,
        13 => Scalar::U64,
        _ => return Err(format!("data type {kind} is not numeric")),
    };
    Ok(data.chunks_exact(scalar.bytes()).map(|cell| scalar.read(cell, big)).collect())
}

/// Name and value of a matrix element. The error carries the name, as far as it was read.
fn matrix(mut reader: MatReader<'_>, depth: usize) -> Result<(String, MatValue), (String, String)> {
    // An element without content is MATLAB's empty matrix.
    if reader.bytes.is_empty() {
        return Ok((String::new(), MatValue::Numbers(Array { shape: vec![0, 0], data: Vec::new() })));
    }
    let unnamed = |reason: String| (String::new(), reason);
    let flags = reader.numbers().map_err(unnamed)?;
    let flags = *flags.first().ok_or_else(|| unnamed("its flags are empty".into()))? as u32;
    let shape: Vec<usize> = reader.numbers().map_err(unnamed)?.iter().map(|n| *n as usize).collect();
    let count = shape.iter().try_fold(1usize, |a, n| a.checked_mul(*n));
    let count = count.ok_or_else(|| unnamed(format!("shape {shape:?} does not fit in memory")))?;
    let (_, name) = reader.element().map_err(unnamed)?;
    let name = String::from_utf8_lossy(name).into_owned();
    match content(reader, flags & 0xff, shape, count, depth) {
        Ok(value) => Ok((name, value)),
        Err(reason) => Err((name, reason)),
    }
}

fn content(
    mut reader: MatReader<'_>,
    class: u32,
    shape: Vec<usize>,
    count: usize,
    depth: usize,
) -> Result<MatValue, String> {
    if depth > DEEPEST_NESTING {
        return Err(format!("nested more than {DEEPEST_NESTING} levels deep"));
    }
    Ok(match class {
        1 => {
            let cells: Result<Vec<_>, String> = (0..count).map(|_| nested(&mut reader, depth)).collect();
            MatValue::Cell(cells?)
        }
        2 => {
            let names = field_names(&mut reader)?;
            if names.is_empty() {
                return Ok(MatValue::Struct(vec![Vec::new(); count.min(1)]));
            }
            let element = |reader: &mut MatReader<'_>| -> Result<Vec<(String, MatValue)>, String> {
                let field = |n: &String| match nested(reader, depth) {
                    Ok(value) => Ok((n.clone(), value)),
                    Err(reason) => Err(format!("field '{n}': {reason}")),
                };
                names.iter().map(field).collect()
            };
            let elements: Result<Vec<_>, String> = (0..count).map(|_| element(&mut reader)).collect();
            MatValue::Struct(elements?)
        }
        3 => MatValue::Other("an object of a MATLAB class"),
        4 => {
            let (kind, data) = reader.element()?;
            MatValue::Text(text(kind, data, reader.big, &shape)?)
        }
        5 => MatValue::Other("a sparse matrix"),
        6..=15 => {
            let data = reader.numbers()?;
            if data.len() != count {
                return Err(format!("{} numbers for shape {shape:?}", data.len()));
            }
            MatValue::Numbers(Array { data: row_major_from_fortran(data, &shape), shape })
        }
        16 => MatValue::Other("a function handle"),
        17 => MatValue::Other("an opaque object"),
        _ => return Err(format!("unknown array class {class}")),
    })
}

fn nested(reader: &mut MatReader<'_>, depth: usize) -> Result<MatValue, String> {
    let (kind, data) = reader.element()?;
    if kind != MATRIX {
        return Err(format!("its data type is {kind}, expected a matrix"));
    }
    matrix(MatReader { bytes: data, big: reader.big }, depth + 1)
        .map(|(_, value)| value)
        .map_err(|(_, reason)| reason)
}

fn field_names(reader: &mut MatReader<'_>) -> Result<Vec<String>, String> {
    let width = reader.numbers()?.first().copied().unwrap_or(0.0);
    let (_, data) = reader.element()?;
    if !(1.0..=4096.0).contains(&width) {
        return if data.is_empty() { Ok(Vec::new()) } else { Err(format!("field names of {width} bytes")) };
    }
    let name = |cell: &[u8]| {
        let end = cell.iter().position(|b| *b == 0).unwrap_or(cell.len());
        String::from_utf8_lossy(&cell[..end]).into_owned()
    };
    Ok(data.chunks_exact(width as usize).map(name).collect())
}

/// A character array; `shape` is (rows, columns), stored by columns.
fn text(kind: u32, data: &[u8], big: bool, shape: &[usize]) -> Result<String, String> {
    let characters: Vec<char> = match kind {
        // UTF-8 counts bytes, so that it goes through a string.
        1 | 2 | 16 => String::from_utf8_lossy(data).chars().collect(),
        4 | 17 => {
            let units = numbers(4, data, big)?.into_iter().map(|x| x as u16);
            char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
        }
        18 => (numbers(6, data, big)?.into_iter())
            .map(|x| char::from_u32(x as u32).unwrap_or(char::REPLACEMENT_CHARACTER))
            .collect(),
        _ => return Err(format!("text of data type {kind}")),
    };
    let rows = shape.first().copied().unwrap_or(1);
    if rows <= 1 || rows > characters.len() {
        return Ok(characters.into_iter().collect());
    }
    let line = |row: usize| characters[row..].iter().step_by(rows).collect::<String>();
    Ok((0..rows)
        .map(|row| line(row).trim_end_matches([' ', '\0']).to_string())
        .collect::<Vec<_>>()
        .join("\n"))
}
