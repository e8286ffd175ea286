//! `cloth3d.toml`: what the samples say of themselves and their garments.

use super::info::SampleInfo;
use crate::asset::Category;
use crate::format::{FileError, toml_file};
use serde::{Deserialize, Serialize};
use std::path::Path;

pub(super) const LICENCE: &str = "CLOTH3D terms of use (non-commercial research)";
pub(super) const AUTHOR: &str = "Bertiche, Madadi, Escalera (CLOTH3D)";

#[derive(Serialize, Deserialize)]
struct Manifest {
    source: String,
    author: String,
    licence: String,
    sample: Vec<SampleEntry>,
}

/// One sample.
#[derive(Serialize, Deserialize)]
pub(super) struct SampleEntry {
    pub name: String,
    pub gender: String,
    pub shape: Vec<f64>,
    pub tightness: Vec<f64>,
    pub zrot: f64,
    pub frames: usize,
    pub garment: Vec<GarmentEntry>,
}

/// One garment of it.
#[derive(Serialize, Deserialize)]
pub(super) struct GarmentEntry {
    pub name: String,
    pub file: String,
    pub category: Category,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub fabric: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulated_frames: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sequence: Option<String>,
}

impl SampleEntry {
    pub fn new(name: &str, info: &SampleInfo) -> Self {
        Self {
            name: name.into(),
            gender: info.gender.name().into(),
            shape: info.shape.clone(),
            tightness: info.tightness.clone(),
            zrot: info.zrot,
            frames: info.poses.len(),
            garment: Vec::new(),
        }
    }
}

/// Adds samples to the manifest, in place of earlier ones of the same names; it is written whole or not at all.
pub(super) fn add(path: &Path, sample: Vec<SampleEntry>) -> Result<(), FileError> {
    let mut all = toml_file::load::<Manifest>(path)?.map_or_else(Vec::new, |manifest| manifest.sample);
    all.retain(|known| sample.iter().all(|new| new.name != known.name));
    all.extend(sample);
    let manifest = Manifest {
        source: "CLOTH3D / CLOTH3D++".into(),
        author: AUTHOR.into(),
        licence: LICENCE.into(),
        sample: all,
    };
    toml_file::save(path, &manifest)
}
