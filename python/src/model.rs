//! A trained model that drapes.

use crate::arrays::{frames, polygons, rows, to_value};
use crate::body::{Body, PoseInput};
use crate::call::{call, refused_text};
use crate::drape::Drape;
use clothcombo_data::asset::{KnownShape, Motion, Pose, Provenance};
use clothcombo_data::fit::FitSettings;
use clothcombo_data::fit::hints::GarmentHints;
use clothcombo_data::format::PolygonMesh;
use clothcombo_physics::contact::resolve::ResolveSettings;
use clothcombo_physics::mesh::MeshError;
use clothcombo_trainer::inference::{
    Bodies, Draper, DraperSettings, FrameRange, GarmentCatalog, GivenGarment, MOST_RADIUS,
    Outfit as PreparedOutfit, RefineSteps, log_repairs, warn_about_order,
};
use clothcombo_trainer::system::paths::user_cache;
use miette::{IntoDiagnostic, Report};
use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// A trained model with a body.
#[pyclass(frozen, module = "clothcombo._native")]
pub struct Model {
    draper: Draper,
    catalog: GarmentCatalog,
}

/// Frames of a motion file, or poses `[T, J, 3]` (radians) at a rate (1/s).
#[derive(FromPyObject)]
pub enum MotionInput<'py> {
    File(PathBuf),
    Poses(PyReadonlyArray3<'py, f64>, f64),
}

impl MotionInput<'_> {
    fn motion(&self) -> PyResult<Result<Motion, PathBuf>> {
        match self {
            Self::File(path) => Ok(Err(path.clone())),
            Self::Poses(poses, frame_rate) => {
                let poses = frames(poses)?.into_iter().map(|rotations| Pose { rotations }).collect();
                let name = "given motion".to_owned();
                Ok(Ok(Motion { name, frame_rate: *frame_rate, poses, source: Provenance::default() }))
            }
        }
    }
}

/// Garments of a model, ready to be draped on any body.
#[pyclass(frozen, module = "clothcombo._native")]
pub struct Outfit {
    draper: Draper,
    outfit: Arc<PreparedOutfit>,
}

/// A garment as given: a name, a mesh unless the name is that of a file or of a known garment, and hints as JSON.
pub type GarmentInput<'py> =
    (String, Option<(PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, u32>)>, String);

/// The same without Python.
pub struct WantedGarment {
    pub name: String,
    pub mesh: Option<Result<PolygonMesh, MeshError>>,
    pub entry: GarmentHints,
}

impl WantedGarment {
    pub fn new((name, mesh, hints): GarmentInput<'_>) -> PyResult<Self> {
        let mesh = mesh.map(|(positions, faces)| polygons(&positions, &faces)).transpose()?;
        let entry = to_value(&hints, &name)?;
        Ok(Self { name, mesh, entry })
    }

    /// What is read.
    pub fn file(&self) -> Option<PathBuf> {
        let path = PathBuf::from(&self.name);
        let is_path = self.name.contains('/') || path.extension().is_some();
        (self.mesh.is_none() && is_path).then_some(path)
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
            None => catalog.find(&self.name, draper.body(), fit, &hints)?,
            Some(mesh) => {
                let mesh = crate::arrays::named(&self.name, mesh)?;
                catalog.place(&self.name, mesh, draper.body(), fit, &hints)?
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
    settings.check().into_diagnostic().map_err(crate::call::refused)?;
    Ok(settings)
}

#[pymethods]
impl Model {
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
    fn body(&self) -> Body {
        Body { model: Arc::new(self.draper.body().clone()) }
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
    fn outfit(&self, py: Python<'_>, garments: Vec<GarmentInput<'_>>, fit: Option<bool>) -> PyResult<Outfit> {
        let wanted = garments.into_iter().map(WantedGarment::new).collect::<PyResult<Vec<_>>>()?;
        let files: Vec<PathBuf> = wanted.iter().filter_map(WantedGarment::file).collect();
        call(py, &files, || {
            let found = wanted.into_iter().map(|garment| garment.find(&self.catalog, &self.draper, fit));
            let sources = found.collect::<Result<Vec<_>, Report>>()?;
            PreparedOutfit::check(&sources)?;
            sources.iter().for_each(log_repairs);
            self.draper.log_materials(&sources);
            warn_about_order(&sources);
            let outfit = Arc::new(self.draper.outfit(sources)?);
            Ok::<_, Report>(Outfit { draper: self.draper.clone(), outfit })
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
impl Outfit {
    #[getter]
    fn names(&self) -> Vec<String> {
        self.outfit.names().map(str::to_owned).collect()
    }

    #[expect(clippy::too_many_arguments, reason = "the keyword arguments of the package's `Outfit.drape`")]
    fn drape(
        &self,
        py: Python<'_>,
        shape: Vec<f64>,
        pose: Option<PoseInput<'_>>,
        motion: Option<MotionInput<'_>>,
        frames: (usize, Option<usize>),
        every: usize,
        posed: Option<PyReadonlyArray2<'_, f64>>,
        t_pose: Option<PyReadonlyArray2<'_, f64>>,
        refine: Option<RefineInput>,
        resolve: bool,
        gap_mm: f64,
        time_limit: Option<f64>,
        smooth: Option<u16>,
    ) -> PyResult<Drape> {
        let refine = match refine {
            None => None,
            Some(RefineInput::Steps(steps)) => Some(RefineSteps::AtMost(steps)),
            Some(RefineInput::Text(text)) => {
                Some(text.parse().map_err(|what| refused_text(format!("refine is {text:?}; hint: {what}")))?)
            }
        };
        if let Some(radius) = smooth.filter(|radius| *radius > MOST_RADIUS) {
            return Err(refused_text(format!("smooth is {radius}; hint: at most {MOST_RADIUS} frames")));
        }
        let post_process = resolve_settings(gap_mm, time_limit)?;
        let settings = DraperSettings { refine, resolve, post_process, ..self.draper.settings().clone() };
        let pose = pose.map(|pose| pose.pose()).transpose()?;
        let motion = motion.map(|motion| motion.motion()).transpose()?;
        let posed = posed.as_ref().map(|p| rows(p).map(<[_]>::to_vec)).transpose()?;
        let t_pose = t_pose.as_ref().map(|p| rows(p).map(<[_]>::to_vec)).transpose()?;
        let range = FrameRange { first: frames.0, end: frames.1 };
        let files: Vec<PathBuf> = motion.iter().filter_map(|motion| motion.as_ref().err().cloned()).collect();
        call(py, &files, || {
            let draper = self.draper.with(&settings);
            let body = draper.body();
            let bodies = match (motion, posed) {
                (Some(motion), _) => {
                    let motion = match motion {
                        Ok(given) => {
                            given.check().map_err(|what| Report::msg(format!("the motion: {what}")))?;
                            given
                        }
                        Err(path) => Motion::load(&path).into_diagnostic()?,
                    };
                    Bodies::in_motion(body, &shape, &motion, &motion.name, range, every)?
                }
                (None, Some(surface)) => {
                    let known = match &t_pose {
                        Some(rest) => KnownShape::TPose(rest),
                        None => KnownShape::Parameters(&shape),
                    };
                    Bodies::of_surface(body, surface, known, "the posed body")?
                }
                (None, None) => {
                    let (pose, name) = pose.unwrap_or_else(|| (Pose::t_pose(0), "T-pose".to_owned()));
                    Bodies::in_pose(body, &shape, pose, &name)
                }
            };
            bodies.check(&draper)?;
            let outfit = self.outfit.clone();
            let (drapes, smoothing) = draper.drape_bodies(&outfit, &bodies, smooth, |_| ())?;
            Ok::<_, Report>(Drape { draper, outfit, drapes, bodies, smoothing })
        })
    }
}
