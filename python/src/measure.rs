//! Meshes fitted, checked, scored, counted and resolved, from files or arrays.

use crate::arrays::{MeshInput, array, arrays_of_mesh, from_json, named, triangles};
use crate::body::PyBody;
use crate::call::call;
use crate::model::{GarmentInput, GarmentRequest, resolve_settings};
use clothcombo_data::check::{Checker, FileCheck, find_targets, only_body};
use clothcombo_data::fit;
use clothcombo_data::format::load_mesh;
use clothcombo_physics::Surface;
use clothcombo_physics::contact::resolve::{
    Layer, ResolveError, ResolveSettings, RestGarment, certify, resolve as resolve_layers,
};
use clothcombo_physics::mesh::TriMesh;
use clothcombo_trainer::dataset::load_body;
use clothcombo_trainer::score::{SceneMeshes, ScoreDistance, checked_body, checked_garment, score_meshes};
use miette::{IntoDiagnostic, Report};
use numpy::PyArray2;
use pyo3::prelude::*;
use rayon::prelude::*;
use std::path::PathBuf;

/// Positions [V, 3], faces [F, 3] and the report of a garment at rest on the zero body.
#[pyfunction]
#[pyo3(name = "fit")]
pub fn fit_garment<'py>(
    py: Python<'py>,
    garment: GarmentInput,
    body: &PyBody,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>, Bound<'py, PyAny>)> {
    let garment = GarmentRequest::new(garment)?;
    let files: Vec<PathBuf> = garment.file().into_iter().collect();
    let fitted = call(py, &files, || {
        let (name, hints) = (garment.name.clone(), garment.hints()?);
        let mesh = match garment.mesh {
            MeshInput::File(path) => load_mesh(&path).into_diagnostic()?,
            MeshInput::Polygons(mesh) => named(&name, mesh)?,
        };
        let body = &body.model;
        let named = |error: fit::FitError| Report::msg(format!("{name} on body '{}': {error}", body.name));
        fit::fit(&mesh, body, &hints).map_err(named)
    })?;
    let (positions, faces) = arrays_of_mesh(py, &fitted.garment.rest);
    Ok((positions, faces, from_json(py, &fitted.report)?))
}

/// What `clothcombo check --json` prints of every file.
#[pyfunction]
pub fn check(py: Python<'_>, paths: Vec<PathBuf>, body: Option<String>) -> PyResult<Bound<'_, PyAny>> {
    let files: Vec<PathBuf> = body.iter().filter(|name| *name != "mannequin").map(PathBuf::from).collect();
    let checked = call(py, &files, || {
        let targets = find_targets(&paths);
        let only = || only_body(&targets).map_or("mannequin".to_owned(), |path| path.display().to_string());
        let checker = Checker::new(load_body(&body.unwrap_or_else(only), 0)?);
        Ok::<Vec<FileCheck>, Report>(targets.par_iter().map(|target| checker.check(target)).collect())
    })?;
    from_json(py, &checked)
}

fn files<'a>(meshes: impl IntoIterator<Item = &'a MeshInput>) -> Vec<PathBuf> {
    meshes.into_iter().filter_map(MeshInput::file).collect()
}

/// The score of draped meshes, as `clothcombo score --json` prints it.
#[pyfunction]
pub fn score<'py>(
    py: Python<'py>,
    body: MeshInput,
    rest: Vec<MeshInput>,
    draped: Vec<MeshInput>,
    canonical: Vec<MeshInput>,
    surface: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let files = files([&body].into_iter().chain(&rest).chain(&draped).chain(&canonical));
    let distance = if surface { ScoreDistance::Surface } else { ScoreDistance::NearestVertex };
    let score = call(py, &files, || {
        let meshes = SceneMeshes {
            body: body.triangles("body")?,
            rest: triangles("rest", rest)?,
            draped: triangles("garment", draped)?,
            canonical: triangles("canonical", canonical)?,
        };
        score_meshes(meshes, distance)
    })?;
    from_json(py, &score)
}

/// A posed body and garments on it, innermost first, each with its rest mesh.
struct Layers {
    surface: Surface<f64>,
    names: Vec<String>,
    rest: Vec<RestGarment>,
    draped: Vec<TriMesh>,
}

impl Layers {
    /// Without rest meshes, garments are at rest as they are.
    fn new(body: MeshInput, garments: Vec<MeshInput>, rest: Vec<MeshInput>) -> Result<Self, Report> {
        let body = checked_body(body.triangles("body")?)?;
        let draped = triangles("garment", garments)?;
        let rest = if rest.is_empty() { draped.clone() } else { triangles("rest", rest)? };
        if rest.len() != draped.len() {
            let (rest, draped) = (rest.len(), draped.len());
            return Err(Report::msg(format!("{rest} rest meshes but {draped} garments")));
        }
        let pairs = rest.iter().zip(&draped);
        let names = pairs.map(|(rest, draped)| checked_garment(rest, draped, &body));
        let names = names.collect::<Result<_, _>>()?;
        let rest = rest.iter().map(|rest| RestGarment::new(&rest.mesh)).collect();
        let draped = draped.into_iter().map(|draped| draped.mesh).collect();
        Ok(Self { surface: Surface::from_mesh(&body), names, rest, draped })
    }

    fn layers(&self) -> Vec<Layer<'_>> {
        let pairs = self.rest.iter().zip(&self.draped);
        pairs.map(|(garment, draped)| Layer { garment, positions: draped.positions() }).collect()
    }

    fn named(&self, error: ResolveError) -> Report {
        let name = error.garment().and_then(|garment| self.names.get(garment).cloned());
        match name {
            Some(name) => Report::msg(format!("{name}: {error}")),
            None => Report::msg(error.to_string()),
        }
    }
}

/// Exact counts of what intersects what.
#[pyfunction]
pub fn certificate<'py>(
    py: Python<'py>,
    body: MeshInput,
    garments: Vec<MeshInput>,
    rest: Vec<MeshInput>,
) -> PyResult<Bound<'py, PyAny>> {
    let files = files([&body].into_iter().chain(&garments).chain(&rest));
    let found = call(py, &files, || {
        let scene = Layers::new(body, garments, rest)?;
        certify(&scene.surface, &scene.layers()).map_err(|error| scene.named(error))
    })?;
    from_json(py, &found)
}

/// Positions of every garment after the post-process, and its certificate.
#[pyfunction]
pub fn resolve<'py>(
    py: Python<'py>,
    body: MeshInput,
    garments: Vec<MeshInput>,
    rest: Vec<MeshInput>,
    gap_mm: f64,
    time_limit: Option<f64>,
    keep_self: bool,
) -> PyResult<(Vec<Bound<'py, PyArray2<f64>>>, Bound<'py, PyAny>)> {
    let files = files([&body].into_iter().chain(&garments).chain(&rest));
    let settings = ResolveSettings { self_contact: !keep_self, ..resolve_settings(gap_mm, time_limit)? };
    let resolved = call(py, &files, || {
        let scene = Layers::new(body, garments, rest)?;
        resolve_layers(&scene.surface, &scene.layers(), &settings).map_err(|error| scene.named(error))
    })?;
    let certificate = from_json(py, &resolved.certificate)?;
    Ok((resolved.positions.into_iter().map(|positions| array(py, positions)).collect(), certificate))
}
