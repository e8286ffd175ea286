//! Why a problem cannot be solved at all.

use thiserror::Error;

use crate::energy::EnergyError;

/// What is wrong with the input of the solver. All indices are 0-based, over the vertices of all garments in order.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EquilibriumError {
    /// The scene does not fit together.
    #[error(transparent)]
    Energy(#[from] EnergyError),

    /// A list does not have one entry per vertex.
    #[error(
        "the scene has {expected} vertices, but there are {found} {what}; hint: garments are packed in order"
    )]
    Count {
        /// What the list holds.
        what: &'static str,
        /// Vertices of the scene.
        expected: usize,
        /// Entries given.
        found: usize,
    },

    /// A garment is held at canonical positions, which posed ones do not determine.
    #[error("a garment is held before skinning; hint: pull its heights back from posed positions")]
    Canonical,

    /// A start position is NaN or infinite.
    #[error("vertex {vertex} starts at a position that is not finite; hint: check what made the start")]
    StartPosition {
        /// The vertex.
        vertex: usize,
    },

    /// Energy or gradient are NaN or infinite at finite start positions.
    #[error(
        "energy or gradient are not finite at the start; hint: check the weights, and that the body has finite positions"
    )]
    StartEnergy,

    /// A setting is out of its range.
    #[error("solver setting `{setting}` is {value}; hint: it must be {expected}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },
}
