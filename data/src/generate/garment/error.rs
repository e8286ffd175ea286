//! Why a garment was not generated.

use thiserror::Error;

/// Why no garment was generated: a body that is none to cut garments for, a number of vertices that no garment can have, or what
/// was wrong with the last design of a seed.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct GarmentError(pub(super) String);
