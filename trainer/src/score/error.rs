//! What can be wrong with meshes to be scored.

use clothcombo_data::format::FileError;
use clothcombo_physics::energy::EnergyError;
use clothcombo_physics::mesh::MeshError;
use miette::Diagnostic;
use std::path::PathBuf;
use thiserror::Error;

/// Why meshes cannot be scored.
#[derive(Debug, Error, Diagnostic)]
pub enum ScoreError {
    /// A mesh file is missing or wrong; the message names file and line.
    // Not a `source`: its text would be printed twice.
    #[error("{reason}")]
    #[diagnostic(help(
        "every mesh is an OBJ, PLY, STL or glTF file of triangles, quads or polygons, in metres"
    ))]
    File {
        /// What the reader said.
        reason: FileError,
    },
    /// Every garment needs all its files.
    #[error("{rest} rest meshes (--rest) but {found} {what} meshes (--{what})")]
    #[diagnostic(help("give each garment once in every list, from the body outwards"))]
    FileCounts {
        /// Rest meshes.
        rest: usize,
        /// The other list.
        what: &'static str,
        /// Its meshes.
        found: usize,
    },
    /// The two files of a garment are different meshes.
    #[error(
        "{} has {} vertices and {} triangles, {} has {} and {}",
        draped.path.display(), draped.vertices, draped.triangles,
        rest.path.display(), rest.vertices, rest.triangles
    )]
    #[diagnostic(help(
        "a draped mesh must be its rest mesh with moved vertices; check the order of the files, and that the \
         program that wrote them neither split nor merged vertices"
    ))]
    Size {
        /// The rest mesh.
        rest: MeshSize,
        /// The draped mesh.
        draped: MeshSize,
    },
    /// Same size, other faces.
    #[error(
        "face {face} has the vertices {draped_face:?} in {} ({} vertices, {} triangles) but {rest_face:?} in {} \
         (the same counts)",
        draped.path.display(), draped.vertices, draped.triangles, rest.path.display()
    )]
    #[diagnostic(help(
        "a draped mesh must have the faces of its rest mesh in the same order; triangles and vertices count from 0 \
         here, after polygons were cut into triangles"
    ))]
    Faces {
        /// The first triangle that differs.
        face: usize,
        /// The rest mesh.
        rest: MeshSize,
        /// Its corners there.
        rest_face: [u32; 3],
        /// The draped mesh.
        draped: MeshSize,
        /// Its corners there.
        draped_face: [u32; 3],
    },
    /// A body that is not in metres.
    #[error("{}: {what}", path.display())]
    #[diagnostic(help("scale body and garments to metres (0.01 for centimetres)"))]
    BodySize {
        /// Its file.
        path: PathBuf,
        /// What tells it.
        what: String,
    },
    /// A garment in another unit or place than the body.
    #[error("{}: {what}", path.display())]
    #[diagnostic(help("body and garments must be in one unit and one place: as draped"))]
    Place {
        /// Its draped file.
        path: PathBuf,
        /// What tells it.
        what: String,
    },
    /// A rest mesh in another unit than the draped one.
    #[error("{} beside {}: {what}", rest.display(), draped.display())]
    #[diagnostic(help("rest and draped meshes must be in one unit: metres"))]
    RestUnit {
        /// The rest file.
        rest: PathBuf,
        /// The draped file.
        draped: PathBuf,
        /// What tells it.
        what: String,
    },
    /// Positions that are not those of the garment.
    #[error("garment '{garment}': {reason}")]
    Positions {
        /// Its name.
        garment: String,
        /// What is wrong with them.
        reason: MeshError,
    },
    /// A face lies on another one.
    #[error("garment '{garment}': face {face} has the vertices of face {first}")]
    #[diagnostic(help(
        "remove one of them, or let `clothcombo fit` repair the rest mesh (triangles count from 0, after polygons were cut)"
    ))]
    DoubledFace {
        /// Its name.
        garment: String,
        /// The face.
        face: u32,
        /// The earlier one of the same vertices.
        first: u32,
    },
    /// A garment without energies.
    #[error("garment '{garment}': {reason}")]
    Energy {
        /// Its name.
        garment: String,
        /// Why.
        reason: EnergyError,
    },
    /// A value beyond what a number can hold.
    #[error("'{of}' has a {term} of {value}")]
    #[diagnostic(help("the coordinates are far outside a human body; all files must be in metres"))]
    Overflow {
        /// The garment or pair.
        of: String,
        /// The value.
        term: &'static str,
        /// What it came to.
        value: f64,
    },
}

impl From<FileError> for ScoreError {
    fn from(reason: FileError) -> Self {
        ScoreError::File { reason }
    }
}

/// A mesh file and what it holds, for messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshSize {
    /// The file.
    pub path: PathBuf,
    /// Its vertices.
    pub vertices: usize,
    /// Its triangles.
    pub triangles: usize,
}
