//! What every mesh reader gives: polygons as the file holds them, in its own unit and axes, or why it cannot be used.
//!
//! What a file holds too much of is refused before memory is taken for it.

use super::error::{FileError, LineError};
use crate::mesh::fan;
use clothcombo_physics::mesh::{MeshError, TriMesh};
use std::path::{Path, PathBuf};
use std::{fs, io};
use thiserror::Error;

/// Largest mesh file that is read [bytes]. A garment of 50,000 vertices takes about 5 MB as text.
pub const MAX_FILE_BYTES: u64 = 256 << 20;

/// Most vertices, and most polygons, a mesh file may hold. Scans have fewer; a network sees some thousand.
pub const MAX_ELEMENTS: usize = 8_000_000;

pub(super) const NO_FACES: &str = "no faces; a point cloud is not a garment or body";

/// Why a mesh file cannot be used.
#[derive(Debug, Error)]
pub enum MeshFileError {
    /// The file cannot be read.
    #[error(transparent)]
    Io(#[from] FileError),
    /// The name and the content tell no known format.
    #[error("{}: neither its name nor its content is that of a mesh; known are .obj, .ply, .stl, .gltf and .glb", path.display())]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// Larger than any garment.
    #[error("{}: {bytes} bytes; mesh files of more than {MAX_FILE_BYTES} bytes are not read, decimate the mesh first", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
    },
    /// An OBJ line is wrong.
    #[error(transparent)]
    Line(#[from] LineError),
    /// The content is wrong.
    #[error("{}: {message}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Element or line, what is wrong with it, and what to do.
        message: String,
    },
    /// A face names one vertex twice.
    #[error("{}{}: face {face} names vertex {vertex} twice (counted from 1); `clothcombo fit` removes such faces", path.display(), line.map(|l| format!(":{l}")).unwrap_or_default())]
    RepeatedCorner {
        /// The file.
        path: PathBuf,
        /// The line, from 1, where the format has lines.
        line: Option<u32>,
        /// The face, from 1.
        face: usize,
        /// The vertex, from 1.
        vertex: u64,
    },
    /// Not a valid triangle mesh.
    #[error("{}: {reason}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: MeshError,
    },
}

/// Positions as written in the file `[V, 3]`, finite, and polygons of three or more corners, every index below V. A polygon
/// may name a vertex twice: repairing that is the caller's choice.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PolygonMesh {
    /// Vertex positions in the file's unit and axes.
    pub positions: Vec<[f64; 3]>,
    /// Line of each polygon from 1; empty for formats without lines.
    pub lines: Vec<u32>,
    corners: Vec<u32>,
    ends: Vec<u32>,
}

impl PolygonMesh {
    /// Vertices without polygons yet.
    pub fn with_positions(positions: Vec<[f64; 3]>) -> Self {
        Self { positions, ..Self::default() }
    }

    /// Appends a polygon.
    pub fn push(&mut self, corners: &[u32]) {
        self.corners.extend_from_slice(corners);
        self.ends.push(self.corners.len() as u32);
    }

    /// Number of polygons.
    pub fn polygon_count(&self) -> usize {
        self.ends.len()
    }

    /// Corners of each polygon, 0-based.
    pub fn polygons(&self) -> impl Iterator<Item = &[u32]> {
        (0..self.ends.len()).map(|i| {
            let start = i.checked_sub(1).map_or(0, |before| self.ends[before]);
            &self.corners[start as usize..self.ends[i] as usize]
        })
    }

    /// What every reader checks last: something is there, not too much, all finite, all in range.
    pub(super) fn checked(self) -> Result<Self, String> {
        if self.ends.is_empty() {
            return Err(NO_FACES.into());
        }
        check_count("vertices", self.positions.len())?;
        check_count("faces", self.ends.len())?;
        if let Some(v) = self.positions.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(format!("vertex {} has a coordinate that is not finite", v + 1));
        }
        let count = self.positions.len();
        for (face, polygon) in self.polygons().enumerate() {
            if polygon.len() < 3 {
                return Err(format!(
                    "face {} has {} corners, a face needs at least 3",
                    face + 1,
                    polygon.len()
                ));
            }
            if let Some(v) = polygon.iter().find(|v| **v as usize >= count) {
                return Err(format!(
                    "face {} names vertex {}, but the file has {count} vertices",
                    face + 1,
                    u64::from(*v) + 1
                ));
            }
        }
        Ok(self)
    }

    /// The polygons as fans of triangles; `path` is for messages only.
    ///
    /// # Errors
    /// [`MeshFileError::RepeatedCorner`] or [`MeshFileError::Mesh`].
    pub fn to_tri_mesh(&self, path: &Path) -> Result<TriMesh, MeshFileError> {
        let mut faces = Vec::with_capacity(self.corners.len().saturating_sub(2 * self.ends.len()));
        for (face, polygon) in self.polygons().enumerate() {
            if let Some(vertex) = repeated(polygon) {
                return Err(MeshFileError::RepeatedCorner {
                    path: path.into(),
                    line: self.lines.get(face).copied(),
                    face: face + 1,
                    vertex: u64::from(vertex) + 1,
                });
            }
            faces.extend(fan(polygon));
        }
        TriMesh::new(self.positions.clone(), faces)
            .map_err(|reason| MeshFileError::Mesh { path: path.into(), reason })
    }
}

/// A vertex that a polygon names twice.
fn repeated(polygon: &[u32]) -> Option<u32> {
    if polygon.len() <= 16 {
        return polygon.iter().enumerate().find(|(i, v)| polygon[..*i].contains(v)).map(|(_, v)| *v);
    }
    let mut sorted = polygon.to_vec();
    sorted.sort_unstable();
    sorted.windows(2).find(|w| w[0] == w[1]).map(|w| w[0])
}

/// Refuses more elements than [`MAX_ELEMENTS`].
pub(super) fn check_count(what: &str, count: usize) -> Result<(), String> {
    match count > MAX_ELEMENTS {
        true => Err(format!("{count} {what}, more than the {MAX_ELEMENTS} that are read; decimate the mesh")),
        false => Ok(()),
    }
}

/// Reads a file whose size is checked first.
pub(super) fn read_limited(path: &Path) -> Result<Vec<u8>, MeshFileError> {
    let failed = FileError::at(path);
    let metadata = fs::metadata(path).map_err(&failed)?;
    if !metadata.is_file() {
        return Err(failed(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file")).into());
    }
    if metadata.len() > MAX_FILE_BYTES {
        return Err(MeshFileError::TooLarge { path: path.into(), bytes: metadata.len() });
    }
    Ok(fs::read(path).map_err(failed)?)
}
