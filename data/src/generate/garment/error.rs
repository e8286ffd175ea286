//! Why a garment was not generated.

use crate::asset::Category;
use thiserror::Error;

/// Why no garment was generated.
#[derive(Debug, Error)]
pub enum GarmentError {
    /// The body is no T-posed human body with the SMPL joints.
    #[error("cannot cut garments for body '{body}': {reason}")]
    UnsuitableBody {
        /// Body name.
        body: String,
        /// What does not fit.
        reason: String,
    },
    /// More or fewer vertices than a garment can have.
    #[error("garment generator: {0} vertices, expected 200 to 50000")]
    Vertices(usize),
    /// No design of this seed passed the checks.
    #[error(
        "no {category} for seed {seed} passed the checks in {attempts} designs; the last one {last}; \
         hint: use another seed, or more vertices if the garment has narrow parts"
    )]
    Exhausted {
        /// Wanted category.
        category: Category,
        /// Seed.
        seed: u64,
        /// How many designs were tried.
        attempts: u64,
        /// What was wrong with the last.
        last: String,
    },
}
