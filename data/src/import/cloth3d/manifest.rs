//! `cloth3d.toml`: what the samples say of themselves and their garments.

use super::info::SampleInfo;
use crate::asset::Category;
use crate::format::atomic;
use serde::Serialize;
use std::io;
use std::path::Path;

#[derive(Serialize)]
struct Manifest {
    source: &'static str,
    author: &'static str,
    licence: &'static str,
    sample: Vec<SampleEntry>,
}

/// One sample.
#[derive(Serialize)]
pub(super) struct SampleEntry {
    pub name: String,
    pub gender: &'static str,
    pub shape: Vec<f64>,
    pub tightness: Vec<f64>,
    pub zrot: f64,
    pub frames: usize,
    pub garment: Vec<GarmentEntry>,
}

/// One garment of it.
#[derive(Serialize)]
pub(super) struct GarmentEntry {
    pub name: String,
    pub file: String,
    pub category: Category,
    #[serde(skip_serializing_if = "String::is_empty")]
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
            gender: info.gender.name(),
            shape: info.shape.clone(),
            tightness: info.tightness.clone(),
            zrot: info.zrot,
            frames: info.poses.len(),
            garment: Vec::new(),
        }
    }
}

/// Writes the manifest, whole or not at all.
pub(super) fn write(path: &Path, sample: Vec<SampleEntry>) -> io::Result<()> {
    let manifest =
        Manifest { source: "CLOTH3D / CLOTH3D++", author: super::AUTHOR, licence: super::LICENCE, sample };
    let text = toml::to_string(&manifest).map_err(io::Error::other)?;
    atomic::write(path, text.as_bytes())
}
