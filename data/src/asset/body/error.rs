//! What can be wrong with a body.

use thiserror::Error;

/// Why a body cannot be made or posed.
#[derive(Debug, Error)]
pub enum BodyError {
    /// An array does not have the length the others ask for.
    #[error("body '{body}': {part} has {found} numbers, expected {expected} ({layout})")]
    Shape {
        /// Body name.
        body: String,
        /// Which array.
        part: &'static str,
        /// What its layout should be.
        layout: &'static str,
        /// Its length.
        found: usize,
        /// The length it should have.
        expected: usize,
    },
    /// A number is NaN or infinite.
    #[error("body '{body}': {part} holds a non-finite number at position {index}")]
    NonFinite {
        /// Body name.
        body: String,
        /// Which array.
        part: &'static str,
        /// Flat position in it.
        index: usize,
    },
    /// The joints are not a tree with parents first.
    #[error(
        "body '{body}': joint {joint} has parent {parent:?}; joint 0 must be the only root and parents must come first"
    )]
    Tree {
        /// Body name.
        body: String,
        /// The joint.
        joint: usize,
        /// Its parent.
        parent: Option<usize>,
    },
    /// A vertex has no usable skin weights.
    #[error("body '{body}': skin weights of vertex {vertex} {problem}")]
    Weights {
        /// Body name.
        body: String,
        /// The vertex.
        vertex: usize,
        /// What is wrong.
        problem: String,
    },
    /// The surface is not a mesh.
    #[error("body '{body}': {message}")]
    Mesh {
        /// Body name.
        body: String,
        /// What the mesh check said.
        message: String,
    },
    /// More shape numbers than the body has components.
    #[error("{given} shape numbers for body '{body}', which has {available} shape components")]
    TooManyShapeNumbers {
        /// Body name.
        body: String,
        /// How many were given.
        given: usize,
        /// How many there are.
        available: usize,
    },
    /// More pose rotations than the body has joints.
    #[error("{given} joint rotations for body '{body}', which has {available} joints")]
    TooManyJoints {
        /// Body name.
        body: String,
        /// How many were given.
        given: usize,
        /// How many there are.
        available: usize,
    },
}
