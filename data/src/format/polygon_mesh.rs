//! What every mesh reader gives: polygons as the file holds them, in its own unit and axes.
//!
//! What a file holds too much of is refused before memory is taken for it.

use super::error::FileError;
use crate::mesh::{Cuts, fan};
use clothcombo_physics::mesh::{MeshError, TriMesh};
use std::path::Path;
use std::{fs, io};

/// Largest mesh file that is read (bytes). A garment of 50,000 vertices takes about 5 MB as text.
pub const MAX_FILE_BYTES: u64 = 256 << 20;

/// Most vertices, and most polygons, a mesh file may hold. Scans have fewer; a network sees some thousand.
pub const MAX_ELEMENTS: usize = 8_000_000;

pub(super) const NO_FACES: &str = "no faces; a point cloud is not a garment or body";

/// Positions as written in the file `[V, 3]`, finite, and polygons of three or more corners, every index below V. A polygon
/// may name a vertex twice: repairing that is the caller's choice.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PolygonMesh {
    /// Vertex positions in the file's unit and axes.
    pub positions: Vec<[f64; 3]>,
    /// Line of each polygon from 1; empty for formats without lines.
    pub lines: Vec<u32>,
    /// Texture coordinates of each vertex, v up; empty where the format or the file has none by vertex.
    pub texture: Vec<[f64; 2]>,
    corners: Vec<u32>,
    ends: Vec<u32>,
}

impl PolygonMesh {
    /// Vertices without polygons yet.
    pub fn with_positions(positions: Vec<[f64; 3]>) -> Self {
        Self { positions, ..Self::default() }
    }

    /// A mesh in memory: `faces` of so many `corners` each, counted from 0.
    ///
    /// # Errors
    /// [`MeshError`] for what no mesh file holds either: no face, a position that is not finite, a vertex that is not there.
    pub fn from_faces(positions: Vec<[f64; 3]>, faces: &[u32], corners: usize) -> Result<Self, MeshError> {
        let vertex_count = positions.len();
        if faces.is_empty() {
            return Err(MeshError::NoFaces);
        }
        if let Some(vertex) = positions.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(MeshError::NonFinitePosition { vertex, position: positions[vertex] });
        }
        if let Some(place) = faces.iter().position(|&v| v as usize >= vertex_count) {
            return Err(MeshError::IndexOutOfRange {
                face: place / corners,
                vertex: faces[place],
                vertex_count,
            });
        }
        let mut mesh = Self::with_positions(positions);
        faces.chunks_exact(corners).for_each(|face| mesh.push(face));
        Ok(mesh)
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

    /// The polygons as fans of triangles around their first corners, or where an earlier one over the same corners
    /// begins; `path` is for messages only.
    ///
    /// # Errors
    /// [`FileError`] if a face names a vertex twice or the faces make no mesh.
    pub fn to_tri_mesh(&self, path: &Path) -> Result<TriMesh, FileError> {
        let mut faces = Vec::with_capacity(self.corners.len().saturating_sub(2 * self.ends.len()));
        let mut cuts = Cuts::default();
        for (face, polygon) in self.polygons().enumerate() {
            if let Some(vertex) = repeated(polygon) {
                let message = format!(
                    "face {} names vertex {} twice (counted from 1); `clothcombo fit` removes such faces",
                    face + 1,
                    u64::from(vertex) + 1
                );
                return Err(match self.lines.get(face) {
                    Some(line) => FileError::line(path, *line as usize)(message),
                    None => FileError::content(path)(message),
                });
            }
            faces.extend(fan(polygon, cuts.first(polygon, || 0)));
        }
        TriMesh::new(self.positions.clone(), faces).map_err(FileError::content(path))
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
///
/// # Errors
/// When it cannot be read, or is larger than [`MAX_FILE_BYTES`].
pub fn read_limited(path: &Path) -> Result<Vec<u8>, FileError> {
    let failed = FileError::io(path);
    let metadata = fs::metadata(path).map_err(&failed)?;
    if !metadata.is_file() {
        return Err(failed(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file")));
    }
    if metadata.len() > MAX_FILE_BYTES {
        let message = format!(
            "{} bytes; mesh files of more than {MAX_FILE_BYTES} bytes are not read, decimate the mesh first",
            metadata.len()
        );
        return Err(FileError::content(path)(message));
    }
    fs::read(path).map_err(failed)
}
