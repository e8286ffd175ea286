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
