//! What can be wrong with the input of the energies.

use thiserror::Error;

/// Why energies could not be set up. All indices are 0-based.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EnergyError {
    /// A setting is out of its range.
    #[error("energy setting `{setting}` is {value}; hint: it must be {expected}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },

    /// A topology that was made from another mesh.
    #[error(
        "the topology has {topology} vertices and the rest mesh {mesh}; hint: make both from the same mesh"
    )]
    TopologyMismatch {
        /// Vertices of the topology.
        topology: usize,
        /// Vertices of the mesh.
        mesh: usize,
    },

    /// A garment without extent has no rest shape.
    #[error(
        "the rest mesh has no area: all {faces} faces are collapsed; hint: check the unit and the positions of the file"
    )]
    NoArea {
        /// Faces of the mesh.
        faces: usize,
    },

    /// A garment's holding reference does not fit the garment.
    #[error(
        "garment {garment} has {expected} vertices but {found} holding reference positions; hint: pass its canonical \
         positions before any learned displacement"
    )]
    HoldingReference {
        /// Index of the garment in the scene.
        garment: usize,
        /// Vertices of the garment.
        expected: usize,
        /// Reference positions given.
        found: usize,
    },

    /// The thicknesses below a garment do not fit the garment.
    #[error(
        "garment {garment} has {expected} vertices but {found} thicknesses of the garments below; hint: pass one per vertex, \
         or none"
    )]
    ThicknessBelow {
        /// Index of the garment in the scene.
        garment: usize,
        /// Vertices of the garment.
        expected: usize,
        /// Thicknesses given.
        found: usize,
    },

    /// A pair of layers that does not exist.
    #[error(
        "layer pair {pair} joins garments {inner} and {outer} of a scene with {garments}; hint: garments are numbered \
         from the body outwards, so inner < outer < number of garments"
    )]
    LayerPair {
        /// Index of the pair.
        pair: usize,
        /// The inner garment it names.
        inner: usize,
        /// The outer garment it names.
        outer: usize,
        /// Garments in the scene.
        garments: usize,
    },

    /// A weight that is NaN or infinite.
    #[error("the weight of `{term}` is {value}; hint: weights are finite numbers, 0 switches a term off")]
    Weight {
        /// The term.
        term: &'static str,
        /// The weight.
        value: f64,
    },
}
