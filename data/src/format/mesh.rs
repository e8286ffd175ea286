//! Meshes of any file format: polygons as the file holds them, and one entry that reads them all.
//!
//! Garments and bodies come as Wavefront OBJ, PLY, STL and glTF. Every reader gives the same [`PolygonMesh`], in the file's own
//! unit and axes. What a file holds too much of is refused before memory is taken for it.

use super::obj::{ObjError, ObjMesh};
use super::{gltf, ply, stl};
use clothcombo_physics::mesh::{MeshError, TriMesh};
use std::fs;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Extensions of the mesh formats, lower case.
pub const MESH_EXTENSIONS: [&str; 5] = ["obj", "ply", "stl", "gltf", "glb"];

/// Largest mesh file that is read [bytes]. A garment of 50,000 vertices takes about 5 MB as text.
pub const MAX_FILE_BYTES: u64 = 256 << 20;

/// Most vertices, and most polygons, a mesh file may hold. Scans have fewer; a network sees some thousand.
pub const MAX_ELEMENTS: usize = 8_000_000;

/// Why a mesh file cannot be used.
#[derive(Debug, Error)]
pub enum MeshFileError {
    /// The file cannot be read.
    #[error("{}: {reason}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        reason: std::io::Error,
    },
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
    Obj(#[from] ObjError),
    /// The content of a PLY, STL or glTF file is wrong.
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

/// A mesh file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// Polygon file format, ASCII or binary.
    Ply,
    /// Stereolithography, ASCII or binary.
    Stl,
    /// glTF 2.0, JSON or binary.
    Gltf,
}

impl MeshFormat {
    /// The format of a file: by its content where that is unmistakable, by its extension otherwise.
    pub fn detect(path: &Path, bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"glTF") {
            return Some(Self::Gltf);
        }
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            return Some(Self::Ply);
        }
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        match extension.as_str() {
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            "stl" => Some(Self::Stl),
            "gltf" | "glb" => Some(Self::Gltf),
            _ if stl::is_binary(bytes) || bytes.starts_with(b"solid ") => Some(Self::Stl),
            _ => None,
        }
    }
}

/// Whether the extension of `path` is one of [`MESH_EXTENSIONS`].
pub fn is_mesh_path(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str());
    extension.is_some_and(|e| MESH_EXTENSIONS.iter().any(|known| known.eq_ignore_ascii_case(e)))
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
            return Err("no faces; a point cloud is not a garment or body".into());
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

/// A polygon as triangles around its first corner.
pub(crate) fn fan(polygon: &[u32]) -> impl Iterator<Item = [u32; 3]> + '_ {
    polygon.get(1..).unwrap_or_default().windows(2).map(|w| [polygon[0], w[0], w[1]])
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
    let failed = |reason| MeshFileError::Io { path: path.into(), reason };
    let metadata = fs::metadata(path).map_err(failed)?;
    if !metadata.is_file() {
        let reason = std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a regular file");
        return Err(MeshFileError::Io { path: path.into(), reason });
    }
    if metadata.len() > MAX_FILE_BYTES {
        return Err(MeshFileError::TooLarge { path: path.into(), bytes: metadata.len() });
    }
    fs::read(path).map_err(failed)
}

/// Reads a mesh file of any known format; the content decides where it is unmistakable, the extension otherwise.
///
/// # Errors
/// [`MeshFileError`] naming the file, the line or element, and what to do.
pub fn load_mesh(path: &Path) -> Result<PolygonMesh, MeshFileError> {
    parse_mesh(&read_limited(path)?, path)
}

/// [`load_mesh`] of a file already in memory; the folder of `path` is where buffers of a glTF file are looked for.
///
/// # Errors
/// As [`load_mesh`].
pub fn parse_mesh(bytes: &[u8], path: &Path) -> Result<PolygonMesh, MeshFileError> {
    let content = |result: Result<PolygonMesh, String>| {
        result
            .and_then(PolygonMesh::checked)
            .map_err(|message| MeshFileError::Content { path: path.into(), message })
    };
    match MeshFormat::detect(path, bytes) {
        Some(MeshFormat::Obj) => Ok(ObjMesh::parse_bytes(bytes, path)?.into_polygon_mesh()),
        Some(MeshFormat::Ply) => content(ply::parse(bytes)),
        Some(MeshFormat::Stl) => content(stl::parse(bytes)),
        Some(MeshFormat::Gltf) => content(gltf::parse(bytes, path)),
        None => Err(MeshFileError::Format { path: path.into() }),
    }
}

/// Reads a mesh file of any known format as triangles, repairing nothing.
///
/// # Errors
/// As [`load_mesh`], and [`MeshFileError::RepeatedCorner`].
pub fn load_tri_mesh(path: &Path) -> Result<TriMesh, MeshFileError> {
    load_mesh(path)?.to_tri_mesh(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::{Body, BodyFileSettings, Motion};
    use crate::dataset::{load_garment_folder, load_motion_folder};
    use crate::format::{Bvh, MatFile, PointCache};
    use crate::generate::mannequin;
    use std::error::Error;

    /// Whoever prints an error prints its sources below it: a text that has them already must not name them as such.
    #[test]
    fn no_error_tells_its_cause_twice() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("missing.obj");
        let errors: [Box<dyn Error>; 8] = [
            load_mesh(&missing).unwrap_err().into(),
            Body::load(&missing, &BodyFileSettings::default()).unwrap_err().into(),
            Motion::load(&missing).unwrap_err().into(),
            Bvh::load(&missing).unwrap_err().into(),
            MatFile::load(&missing).unwrap_err().into(),
            PointCache::load(&missing).unwrap_err().into(),
            load_garment_folder(&missing, &mannequin()).unwrap_err().into(),
            load_motion_folder(&missing).unwrap_err().into(),
        ];
        for error in errors {
            let text = error.to_string();
            assert!(text.contains("missing.obj") && text.contains("os error 2"), "{text}");
            assert!(error.source().is_none_or(|cause| !text.contains(&cause.to_string())), "{text}");
        }
    }
}
