//! The body of a run: built in, or read from its file.

use super::error::DatasetError;
use clothcombo_data::asset::{Body, BodyFileSettings, Provenance};
use clothcombo_data::cache::{KeyBuilder, body_key};
use clothcombo_data::format::npz::NpzFile;
use clothcombo_data::generate::mannequin;
use std::path::Path;

/// Reads `"mannequin"` or a body npz with at most `shape_components` components (0: all it has).
///
/// # Errors
/// When the file is not a body model.
pub fn load_body(name: &str, shape_components: usize) -> Result<Body, DatasetError> {
    match name {
        "mannequin" => Ok(mannequin().with_shape_components(limit(shape_components))),
        path => read_body(NpzFile::open(Path::new(path)).map_err(DatasetError::data)?, shape_components),
    }
}

/// As [`load_body`], from an open archive.
///
/// # Errors
/// When it is no body.
pub fn read_body(file: NpzFile, shape_components: usize) -> Result<Body, DatasetError> {
    let settings = BodyFileSettings { shape_components: limit(shape_components) };
    Body::read(file, &settings).map_err(DatasetError::data)
}

/// Shape components to be read at most; 0: all.
fn limit(shape_components: usize) -> usize {
    if shape_components == 0 { usize::MAX } else { shape_components }
}

/// What a body file says about where it comes from; empty where it says nothing.
pub(super) fn body_source(name: &str) -> Provenance {
    if name == "mannequin" {
        return Provenance {
            source: "built in".into(),
            author: "ClothCombo-rs".into(),
            licence: "CC0-1.0".into(),
        };
    }
    let Ok(mut file) = NpzFile::open(Path::new(name)) else { return Provenance::default() };
    let mut text = |key: &str| {
        let found = file.strings(key, "").ok().and_then(|array| array.data.into_iter().next());
        found.unwrap_or_default()
    };
    Provenance { source: text("source"), author: text("author"), licence: text("licence") }
}

/// `key` with the mean body, its shapes, joints and pose correctives.
pub(super) fn with_body(key: KeyBuilder, body: &Body) -> KeyBuilder {
    key.key(body_key(body))
        .array(body.joint_template.as_flattened())
        .array(body.pose_directions.as_deref().unwrap_or_default())
}
