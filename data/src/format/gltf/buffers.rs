//! The bytes behind glTF accessors: the binary chunk, `data:` URIs, files beside the document.

use super::document::{Accessor, GltfDocument, SparsePart};
use crate::format::polygon_mesh::{check_count, read_limited};
use crate::format::scalar::Scalar;
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;
use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

/// The extension by which positions may be integers.
const QUANTISATION: &str = "KHR_mesh_quantization";

/// Component types of the specification.
fn scalar(component_type: u32) -> Option<Scalar> {
    Some(match component_type {
        5120 => Scalar::I8,
        5121 => Scalar::U8,
        5122 => Scalar::I16,
        5123 => Scalar::U16,
        5125 => Scalar::U32,
        5126 => Scalar::F32,
        _ => return None,
    })
}

/// What a normalised number is divided by.
fn largest(scalar: Scalar) -> f64 {
    match scalar {
        Scalar::I8 => 127.0,
        Scalar::U8 => 255.0,
        Scalar::I16 => 32767.0,
        Scalar::U16 => 65535.0,
        _ => 1.0,
    }
}

/// The way out for compressed files.
pub(super) const DECOMPRESS: &str = "compressed meshes are not read; export without compression (Blender: glTF export, Data, \
                                     Compression off; or `gltf-transform copy IN OUT`)";

/// A document and its buffers, which are loaded when first asked for.
pub(super) struct Buffers<'a> {
    pub document: &'a GltfDocument,
    chunk: Option<&'a [u8]>,
    folder: PathBuf,
    loaded: Vec<Option<Cow<'a, [u8]>>>,
}

impl<'a> Buffers<'a> {
    pub fn new(document: &'a GltfDocument, chunk: Option<&'a [u8]>, folder: &Path) -> Self {
        let loaded = document.buffers.iter().map(|_| None).collect();
        Self { document, chunk, folder: folder.into(), loaded }
    }

    /// `N` numbers per item: floats; integers where the document is quantised, and as joints, weights and texture coordinates.
    pub fn numbers<const N: usize>(&mut self, accessor: usize) -> Result<Vec<[f64; N]>, String> {
        let item = self.accessor(accessor)?;
        let kind = match N {
            2 => "VEC2",
            3 => "VEC3",
            4 => "VEC4",
            _ => "MAT4",
        };
        let is_quantised = self.document.extensions_used.iter().any(|name| name == QUANTISATION);
        // Texture coordinates may be normalised without an extension.
        let is_share =
            |scalar: &Scalar| N == 2 && item.normalized && matches!(scalar, Scalar::U8 | Scalar::U16);
        let may_be = |scalar: &Scalar| *scalar == Scalar::F32 || N == 4 || is_quantised || is_share(scalar);
        let Some(scalar) = scalar(item.component_type).filter(may_be).filter(|_| item.kind == kind) else {
            return Err(format!("accessor {accessor} is no {kind} of floats, as it must be here"));
        };
        let divisor = if item.normalized { largest(scalar) } else { 1.0 };
        let size = scalar.bytes();
        let parse = |raw: &[u8]| -> [f64; N] {
            let number = |k: usize| scalar.read(&raw[k * size..(k + 1) * size], false) / divisor;
            // The lowest number of a signed type is below -1.
            std::array::from_fn(|k| if item.normalized { number(k).max(-1.0) } else { number(k) })
        };
        check_count("vertices", item.count)?;
        let mut numbers = Vec::new();
        match (&item.sparse, item.buffer_view) {
            (Some(_), None) => numbers.resize(item.count, [0.0; N]),
            _ => self.for_each(accessor, item, N * size, |raw| numbers.push(parse(raw)))?,
        }
        if let Some(sparse) = &item.sparse {
            let part = |part: &SparsePart, component_type: u32, kind: &str| Accessor {
                buffer_view: Some(part.buffer_view),
                byte_offset: part.byte_offset,
                component_type,
                count: sparse.count,
                kind: kind.to_owned(),
                normalized: false,
                sparse: None,
            };
            check_count("sparse items", sparse.count)?;
            let (Some(indices), Some(values_there)) = (&sparse.indices, &sparse.values) else {
                return Err(format!("accessor {accessor} is sparse without indices or values"));
            };
            let indices = part(indices, indices.component_type.unwrap_or_default(), "SCALAR");
            let indices = self.unsigned(accessor, &indices)?;
            let mut values = Vec::new();
            let of_values = part(values_there, item.component_type, kind);
            self.for_each(accessor, &of_values, N * size, |raw| values.push(parse(raw)))?;
            for (index, value) in indices.into_iter().zip(values) {
                *numbers.get_mut(index as usize).ok_or_else(|| {
                    format!("accessor {accessor} changes item {index}, but has {}", item.count)
                })? = value;
            }
        }
        Ok(numbers)
    }

    /// `count` finite texture coordinates; `None` for anything else.
    pub fn texture(&mut self, accessor: usize, count: usize) -> Option<Vec<[f64; 2]>> {
        let texture: Vec<[f64; 2]> = self.numbers(accessor).ok()?;
        let is_finite = texture.as_flattened().iter().all(|x| x.is_finite());
        Some(texture).filter(|texture| texture.len() == count && is_finite)
    }

    /// A SCALAR of unsigned integers.
    pub fn indices(&mut self, accessor: usize) -> Result<Vec<u32>, String> {
        let item = self.accessor(accessor)?;
        if item.sparse.is_some() {
            return Err(format!("accessor {accessor} is sparse, which indices are not"));
        }
        self.unsigned(accessor, item)
    }

    fn unsigned(&mut self, number: usize, item: &Accessor) -> Result<Vec<u32>, String> {
        let scalar = scalar(item.component_type).filter(|_| item.kind == "SCALAR");
        let Some(scalar) = scalar.filter(|s| matches!(s, Scalar::U8 | Scalar::U16 | Scalar::U32)) else {
            return Err(format!("accessor {number} is no SCALAR of unsigned integers, as indices must be"));
        };
        let mut indices = Vec::new();
        self.for_each(number, item, scalar.bytes(), |raw| {
            indices.push(scalar.read(raw, false) as u32);
        })?;
        Ok(indices)
    }

    /// Hands over every item of an accessor, `size` bytes each, after checking that all of them are there.
    fn for_each(
        &mut self,
        number: usize,
        accessor: &Accessor,
        size: usize,
        mut visit: impl FnMut(&[u8]),
    ) -> Result<(), String> {
        let view_index = accessor
            .buffer_view
            .ok_or_else(|| format!("accessor {number} has no buffer view: {DECOMPRESS}"))?;
        let view = (self.document.buffer_views.get(view_index))
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
        let bytes = self.buffer(view.buffer)?;
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

    fn accessor(&self, index: usize) -> Result<&'a Accessor, String> {
        self.document.accessors.get(index).ok_or_else(|| format!("accessor {index} is not there"))
    }

    fn buffer(&mut self, index: usize) -> Result<&[u8], String> {
        let buffer =
            self.document.buffers.get(index).ok_or_else(|| format!("buffer {index} is not there"))?;
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
