//! What can be wrong with input to the networks.

use thiserror::Error;

/// Why tensors or networks could not be made.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A configuration value is out of range.
    #[error("model.{key} = {value}: expected {expected}")]
    Config {
        /// Key in the `model` table.
        key: &'static str,
        /// Value found.
        value: String,
        /// What would be accepted.
        expected: String,
    },
    /// An array has the wrong number of elements.
    #[error("{array} has {found} elements, expected {expected} ({layout})")]
    Length {
        /// Name of the array.
        array: &'static str,
        /// Number of elements it should have.
        expected: usize,
        /// Number of elements found.
        found: usize,
        /// The expected layout in words.
        layout: &'static str,
    },
    /// An array holds NaN or an infinity.
    #[error("{array}[{index}] is {value}: every element must be finite")]
    NotFinite {
        /// Name of the array.
        array: &'static str,
        /// Position in the flat array.
        index: usize,
        /// Value found.
        value: f64,
    },
    /// The vertex masses of a garment do not add up to a positive number.
    #[error("the vertex masses add up to {total}: a garment needs at least one triangle of positive area")]
    NoMass {
        /// Sum of the masses.
        total: f64,
    },
    /// An outfit has no garment, or its garments disagree on a size.
    #[error("garment {garment} of the outfit: {reason}")]
    Outfit {
        /// Index of the garment, 0 = innermost.
        garment: usize,
        /// What is wrong.
        reason: String,
    },
}

/// Checks length and finiteness of a flat array.
pub(crate) fn check_array(
    array: &'static str,
    values: &[f32],
    expected: usize,
    layout: &'static str,
) -> Result<(), ModelError> {
    match values.len() {
        found if found == expected => check_finite(array, values),
        found => Err(ModelError::Length { array, expected, found, layout }),
    }
}

/// Checks that all elements are finite.
pub(crate) fn check_finite<T: Copy + Into<f64>>(array: &'static str, values: &[T]) -> Result<(), ModelError> {
    match values.iter().map(|&value| value.into()).enumerate().find(|(_, value)| !value.is_finite()) {
        Some((index, value)) => Err(ModelError::NotFinite { array, index, value }),
        None => Ok(()),
    }
}
