//! A parametric body.

use crate::arrays::{array, from_json, rows};
use crate::call::{call, refused_text};
use clothcombo_data::asset::{Body as BodyModel, Pose};
use clothcombo_trainer::dataset::load_body;
use clothcombo_trainer::inference::read_pose;
use miette::IntoDiagnostic;
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// A parametric body: shape and pose in, vertices out.
#[pyclass(frozen, module = "clothcombo._native")]
pub struct Body {
    pub model: Arc<BodyModel>,
}

/// A pose by name or frame of a file, or its rotations `[J, 3]`.
#[derive(FromPyObject)]
pub enum PoseInput<'py> {
    /// A name, FILE.npz or FILE.npz:FRAME.
    Named(String),
    /// Rotation vectors (radians).
    Rotations(PyReadonlyArray2<'py, f64>),
}

impl PoseInput<'_> {
    /// The pose, and what a report calls it.
    pub fn pose(&self) -> PyResult<(Pose, String)> {
        Ok(match self {
            Self::Named(text) => (read_pose(text).map_err(crate::call::refused)?, text.clone()),
            Self::Rotations(rotations) => {
                let rotations = rows(rotations)?.to_vec();
                if rotations.as_flattened().iter().any(|x| !x.is_finite()) {
                    return Err(refused_text("the pose holds a number that is not finite"));
                }
                (Pose { rotations }, "given rotations".to_owned())
            }
        })
    }
}

#[pymethods]
impl Body {
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
        pose: PoseInput<'_>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
        if shape.iter().any(|x| !x.is_finite()) {
            return Err(refused_text("the shape holds a number that is not finite"));
        }
        let (pose, _) = pose.pose()?;
        let posed = call(py, &[], || self.model.posed(&shape, &pose).into_diagnostic())?;
        let bones: Vec<[f64; 12]> =
            posed.bones.iter().map(|bone| std::array::from_fn(|i| bone[i / 4][i % 4])).collect();
        Ok((array(py, posed.positions), array(py, posed.joints), array(py, bones)))
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
