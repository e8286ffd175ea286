//! A trained model that drapes.

use crate::arrays::{CopiedRows, MeshInput, named, to_value};
use crate::body::{NamedPose, PyBody};
use crate::call::{call, refused, refused_text};
use crate::drape::PyDrape;
use clothcombo_data::asset::{KnownShape, Motion, Pose, Provenance};
use clothcombo_data::fit::FitSettings;
use clothcombo_data::fit::hints::GarmentHints;
use clothcombo_physics::contact::resolve::ResolveSettings;
use clothcombo_trainer::inference::{
    Bodies, Draper, DraperSettings, FrameRange, GarmentCatalog, GivenGarment, MOST_RADIUS, Outfit,
    RefineSteps,
};
use clothcombo_trainer::system::paths::user_cache;
use miette::{IntoDiagnostic, Report};
use numpy::PyReadonlyArray3;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// A trained model with a body.
#[pyclass(frozen, name = "Model", module = "clothcombo._native")]
pub struct PyModel {
    draper: Draper,
    catalog: GarmentCatalog,
}

/// Frames of a motion file, or poses `[T, J, 3]` (radians) at a rate (1/s).
pub enum MotionInput {
    File(PathBuf),
    Poses(Motion),
}

impl FromPyObject<'_, '_> for MotionInput {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        if let Ok(path) = given.extract() {
            return Ok(Self::File(path));
        }
        let (poses, frame_rate): (PyReadonlyArray3<'_, f64>, f64) = given.extract()?;
        let poses = match (poses.as_array().dim(), poses.as_slice()) {
            ((_, joints, 3), Ok(values)) if joints > 0 => {
                let frames = values.as_chunks().0.chunks_exact(joints);
                frames.map(|rotations| Pose { rotations: rotations.to_vec() }).collect()
            }
            _ => return Err(refused_text("the poses of a motion have the shape [T, J, 3]")),
        };
        let name = "given motion".to_owned();
        Ok(Self::Poses(Motion { name, frame_rate, poses, source: Provenance::default() }))
    }
}

impl MotionInput {
    fn file(&self) -> Option<PathBuf> {
        match self {
            Self::File(path) => Some(path.clone()),
            Self::Poses(_) => None,
        }
    }

    fn checked(self) -> Result<Motion, Report> {
        match self {
            Self::File(path) => Motion::load(&path).into_diagnostic(),
            Self::Poses(given) => {
                given.check().map_err(|what| Report::msg(format!("the motion: {what}")))?;
                Ok(given)
            }
        }
    }
}

/// Garments of a model, ready to be draped on any body.
#[pyclass(frozen, name = "Outfit", module = "clothcombo._native")]
pub struct PyOutfit {
    draper: Draper,
    outfit: Arc<Outfit>,
}

/// A garment as given: a name; a mesh, or a file or known garment; and hints as JSON.
pub type GarmentInput = (String, MeshInput, String);

/// The same with its hints read.
pub struct GarmentRequest {
    pub name: String,
    pub mesh: MeshInput,
    pub entry: GarmentHints,
}

impl GarmentRequest {
    pub fn new((name, mesh, hints): GarmentInput) -> PyResult<Self> {
        Ok(Self { entry: to_value(&hints, &name)?, name, mesh })
    }

    /// What is read.
    pub fn file(&self) -> Option<PathBuf> {
        self.mesh.file().filter(|path| self.name.contains('/') || path.extension().is_some())
    }

    pub fn hints(&self) -> Result<FitSettings, Report> {
        let hints = self.entry.settings(&FitSettings::default(), str::to_owned);
        hints.map_err(|what| Report::msg(format!("{}: {what}", self.name)))
    }

    fn find(
        self,
        catalog: &GarmentCatalog,
        draper: &Draper,
        fit: Option<bool>,
    ) -> Result<GivenGarment, Report> {
        let hints = self.hints()?;
        let material = self.entry.material;
        material.check().map_err(|what| Report::msg(format!("{}: {what}", self.name)))?;
        let mut source = match self.mesh {
            MeshInput::File(_) => catalog.find(&self.name, draper.body(), fit, &hints)?,
            MeshInput::Polygons(mesh) => {
                catalog.place(&self.name, named(&self.name, mesh)?, draper.body(), fit, &hints)?
            }
        };
        source.add_material(material);
        Ok(source)
    }
}

/// A number of steps, or "auto".
#[derive(FromPyObject)]
pub enum RefineInput {
    Steps(usize),
    Text(String),
}

/// What the post-process is to do.
pub fn resolve_settings(gap_mm: f64, time_limit: Option<f64>) -> PyResult<ResolveSettings> {
    let wrong = |_| refused_text(format!("time_limit is {time_limit:?}; hint: seconds above 0, or None"));
    let time = time_limit.map(Duration::try_from_secs_f64).transpose().map_err(wrong)?;
    let settings = ResolveSettings { gap: 1e-3 * gap_mm, time, ..ResolveSettings::default() };
    settings.check().into_diagnostic().map_err(refused)?;
    Ok(settings)
}

#[pymethods]
impl PyModel {
    #[staticmethod]
    fn load(
        py: Python<'_>,
        path: Option<PathBuf>,
        body: Option<String>,
        cache: Option<PathBuf>,
        no_cache: bool,
        folders: Vec<PathBuf>,
    ) -> PyResult<Self> {
        let mut files: Vec<PathBuf> = path.iter().cloned().collect();
        files.extend(body.clone().filter(|name| name != "mannequin").map(PathBuf::from));
        files.extend(folders.clone());
        let cache = if no_cache { None } else { cache.or_else(user_cache) };
        call(py, &files, || {
            let settings = DraperSettings { body, cache, ..DraperSettings::default() };
            let draper = Draper::load(path.as_deref(), &settings)?;
            let catalog = draper.catalog(&folders)?;
            Ok::<_, Report>(Self { draper, catalog })
        })
    }

    #[getter]
    fn body(&self) -> PyBody {
        PyBody { model: Arc::new(self.draper.body().clone()) }
    }

    #[getter]
    fn garments(&self) -> Vec<String> {
        self.catalog.names().to_vec()
    }

    #[getter]
    fn folder(&self) -> PathBuf {
        self.draper.trained().folder.clone()
    }

    /// Reads, places and embeds garments, innermost first.
    fn outfit(&self, py: Python<'_>, garments: Vec<GarmentInput>, fit: Option<bool>) -> PyResult<PyOutfit> {
        let wanted = garments.into_iter().map(GarmentRequest::new).collect::<PyResult<Vec<_>>>()?;
        let files: Vec<PathBuf> = wanted.iter().filter_map(GarmentRequest::file).collect();
        call(py, &files, || {
            let found = wanted.into_iter().map(|garment| garment.find(&self.catalog, &self.draper, fit));
            let sources = found.collect::<Result<Vec<_>, Report>>()?;
            self.draper.check_garments(&sources)?;
            let outfit = Arc::new(self.draper.outfit(sources)?);
            Ok::<_, Report>(PyOutfit { draper: self.draper.clone(), outfit })
        })
    }

    fn __repr__(&self) -> String {
        let trained = self.draper.trained();
        format!(
            "Model({:?}, step {}, body {:?})",
            trained.folder,
            trained.state.step,
            self.draper.body().name
        )
    }
}

#[pymethods]
impl PyOutfit {
    #[getter]
    fn names(&self) -> Vec<String> {
        self.outfit.names().map(str::to_owned).collect()
    }

    #[expect(clippy::too_many_arguments, reason = "the keyword arguments of the package's `Outfit.drape`")]
    fn drape(
        &self,
        py: Python<'_>,
        shape: Vec<f64>,
        pose: Option<NamedPose>,
        motion: Option<MotionInput>,
        frames: (usize, Option<usize>),
        every: usize,
        posed: Option<CopiedRows>,
        t_pose: Option<CopiedRows>,
        refine: Option<RefineInput>,
        resolve: bool,
        gap_mm: f64,
        time_limit: Option<f64>,
        smooth: Option<u16>,
    ) -> PyResult<PyDrape> {
        let refine = match refine {
            None => None,
            Some(RefineInput::Steps(steps)) => {
                let wrong = |what| refused_text(format!("refine is {steps}; hint: {what}"));
                Some(RefineSteps::at_most(steps).map_err(wrong)?)
            }
            Some(RefineInput::Text(text)) => {
                Some(text.parse().map_err(|what| refused_text(format!("refine is {text:?}; hint: {what}")))?)
            }
        };
        if let Some(radius) = smooth.filter(|radius| *radius > MOST_RADIUS) {
            return Err(refused_text(format!("smooth is {radius}; hint: at most {MOST_RADIUS} frames")));
        }
        let post_process = resolve_settings(gap_mm, time_limit)?;
        let settings = DraperSettings { refine, resolve, post_process, ..self.draper.settings().clone() };
        let range = FrameRange { first: frames.0, end: frames.1 };
        let files: Vec<PathBuf> = motion.iter().filter_map(MotionInput::file).collect();
        call(py, &files, || {
            let draper = self.draper.with(&settings);
            let body = draper.body();
            let bodies = match (motion, posed) {
                (Some(motion), _) => {
                    let motion = motion.checked()?;
                    Bodies::in_motion(body, &shape, &motion, &motion.name, range, every)?
                }
                (None, Some(CopiedRows(surface))) => {
                    let known = match &t_pose {
                        Some(CopiedRows(rest)) => KnownShape::TPose(rest),
                        None => KnownShape::Parameters(&shape),
                    };
                    Bodies::of_surface(body, surface, known, "the posed body")?
                }
                (None, None) => {
                    let t_pose = || NamedPose { pose: Pose::t_pose(0), name: "T-pose".to_owned() };
                    let NamedPose { pose, name } = pose.unwrap_or_else(t_pose);
                    Bodies::in_pose(body, &shape, pose, &name)
                }
            };
            draper.check_bodies(&bodies)?;
            let outfit = self.outfit.clone();
            let (drapes, smoothing) = draper.drape_bodies(&outfit, &bodies, smooth, |_| ())?;
            Ok::<_, Report>(PyDrape { draper, outfit, drapes, bodies, smoothing })
        })
    }
}
