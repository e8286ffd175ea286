//! A parametric body.

use crate::arrays::{CopiedRows, array, array_of_transforms, from_json};
use crate::call::{call, refused, refused_text};
use clothcombo_data::asset::{Body, Pose};
use clothcombo_trainer::dataset::load_body;
use clothcombo_trainer::inference::read_pose;
use miette::IntoDiagnostic;
use numpy::PyArray2;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// A parametric body: shape and pose in, vertices out.
#[pyclass(frozen, name = "Body", module = "clothcombo._native")]
pub struct PyBody {
    pub model: Arc<Body>,
}

/// A pose by name or frame of a file, or its rotations `[J, 3]` (radians); and what a report calls it.
pub struct NamedPose {
    pub pose: Pose,
    pub name: String,
}

impl FromPyObject<'_, '_> for NamedPose {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        if let Ok(name) = given.extract::<String>() {
            return Ok(Self { pose: read_pose(&name).map_err(refused)?, name });
        }
        let CopiedRows(rotations) = given.extract()?;
        if rotations.as_flattened().iter().any(|x| !x.is_finite()) {
            return Err(refused_text("the pose holds a number that is not finite"));
        }
        Ok(Self { pose: Pose { rotations }, name: "given rotations".to_owned() })
    }
}

#[pymethods]
impl PyBody {
    /// "mannequin", or a body npz.
    #[staticmethod]
    fn load(py: Python<'_>, name: String) -> PyResult<Self> {
        let files: Vec<PathBuf> = if name == "mannequin" { vec![] } else { vec![name.clone().into()] };
        let model = call(py, &files, || load_body(&name, 0))?;
        Ok(Self { model: Arc::new(model) })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.model.name
    }

    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u32>> {
        array(py, self.model.faces.to_vec())
    }

    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.model.joint_names.clone()
    }

    #[getter]
    fn parents(&self) -> Vec<Option<usize>> {
        self.model.parents.clone()
    }

    #[getter]
    fn shape_count(&self) -> usize {
        self.model.shape_count
    }

    /// Vertices [V, 3], joints [J, 3] and bone transforms [J, 3, 4] of a shape and pose (m).
    fn posed<'py>(
        &self,
        py: Python<'py>,
        shape: Vec<f64>,
        pose: NamedPose,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
        if shape.iter().any(|x| !x.is_finite()) {
            return Err(refused_text("the shape holds a number that is not finite"));
        }
        let posed = call(py, &[], || self.model.posed(&shape, &pose.pose).into_diagnostic())?;
        let bones = array_of_transforms(py, &posed.bones);
        Ok((array(py, posed.positions), array(py, posed.joints), bones))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let name = from_json(py, &self.model.name)?.repr()?;
        Ok(format!(
            "Body({name}, {} vertices, {} joints)",
            self.model.vertex_count(),
            self.model.joint_count()
        ))
    }
}
