//! Between numpy's arrays and those of the library.

use crate::call::refused_text;
use clothcombo_data::format::PolygonMesh;
use clothcombo_physics::mesh::{MeshError, TriMesh};
use clothcombo_physics::transform::Transform;
use clothcombo_trainer::score::NamedMesh;
use miette::{IntoDiagnostic, Report};
use numpy::ndarray::{Array2, Array3};
use numpy::{Element, IntoPyArray, PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyAny;
use std::path::PathBuf;

/// The rows of a C-contiguous `[V, 3]` array, in place.
pub fn rows<'a, T: Element + Copy>(array: &'a PyReadonlyArray2<'_, T>) -> PyResult<&'a [[T; 3]]> {
    match (array.as_array().ncols(), array.as_slice()) {
        (3, Ok(values)) => Ok(values.as_chunks().0),
        _ => Err(refused_text("positions have the shape [V, 3], without gaps in memory")),
    }
}

/// A copy of a `[V, 3]` array.
pub struct CopiedRows(pub Vec<[f64; 3]>);

impl FromPyObject<'_, '_> for CopiedRows {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        Ok(Self(rows(&given.extract::<PyReadonlyArray2<'_, f64>>()?)?.to_vec()))
    }
}

/// A copy of a mesh file's path, or of positions `[V, 3]` and faces `[F, 3]` or `[F, 4]`.
pub enum MeshInput {
    /// A file.
    File(PathBuf),
    /// A mesh in memory.
    Polygons(Result<PolygonMesh, MeshError>),
}

impl FromPyObject<'_, '_> for MeshInput {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        if let Ok(path) = given.extract() {
            return Ok(Self::File(path));
        }
        let (CopiedRows(positions), faces): (_, PyReadonlyArray2<'_, u32>) = given.extract()?;
        let corners = faces.as_array().ncols();
        match (corners, faces.as_slice()) {
            (3 | 4, Ok(values)) => Ok(Self::Polygons(PolygonMesh::from_faces(positions, values, corners))),
            _ => Err(refused_text("faces have the shape [F, 3] or [F, 4]")),
        }
    }
}

impl MeshInput {
    /// What is read.
    pub fn file(&self) -> Option<PathBuf> {
        match self {
            Self::File(path) => Some(path.clone()),
            Self::Polygons(_) => None,
        }
    }

    /// As triangles; messages call a mesh in memory `name`.
    pub fn triangles(self, name: &str) -> Result<NamedMesh, Report> {
        match self {
            Self::File(path) => Ok(NamedMesh::load(&path)?),
            Self::Polygons(mesh) => {
                let path = PathBuf::from(name);
                let mesh = named(name, mesh)?.to_tri_mesh(&path).into_diagnostic()?;
                Ok(NamedMesh { path, mesh })
            }
        }
    }
}

/// Meshes as triangles; messages call those in memory `what` and their number.
pub fn triangles(what: &str, meshes: Vec<MeshInput>) -> Result<Vec<NamedMesh>, Report> {
    meshes.into_iter().enumerate().map(|(i, mesh)| mesh.triangles(&format!("{what} {i}"))).collect()
}

/// `result` with the name of the mesh in its error.
pub fn named<T>(name: &str, result: Result<T, MeshError>) -> Result<T, Report> {
    result.map_err(|error| Report::msg(format!("{name}: {error}")))
}

/// A mesh of the same faces at other positions.
pub fn moved(name: &str, mesh: &TriMesh, positions: Vec<[f64; 3]>) -> Result<TriMesh, Report> {
    named(name, mesh.with_positions(positions))
}

/// Rows as an array `[V, N]`.
pub fn array<T: Element, const N: usize>(py: Python<'_>, rows: Vec<[T; N]>) -> Bound<'_, PyArray2<T>> {
    let count = rows.len();
    let array = Array2::from_shape_vec((count, N), rows.into_flattened());
    array.expect("a vector of rows has as many entries as its shape says").into_pyarray(py)
}

/// Transforms as an array `[V, 12]`.
pub fn array_of_transforms<'py>(py: Python<'py>, transforms: &[Transform]) -> Bound<'py, PyArray2<f64>> {
    let values = transforms.as_flattened().as_flattened().to_vec();
    let array = Array2::from_shape_vec((transforms.len(), 12), values);
    array.expect("a transform has twelve entries").into_pyarray(py)
}

/// Positions and faces of a mesh, `[V, 3]` and `[F, 3]`.
pub fn arrays_of_mesh<'py>(py: Python<'py>, mesh: &TriMesh) -> ArraysOfMesh<'py> {
    (array(py, mesh.positions().to_vec()), array(py, mesh.faces().to_vec()))
}

/// Positions and faces.
pub type ArraysOfMesh<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>);

/// Frames of `[V, 3]` each as an array `[T, V, 3]`.
pub fn array_of_frames(py: Python<'_>, frames: Vec<Vec<[f64; 3]>>) -> Bound<'_, PyArray3<f64>> {
    let shape = (frames.len(), frames.first().map_or(0, Vec::len), 3);
    let array = Array3::from_shape_vec(shape, frames.concat().into_flattened());
    array.expect("all frames have the same vertices").into_pyarray(py)
}

/// A value as Python has what JSON holds.
pub fn from_json<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|error| refused_text(error.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// A value of the type that a JSON text describes, `what` in messages.
pub fn to_value<T: serde::de::DeserializeOwned>(text: &str, what: &str) -> PyResult<T> {
    serde_json::from_str(text).map_err(|error| refused_text(format!("{what}: {error}")))
}
