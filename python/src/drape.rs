//! What a drape made.

use crate::arrays::{ArraysOfMesh, array, array_of_frames, array_of_transforms, arrays_of_mesh, from_json};
use crate::call::{call, refused_text};
use clothcombo_physics::contact::resolve::Certificate;
use clothcombo_trainer::inference::output::{Show, Staged, write};
use clothcombo_trainer::inference::{
    Bodies, Drape, DrapeReport, Draper, GarmentDrape, Outfit, OutfitGarment, Smoothing,
};
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// An outfit on one body, or on the frames of a motion.
#[pyclass(frozen, name = "Drape", module = "clothcombo._native")]
pub struct PyDrape {
    pub draper: Draper,
    pub outfit: Arc<Outfit>,
    pub drapes: Vec<Drape>,
    pub bodies: Bodies,
    pub smoothing: Option<Smoothing>,
}

impl PyDrape {
    fn garment(&self, index: usize) -> PyResult<&OutfitGarment> {
        let none = || refused_text(format!("no garment {index} of {}", self.outfit.garments.len()));
        self.outfit.garments.get(index).ok_or_else(none)
    }

    /// Positions of a garment in every frame.
    fn frames(&self, index: usize, positions: impl Fn(&GarmentDrape) -> Vec<[f64; 3]>) -> Vec<Vec<[f64; 3]>> {
        self.drapes.iter().map(|drape| positions(&drape.garments[index])).collect()
    }
}

#[pymethods]
impl PyDrape {
    #[getter]
    fn names(&self) -> Vec<String> {
        self.outfit.names().map(str::to_owned).collect()
    }

    #[getter]
    fn is_motion(&self) -> bool {
        !self.bodies.moments.is_empty()
    }

    /// Times of the frames (s).
    #[getter]
    fn seconds(&self) -> Vec<f64> {
        self.bodies.moments.iter().map(|moment| moment.seconds).collect()
    }

    /// The body in every frame [T, B, 3] (m).
    fn body<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        array_of_frames(py, self.drapes.iter().map(|drape| drape.body.clone()).collect())
    }

    fn body_faces<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u32>> {
        array(py, self.draper.body().faces.to_vec())
    }

    /// The vertices of a garment as it was given [T, V, 3] (m).
    fn given<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let source = &self.garment(index)?.source;
        Ok(array_of_frames(py, self.frames(index, |garment| source.in_given_order(&garment.positions))))
    }

    /// Its faces, polygons cut into fans [F, 3].
    fn given_faces<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let polygons = self.garment(index)?.source.given.polygons();
        let fans = polygons.flat_map(|corners| corners[1..].windows(2).map(|e| [corners[0], e[0], e[1]]));
        Ok(array(py, fans.collect()))
    }

    /// The mesh that was draped: rest [V, 3] and faces [F, 3].
    fn mesh<'py>(&self, py: Python<'py>, index: usize) -> PyResult<ArraysOfMesh<'py>> {
        Ok(arrays_of_mesh(py, &self.garment(index)?.prepared.garment.rest))
    }

    /// Where the vertices of that mesh are at one stage [T, V, 3] (m).
    fn stage<'py>(&self, py: Python<'py>, index: usize, stage: &str) -> PyResult<Bound<'py, PyArray3<f64>>> {
        self.garment(index)?;
        let frames = self.frames(index, |garment| match stage {
            "skinned" => garment.skinned.clone(),
            "network" => garment.network.clone(),
            _ => garment.positions.clone(),
        });
        Ok(array_of_frames(py, frames))
    }

    /// Skinning of every vertex of that mesh, canonical → posed, in the first frame [V, 12].
    fn transforms<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.garment(index)?;
        Ok(array_of_transforms(py, &self.drapes[0].garments[index].transforms))
    }

    /// Whether a garment is held, and its category.
    fn kind(&self, index: usize) -> PyResult<(bool, &'static str)> {
        let garment = &self.garment(index)?.prepared.garment;
        Ok((garment.holding, garment.category.name()))
    }

    fn certificate<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        from_json(py, &Certificate::of_frames(self.drapes.iter().map(|drape| &drape.certificate)))
    }

    /// The score of a frame.
    fn score<'py>(&self, py: Python<'py>, frame: usize) -> PyResult<Bound<'py, PyAny>> {
        let none = || refused_text(format!("no frame {frame} of {}", self.drapes.len()));
        let drape = self.drapes.get(frame).ok_or_else(none)?;
        let score = call(py, &[], || drape.score(&self.draper, &self.outfit, |garment| &garment.positions))?;
        from_json(py, &score)
    }

    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let Self { draper, outfit, drapes, bodies, smoothing } = self;
        let report = call(py, &[], || DrapeReport::new(draper, outfit, drapes, bodies, smoothing.clone()))?;
        from_json(py, &report)
    }

    /// Writes what `clothcombo drape` writes.
    fn save(&self, py: Python<'_>, folder: PathBuf, replace: bool, all_frames: bool) -> PyResult<()> {
        let Self { draper, outfit, drapes, bodies, smoothing } = self;
        call(py, &[], || {
            let read = outfit.garments.iter().filter_map(|garment| garment.source.path.clone());
            let read: Vec<PathBuf> = read.chain([draper.trained().folder.clone()]).collect();
            let staged = Staged::new(&folder, replace, &read)?;
            let title = outfit.names().collect::<Vec<_>>().join(", ");
            let smoothing = smoothing.as_ref();
            let show = Show { draper, outfit, bodies, drapes, smoothing, title: &title, all_frames };
            write(staged.folder(), &show)?;
            staged.commit()
        })
    }
}
