//! Where an asset comes from and under which terms it may be used.

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
    /// Whether this project made the garment, by its generator or from helper meshes of the body. Garments of one maker are
    /// relatives: one of them that was never trained on is still like those that were.
    pub fn is_made_here(&self) -> bool {
        self.source.starts_with(GENERATED) || self.source.contains(CUT_FROM_HELPERS)
    }
}
