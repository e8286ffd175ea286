//! Why garments cannot be resolved at all.

use thiserror::Error;

/// What is wrong with the input of [`super::resolve`]. Indices are 0-based. Intersections that stay are a result, not an error.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ResolveError {
    /// A setting is out of its range.
    #[error("resolve setting `{setting}` is {value}; hint: it must be {expected}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },

    /// Positions of another mesh.
    #[error(
        "garment {garment} has {expected} vertices, but there are {found} positions; hint: give positions of its own mesh"
    )]
    Count {
        /// The garment.
        garment: usize,
        /// Its vertices.
        expected: usize,
        /// Positions given.
        found: usize,
    },

    /// A face lies on another one: both sides of the sheet would be kept off each other.
    #[error(
        "garment {garment}: face {face} has the vertices of face {first}; hint: remove one of them, or let `clothcombo fit` \
         repair the mesh (indices count from 0)"
    )]
    DoubledFace {
        /// The garment.
        garment: usize,
        /// The face.
        face: u32,
        /// The earlier one of the same vertices.
        first: u32,
    },

    /// Skinning transforms of other garments.
    #[error(
        "the garments have {expected} vertices, but there are {found} skinning transforms; hint: give one for each vertex, garment after garment"
    )]
    Transforms {
        /// Vertices of all garments.
        expected: usize,
        /// Transforms given.
        found: usize,
    },

    /// A position is NaN, infinite or kilometres away.
    #[error(
        "garment {garment}, vertex {vertex} is at [{}, {}, {}]; hint: positions are finite, in metres, within a kilometre of the origin",
        position[0], position[1], position[2]
    )]
    Position {
        /// The garment.
        garment: usize,
        /// The vertex.
        vertex: usize,
        /// Where it is.
        position: [f64; 3],
    },

    /// The body has nothing to keep a distance from.
    #[error(
        "the body has no triangle within a kilometre of the origin; hint: check its mesh, which is in metres"
    )]
    EmptyBody,
}

impl ResolveError {
    /// The garment it is about.
    pub fn garment(&self) -> Option<usize> {
        match *self {
            Self::Count { garment, .. }
            | Self::DoubledFace { garment, .. }
            | Self::Position { garment, .. } => Some(garment),
            Self::Setting { .. } | Self::Transforms { .. } | Self::EmptyBody => None,
        }
    }
}
