//! Why the operators of a mesh could not be made.

use thiserror::Error;

/// Why the operators of a mesh could not be made.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum OperatorError {
    /// All faces together have no area.
    #[error(
        "the mesh has no area (all {faces} faces are collapsed); hint: check the units and the file's coordinates"
    )]
    NoArea {
        /// Number of faces.
        faces: usize,
    },

    /// An area or edge length overflowed.
    #[error(
        "face {face} has a size that is not finite in 64-bit arithmetic; hint: coordinates are metres, check the units"
    )]
    NotFinite {
        /// Index of the face (from 0).
        face: usize,
    },

    /// The sparse factorisation or a dense eigenvalue iteration broke down.
    #[error(
        "{what} failed on the mesh component of vertex {vertex} ({size} vertices); hint: look for faces of wildly different \
         size there and remesh it"
    )]
    Factorisation {
        /// Which step.
        what: &'static str,
        /// Lowest vertex of the component (from 0).
        vertex: u32,
        /// Vertices of the component.
        size: usize,
    },

    /// The eigenvalue iteration reached its limit.
    #[error(
        "the eigenvectors of the mesh component of vertex {vertex} ({size} vertices) did not converge (relative residual \
         {residual:.1e}); hint: ask for fewer eigenvectors or remesh faces of extreme shape"
    )]
    NotConverged {
        /// Lowest vertex of the component (from 0).
        vertex: u32,
        /// Vertices of the component.
        size: usize,
        /// Largest relative residual among the wanted pairs.
        residual: f64,
    },
}
