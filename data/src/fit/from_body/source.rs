//! Which body a garment was made on.

use super::binding::one_shape_body;
use crate::asset::{Body, BodyFileSettings};
use crate::format::{FileError, is_mesh_path, load_mesh};
use crate::mesh::{WELD_SHARE, diagonal, triangulate, weld};
use clothcombo_physics::TriMesh;
use clothcombo_physics::mesh::is_inside_out;
use std::fmt;
use std::path::{Path, PathBuf};

/// A shape parameter beyond this is a slip of the pen: 99.99 % of people lie within 4.
const LARGEST_PARAMETER: f64 = 10.0;
/// Fewest vertices, and faces, that a mesh of a person has.
const FEWEST_VERTICES: usize = 200;
/// Most of them.
const MOST_VERTICES: usize = 2_000_000;

/// The body that a garment was made on: a body npz with a shape, or a mesh.
#[derive(Clone)]
pub struct SourceBody {
    pub(super) name: String,
    path: PathBuf,
    pub(super) kind: SourceKind,
}

#[derive(Clone)]
pub(super) enum SourceKind {
    Model(Box<SourceModel>),
    Mesh(Box<SourceMesh>),
}

/// A body model in T-pose, its pelvis at the origin.
#[derive(Clone)]
pub(super) struct SourceModel {
    pub shape: Vec<f64>,
    /// Of this shape alone.
    pub body: Body,
    /// Where the pelvis of this shape is in the coordinates of the file, or of the file that was imported (m).
    pub pelvis: [f64; 3],
}

/// A mesh in the unit and axes of its file.
#[derive(Clone)]
pub(super) struct SourceMesh {
    /// Vertices as the file has them.
    pub vertices: Vec<[f64; 3]>,
    /// The surface, welded, its faces outwards.
    pub surface: TriMesh,
}

impl PartialEq for SourceBody {
    /// Of the same file and shape.
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl fmt::Debug for SourceBody {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SourceBody({})", self.name)
    }
}

impl SourceBody {
    /// Reads `MESH`, `BODY.npz` or `BODY.npz:SHAPE`, the shape as numbers with commas between them. A path may hold
    /// colons itself: what exists as a file is one.
    ///
    /// # Errors
    /// [`FileError`] naming the file, and what is wrong with it or with the numbers.
    pub fn load(text: &str) -> Result<Self, FileError> {
        let (path, numbers) = file_and_shape(text);
        let path = Path::new(path);
        let wrong = FileError::content::<String>(path);
        let is_npz = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npz"));
        if !is_npz && numbers.is_some() {
            return Err(wrong(
                "shape parameters after a colon go with a body npz; a mesh has its own shape".into(),
            ));
        }
        if !is_npz && !is_mesh_path(path) {
            return Err(wrong(
                "a source body is a body .npz or a mesh (.obj, .ply, .stl, .gltf, .glb)".into(),
            ));
        }
        let kind = match is_npz {
            true => SourceKind::Model(Box::new(SourceModel::load(path, numbers)?)),
            false => SourceKind::Mesh(Box::new(SourceMesh::load(path)?)),
        };
        Ok(Self { name: text.to_owned(), path: path.into(), kind })
    }

    /// The file that was read.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// The file of `FILE` or `FILE:SHAPE`, and the shape.
pub(super) fn file_and_shape(text: &str) -> (&str, Option<&str>) {
    match text.rsplit_once(':') {
        Some((path, shape))
            if !Path::new(text).exists()
                && (Path::new(path).is_file() || path.to_lowercase().ends_with(".npz")) =>
        {
            (path, Some(shape))
        }
        _ => (text, None),
    }
}

fn shape_parameters(text: &str) -> Result<Vec<f64>, String> {
    let number = |part: &str| {
        let part = part.trim();
        let value = part.parse::<f64>().map_err(|_| {
            format!("the shape '{text}' holds '{part}', which is no number; it reads like body.npz:1.2,-0.5")
        })?;
        match value.abs() <= LARGEST_PARAMETER {
            true => Ok(value),
            false => Err(format!(
                "the shape '{text}' holds {part}; shape parameters lie between -{LARGEST_PARAMETER} and {LARGEST_PARAMETER}"
            )),
        }
    };
    text.split(',').map(number).collect()
}

impl SourceModel {
    fn load(path: &Path, numbers: Option<&str>) -> Result<Self, FileError> {
        let wrong = FileError::content::<String>(path);
        let shape = numbers.map(shape_parameters).transpose().map_err(&wrong)?.unwrap_or_default();
        // As many components as the shape asks for, so that too many are refused by their own count.
        let body = Body::load(path, &BodyFileSettings { shape_components: usize::MAX })?;
        let shaped = body.shaped(&shape).map_err(|e| wrong(e.to_string()))?;
        let pelvis = body.file_pelvis(&shape);
        let body = one_shape_body(&body, shaped.positions, shaped.joints, None).map_err(wrong)?;
        Ok(Self { shape, body, pelvis })
    }
}

impl SourceMesh {
    fn load(path: &Path) -> Result<Self, FileError> {
        let wrong = FileError::content::<String>(path);
        let mesh = load_mesh(path)?;
        let (count, size) = (mesh.positions.len(), diagonal(&mesh.positions));
        let is_plausible =
            (FEWEST_VERTICES..=MOST_VERTICES).contains(&count) && size > 0.0 && size.is_finite();
        if !is_plausible {
            return Err(wrong(format!(
                "it has {count} vertices and a diagonal of {size}; a mesh of a person has {FEWEST_VERTICES} to {MOST_VERTICES} vertices"
            )));
        }
        let welded = weld(&mesh.positions, WELD_SHARE * size);
        let cut = triangulate(&mesh.positions, mesh.polygons());
        let faces = cut.faces.iter().map(|f| f.map(|v| welded.number[v as usize]));
        let faces: Vec<[u32; 3]> = faces.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        if faces.len() < FEWEST_VERTICES {
            return Err(wrong(format!(
                "it has {} faces, too few for a body; export it as a surface",
                faces.len()
            )));
        }
        let surface = TriMesh::new(welded.positions, faces).map_err(|e| wrong(e.to_string()))?;
        let surface = if is_inside_out(&surface) { surface.turned() } else { surface };
        Ok(Self { vertices: mesh.positions, surface })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_with_a_colon_is_still_a_path() {
        let folder = tempfile::tempdir().unwrap();
        let odd = folder.path().join("a:1,2").display().to_string();
        std::fs::write(&odd, "x").unwrap();
        assert_eq!(file_and_shape(&odd), (odd.as_str(), None));
        let shaped = format!("{odd}:0.5");
        assert_eq!(file_and_shape(&shaped), (odd.as_str(), Some("0.5")));
        assert_eq!(file_and_shape("missing.npz:1,2"), ("missing.npz", Some("1,2")));
        assert_eq!(file_and_shape("C:\\missing.obj"), ("C:\\missing.obj", None));
    }

    #[test]
    fn shapes_are_numbers_of_a_plausible_size() {
        assert_eq!(shape_parameters("1.2, -0.5"), Ok(vec![1.2, -0.5]));
        for (text, part) in
            [("", "no number"), ("1,x", "'x'"), ("nan", "between"), ("70", "between"), ("1,", "no number")]
        {
            let message = shape_parameters(text).unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }
}
