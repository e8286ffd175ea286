//! Where an asset comes from and under which terms it may be used.

use crate::format::{NpzFile, NpzWriter};
use serde::{Deserialize, Serialize};

/// Source, author and licence of an asset, kept with it through every import and export. Empty where unknown.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Provenance {
    /// Package or collection, with version.
    pub source: String,
    /// Author to attribute.
    pub author: String,
    /// Licence, as an SPDX identifier where there is one.
    pub licence: String,
}

/// How the source of a garment made by the generator begins.
pub(crate) const GENERATED: &str = "generated for ";
/// What the source of a garment cut from helper meshes of the body contains.
pub const CUT_FROM_HELPERS: &str = "cut from the clothing helpers";

impl Provenance {
    /// What an npz file says of itself; empty where it says nothing that can be read.
    pub fn read(file: &mut NpzFile) -> Self {
        let mut text = |key| file.text(key).ok().flatten().unwrap_or_default();
        Self { source: text("source"), author: text("author"), licence: text("licence") }
    }

    /// Adds it to an npz file.
    pub fn write(&self, npz: &mut NpzWriter) {
        npz.strings("source", &[], &[&self.source]).strings("author", &[], &[&self.author]).strings(
            "licence",
            &[],
            &[&self.licence],
        );
    }

    /// Whether this project made the garment, by its generator or from helper meshes of the body. Garments of one maker are
    /// relatives: one of them that was never trained on is still like those that were.
    pub fn is_made_here(&self) -> bool {
        self.source.starts_with(GENERATED) || self.source.contains(CUT_FROM_HELPERS)
    }
}
