//! Between numpy's arrays and those of the library.

use crate::call::refused_text;
use clothcombo_data::format::PolygonMesh;
use clothcombo_physics::mesh::{MeshError, TriMesh};
use clothcombo_trainer::score::NamedMesh;
use miette::{IntoDiagnostic, Report};
use numpy::ndarray::{Array2, Array3};
use numpy::{Element, IntoPyArray, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyAny;
use std::path::PathBuf;

/// A mesh file, or positions `[V, 3]` and faces `[F, 3]` or `[F, 4]`.
#[derive(FromPyObject)]
pub enum MeshInput<'py> {
    /// A file.
    File(PathBuf),
    /// A mesh in memory.
    Arrays(PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, u32>),
}

/// The rows of a C-contiguous `[V, 3]` array, in place.
pub fn rows<'a, T: Element + Copy>(array: &'a PyReadonlyArray2<'_, T>) -> PyResult<&'a [[T; 3]]> {
    match (array.as_array().ncols(), array.as_slice()) {
        (3, Ok(values)) => Ok(values.as_chunks().0),
        _ => Err(refused_text("positions have the shape [V, 3], without gaps in memory")),
    }
}

/// The frames of a C-contiguous `[T, J, 3]` array.
pub fn frames(array: &PyReadonlyArray3<'_, f64>) -> PyResult<Vec<Vec<[f64; 3]>>> {
    match (array.as_array().dim(), array.as_slice()) {
        ((_, joints, 3), Ok(values)) if joints > 0 => {
            Ok(values.as_chunks().0.chunks_exact(joints).map(<[_]>::to_vec).collect())
        }
        _ => Err(refused_text("the poses of a motion have the shape [T, J, 3]")),
    }
}

/// The mesh of two arrays.
pub fn polygons(
    positions: &PyReadonlyArray2<'_, f64>,
    faces: &PyReadonlyArray2<'_, u32>,
) -> PyResult<Result<PolygonMesh, MeshError>> {
    let corners = faces.as_array().ncols();
    match (corners, faces.as_slice()) {
        (3 | 4, Ok(values)) => Ok(PolygonMesh::from_faces(rows(positions)?.to_vec(), values, corners)),
        _ => Err(refused_text("faces have the shape [F, 3] or [F, 4]")),
    }
}

impl MeshInput<'_> {
    /// What is read.
    pub fn file(&self) -> Option<PathBuf> {
        match self {
            Self::File(path) => Some(path.clone()),
            Self::Arrays(..) => None,
        }
    }

    /// A copy that does not belong to Python; messages call a mesh in memory `name`.
    pub fn taken(&self, name: &str) -> PyResult<TakenMesh> {
        Ok(match self {
            Self::File(path) => TakenMesh::File(path.clone()),
            Self::Arrays(positions, faces) => TakenMesh::Polygons(name.into(), polygons(positions, faces)?),
        })
    }
}

/// A mesh that does not belong to Python.
pub enum TakenMesh {
    /// A file.
    File(PathBuf),
    /// A mesh of that name.
    Polygons(PathBuf, Result<PolygonMesh, MeshError>),
}

impl TakenMesh {
    /// As triangles.
    pub fn triangles(self) -> Result<NamedMesh, Report> {
        match self {
            Self::File(path) => Ok(NamedMesh::load(&path)?),
            Self::Polygons(path, mesh) => {
                let mesh = named(&path.display().to_string(), mesh)?.to_tri_mesh(&path).into_diagnostic()?;
                Ok(NamedMesh { path, mesh })
            }
        }
    }
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
