//! One entry that reads meshes of all formats: Wavefront OBJ, PLY, STL and glTF.

use super::error::FileError;
use super::foreign::way_out;
use super::obj::ObjMesh;
use super::polygon_mesh::{PolygonMesh, read_limited};
use super::{gltf, ply, stl};
use clothcombo_physics::mesh::TriMesh;
use std::path::Path;

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
        let is_stl = || stl::is_binary(bytes) || bytes.starts_with(b"solid ");
        Self::of_extension(path).or_else(|| is_stl().then_some(Self::Stl))
    }

    fn of_extension(path: &Path) -> Option<Self> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        match extension.as_str() {
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            "stl" => Some(Self::Stl),
            "gltf" | "glb" => Some(Self::Gltf),
            _ => None,
        }
    }
}

/// Whether the extension of `path` is that of a mesh format.
pub fn is_mesh_path(path: &Path) -> bool {
    MeshFormat::of_extension(path).is_some()
}

/// Reads a mesh file of any known format; the content decides where it is unmistakable, the extension otherwise.
///
/// # Errors
/// [`FileError`] naming the file, the line or element, and what to do.
pub fn load_mesh(path: &Path) -> Result<PolygonMesh, FileError> {
    parse_mesh(&read_limited(path)?, path)
}

/// [`load_mesh`] of a file already in memory; the folder of `path` is where buffers of a glTF file are looked for.
///
/// # Errors
/// As [`load_mesh`].
pub fn parse_mesh(bytes: &[u8], path: &Path) -> Result<PolygonMesh, FileError> {
    parse_named(bytes, path, None)
}

fn parse_named(bytes: &[u8], path: &Path, only: Option<&str>) -> Result<PolygonMesh, FileError> {
    let content = match MeshFormat::detect(path, bytes) {
        Some(MeshFormat::Obj) => return Ok(ObjMesh::parse_bytes(bytes, path)?.into_polygon_mesh()),
        Some(MeshFormat::Ply) => ply::parse(bytes),
        Some(MeshFormat::Stl) => stl::parse(bytes),
        Some(MeshFormat::Gltf) => gltf::parse(bytes, path, only),
        None => Err(way_out(path).unwrap_or_else(|| {
            "neither its name nor its content is that of a mesh; known are .obj, .ply, .stl, .gltf and .glb".into()
        })),
    };
    content.and_then(PolygonMesh::checked).map_err(FileError::content(path))
}

/// Reads a mesh file of any known format as triangles, repairing nothing.
///
/// # Errors
/// As [`load_mesh`], and if a face names a vertex twice.
pub fn load_tri_mesh(path: &Path) -> Result<TriMesh, FileError> {
    load_mesh(path)?.to_tri_mesh(path)
}

/// The same of a body: of a glTF scene with several meshes the one that is named `body`.
///
/// # Errors
/// As [`load_tri_mesh`], and if a scene has several meshes, and not one of that name.
pub fn load_body_mesh(path: &Path) -> Result<TriMesh, FileError> {
    parse_named(&read_limited(path)?, path, Some("body"))?.to_tri_mesh(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::{Body, BodyFileSettings, Motion};
    use crate::folders::{load_garment_folder, load_motion_folder};
    use crate::format::MatFile;
    use crate::generate::mannequin;
    use crate::import::bvh;
    use std::error::Error;

    /// Whoever prints an error prints its sources below it: a text that has them already must not name them as such.
    #[test]
    fn no_error_names_its_cause_twice() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("missing.obj");
        let errors: [Box<dyn Error>; 7] = [
            load_mesh(&missing).unwrap_err().into(),
            Body::load(&missing, &BodyFileSettings::default()).unwrap_err().into(),
            Motion::load(&missing).unwrap_err().into(),
            bvh::load(&missing).unwrap_err().into(),
            MatFile::load(&missing).unwrap_err().into(),
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
