//! The bytes behind glTF accessors: the binary chunk, `data:` URIs, files beside the document.

use super::document::{Accessor, Document};
use crate::format::polygon_mesh::{check_count, read_limited};
use crate::format::scalar::Scalar;
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;
use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

/// Component types of the specification.
const U8: u32 = 5121;
const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;

/// Buffers of a document, loaded when first asked for.
pub(super) struct Buffers<'a> {
    chunk: Option<&'a [u8]>,
    folder: PathBuf,
    loaded: Vec<Option<Cow<'a, [u8]>>>,
}

impl<'a> Buffers<'a> {
    pub fn new(document: &Document, chunk: Option<&'a [u8]>, folder: &Path) -> Self {
        let loaded = document.buffers.iter().map(|_| None).collect();
        Self { chunk, folder: folder.into(), loaded }
    }

    /// A VEC3 of floats.
    pub fn positions(&mut self, document: &Document, accessor: usize) -> Result<Vec<[f64; 3]>, String> {
        let item = get_accessor(document, accessor)?;
        if item.component_type != F32 || item.kind != "VEC3" {
            return Err(format!("accessor {accessor} is no VEC3 of floats, as positions must be"));
        }
        check_count("vertices", item.count)?;
        let mut positions = Vec::new();
        self.for_each(document, accessor, item, 12, |raw| {
            positions.push(std::array::from_fn(|a| Scalar::F32.read(&raw[4 * a..4 * a + 4], false)));
        })?;
        Ok(positions)
    }

    /// `count` times a VEC2 of finite floats; `None` for anything else.
    pub fn texture(&mut self, document: &Document, accessor: usize, count: usize) -> Option<Vec<[f64; 2]>> {
        let item = get_accessor(document, accessor).ok()?;
        if item.component_type != F32 || item.kind != "VEC2" || item.count != count {
            return None;
        }
        let mut texture: Vec<[f64; 2]> = Vec::new();
        let read = self.for_each(document, accessor, item, 8, |raw| {
            texture.push(std::array::from_fn(|a| Scalar::F32.read(&raw[4 * a..4 * a + 4], false)));
        });
        read.ok().filter(|()| texture.as_flattened().iter().all(|x| x.is_finite())).map(|()| texture)
    }

    /// A SCALAR of unsigned integers.
    pub fn indices(&mut self, document: &Document, accessor: usize) -> Result<Vec<u32>, String> {
        let item = get_accessor(document, accessor)?;
        let scalar = match (item.component_type, item.kind.as_str()) {
            (U8, "SCALAR") => Scalar::U8,
            (U16, "SCALAR") => Scalar::U16,
            (U32, "SCALAR") => Scalar::U32,
            _ => {
                return Err(format!(
                    "accessor {accessor} is no SCALAR of unsigned integers, as indices must be"
                ));
            }
        };
        let mut indices = Vec::new();
        self.for_each(document, accessor, item, scalar.bytes(), |raw| {
            indices.push(scalar.read(raw, false) as u32);
        })?;
        Ok(indices)
    }

    /// Hands over every item of an accessor, `size` bytes each, after checking that all of them are there.
    fn for_each(
        &mut self,
        document: &Document,
        number: usize,
        accessor: &Accessor,
        size: usize,
        mut visit: impl FnMut(&[u8]),
    ) -> Result<(), String> {
        if accessor.sparse.is_some() {
            return Err(format!("accessor {number} is sparse; export the mesh without sparse accessors"));
        }
        let view_index = accessor
            .buffer_view
            .ok_or_else(|| format!("accessor {number} has no buffer view; compressed meshes are not read"))?;
        let view = (document.buffer_views.get(view_index))
            .ok_or_else(|| format!("accessor {number} names buffer view {view_index}, which is not there"))?;
        let stride = view.byte_stride.unwrap_or(size);
        if stride < size || stride > 4096 {
            return Err(format!(
                "buffer view {view_index} has a stride of {stride} bytes for items of {size}"
            ));
        }
        if accessor.count == 0 {
            return Ok(());
        }
        let needed = (accessor.count - 1)
            .checked_mul(stride)
            .and_then(|n| n.checked_add(size))
            .and_then(|n| n.checked_add(accessor.byte_offset));
        let bytes = self.buffer(document, view.buffer)?;
        let view_bytes = view.byte_offset.checked_add(view.byte_length);
        let view_bytes = view_bytes.and_then(|end| bytes.get(view.byte_offset..end)).ok_or_else(|| {
            format!("buffer view {view_index} reaches past the {} bytes of its buffer", bytes.len())
        })?;
        match needed {
            Some(needed) if needed <= view_bytes.len() => {}
            _ => {
                return Err(format!(
                    "accessor {number} has {} items, more than buffer view {view_index} ({} bytes) holds",
                    accessor.count,
                    view_bytes.len()
                ));
            }
        }
        for i in 0..accessor.count {
            let start = accessor.byte_offset + i * stride;
            visit(&view_bytes[start..start + size]);
        }
        Ok(())
    }

    fn buffer(&mut self, document: &Document, index: usize) -> Result<&[u8], String> {
        let buffer = document.buffers.get(index).ok_or_else(|| format!("buffer {index} is not there"))?;
        if self.loaded[index].is_none() {
            self.loaded[index] = Some(match &buffer.uri {
                None => {
                    Cow::Borrowed(self.chunk.ok_or("a buffer without uri needs the binary chunk of a .glb")?)
                }
                Some(uri) => match uri.strip_prefix("data:") {
                    Some(data) => Cow::Owned(decode_data_uri(data, index)?),
                    None => Cow::Owned(self.external(uri)?),
                },
            });
        }
        let bytes = self.loaded[index].as_deref().unwrap_or_default();
        bytes.get(..buffer.byte_length).ok_or_else(|| {
            format!("buffer {index} should have {} bytes, but has {}", buffer.byte_length, bytes.len())
        })
    }

    /// A file in the folder of the document, or below it: a document must not reach elsewhere.
    fn external(&self, uri: &str) -> Result<Vec<u8>, String> {
        let name = percent_decode_str(uri).decode_utf8_lossy();
        let relative = Path::new(name.as_ref());
        let stays = relative.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
        if name.contains("://") || !stays {
            return Err(format!("buffer '{uri}' is no file beside the document"));
        }
        read_limited(&self.folder.join(relative)).map_err(|e| format!("buffer {e}"))
    }
}

/// Files come with padding or without it.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

fn get_accessor(document: &Document, index: usize) -> Result<&Accessor, String> {
    document.accessors.get(index).ok_or_else(|| format!("accessor {index} is not there"))
}

fn decode_data_uri(data: &str, index: usize) -> Result<Vec<u8>, String> {
    let encoded = data.split_once(";base64,").map(|(_, e)| e);
    encoded
        .and_then(|text| BASE64.decode(text).ok())
        .ok_or_else(|| format!("buffer {index} is a data URI that is not valid base64"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_with_or_without_padding_decodes() {
        for (text, bytes) in
            [("", &b""[..]), ("Zg==", b"f"), ("Zm8=", b"fo"), ("Zm9vYg", b"foob"), ("+/8=", b"\xfb\xff")]
        {
            assert_eq!(BASE64.decode(text).as_deref(), Ok(bytes));
        }
        assert!(
            decode_data_uri("data:;base64,Zm9v!", 0).is_err()
                && decode_data_uri("data:;base64,Z", 0).is_err()
        );
    }
}
