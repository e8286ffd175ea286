//! The eight energies of garments on a posed body, with their gradients.

use crate::arrays::{CopiedRows, MeshInput, array, from_json, moved, rows, to_value, triangles};
use crate::call::{call, refused, refused_text};
use clothcombo_data::asset::GarmentMaterial;
use clothcombo_physics::contact::resolve::FARTHEST_POSITION;
use clothcombo_physics::energy::{
    EnergyError, EnergySettings, GarmentEnergies, SceneEnergy, SceneGarment, SceneLayers, SceneValue, Term,
    TermMap,
};
use clothcombo_physics::mesh::{Topology, TriMesh};
use clothcombo_physics::query::Surface;
use clothcombo_physics::real::Real;
use clothcombo_physics::transform::Transform;
use clothcombo_physics::vec3::from_f64;
use clothcombo_trainer::config::LossesConfig;
use clothcombo_trainer::dataset::objective::scene_weights;
use clothcombo_trainer::score::checked_body;
use miette::{IntoDiagnostic, Report, WrapErr};
use numpy::{Element, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// The losses a configuration that says nothing has.
#[pyfunction]
pub fn default_losses(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    from_json(py, &LossesConfig::default())
}

/// What does not depend on the body.
struct SceneGarments {
    rest: Vec<TriMesh>,
    /// For a held garment, where its canonical positions are without any learned displacement.
    references: Vec<Option<Vec<[f64; 3]>>>,
    losses: LossesConfig,
    /// What each is made of, where that is not the losses' material.
    materials: Vec<GarmentMaterial>,
    /// Inner and outer garment of every pair.
    layers: Vec<(usize, usize)>,
}

/// Garments on a posed body, prepared once for each precision that positions come in.
#[pyclass(frozen, name = "Scene", module = "clothcombo._native")]
pub struct PyScene {
    garments: Arc<SceneGarments>,
    body: TriMesh,
    /// Initial skinning of every vertex, by which held garments are pulled back.
    transforms: Option<Vec<Transform>>,
    single: Prepared<f32>,
    double: Prepared<f64>,
}

/// What is prepared when it is first needed.
struct Prepared<T: Real> {
    /// Shared by the bodies that the garments are on.
    garments: Arc<OnceLock<Vec<Arc<GarmentEnergies<T>>>>>,
    scene: OnceLock<SceneEnergy<T>>,
}

impl<T: Real> Prepared<T> {
    /// For garments that are prepared already, or not yet.
    fn of(garments: Arc<OnceLock<Vec<Arc<GarmentEnergies<T>>>>>) -> Self {
        Self { garments, scene: OnceLock::new() }
    }
}

/// A precision of positions.
trait Precision: Real + Element {
    fn prepared(scene: &PyScene) -> &Prepared<Self>;
}

impl Precision for f32 {
    fn prepared(scene: &PyScene) -> &Prepared<Self> {
        &scene.single
    }
}

impl Precision for f64 {
    fn prepared(scene: &PyScene) -> &Prepared<Self> {
        &scene.double
    }
}

/// What `place` holds, which `make` makes the first time.
fn made_once<V>(place: &OnceLock<V>, make: impl FnOnce() -> Result<V, Report>) -> Result<&V, Report> {
    if place.get().is_none() {
        let _ = place.set(make()?);
    }
    Ok(place.get().expect("it was just set"))
}

impl SceneGarments {
    fn energies<T: Real>(&self) -> Result<Vec<Arc<GarmentEnergies<T>>>, Report> {
        let settings = self.losses.energy_settings();
        let made = (0..self.rest.len()).into_par_iter().map(|i| {
            let rest = &self.rest[i];
            let settings =
                EnergySettings { material: self.materials[i].over(&settings.material), ..settings };
            let held = self.references[i].is_some();
            let energies = GarmentEnergies::new(rest, &Topology::new(rest), &settings, held);
            energies.map(Arc::new).into_diagnostic().wrap_err_with(|| format!("garment {i}"))
        });
        made.collect()
    }

    fn vertex_count(&self) -> usize {
        self.rest.iter().map(TriMesh::vertex_count).sum()
    }
}

impl PyScene {
    fn energy<T: Precision>(&self) -> Result<&SceneEnergy<T>, Report> {
        made_once(&T::prepared(self).scene, || self.made())
    }

    fn made<T: Precision>(&self) -> Result<SceneEnergy<T>, Report> {
        let SceneGarments { rest, references, losses, layers, .. } = &*self.garments;
        let counts: Vec<usize> = rest.iter().map(TriMesh::vertex_count).collect();
        // The weights that the losses end with.
        let weights = scene_weights(losses, 1.0, &counts, layers);
        let energies = made_once(&T::prepared(self).garments, || self.garments.energies())?;
        let garments = energies.iter().zip(references).zip(weights.garments);
        let garments = garments.map(|((energies, reference), weights)| SceneGarment {
            energies: energies.clone(),
            holding_reference: reference.iter().flatten().map(|p| from_f64(*p)).collect(),
            pull_back: None,
            thickness_below: Vec::new(),
            weights,
        });
        let energy = SceneEnergy {
            body: Arc::new(Surface::from_mesh(&self.body)),
            garments: garments.collect(),
            layers: layers
                .iter()
                .zip(weights.layers)
                .map(|(&(inner, outer), weights)| SceneLayers { inner, outer, weights })
                .collect(),
            settings: losses.energy_settings(),
        };
        energy.check().into_diagnostic()?;
        Ok(match &self.transforms {
            Some(transforms) => energy.pulled_back(transforms),
            None => energy,
        })
    }
}

/// Rows of `[ΣV, 12]` as transforms.
fn transforms(rows: &PyReadonlyArray2<'_, f64>, vertices: usize) -> PyResult<Vec<Transform>> {
    match (rows.as_array().dim(), rows.as_slice()) {
        ((count, 12), Ok(values)) if count == vertices && values.iter().all(|x| x.is_finite()) => {
            Ok(values.as_chunks::<4>().0.as_chunks::<3>().0.to_vec())
        }
        ((count, _), _) => Err(refused_text(format!(
            "transforms are finite and have the shape [{vertices}, 3, 4], one for each vertex of all garments, not [{count}, …]"
        ))),
    }
}

#[pymethods]
impl PyScene {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "the keyword arguments of the package's `Scene`")]
    fn new(
        py: Python<'_>,
        garments: Vec<MeshInput>,
        body: MeshInput,
        held: Vec<bool>,
        references: Vec<Option<CopiedRows>>,
        skinning: Option<PyReadonlyArray2<'_, f64>>,
        layers: Option<Vec<(usize, usize)>>,
        losses: &str,
        materials: &str,
        is_double: bool,
    ) -> PyResult<Self> {
        let count = garments.len();
        if count == 0 || held.len() != count || references.len() != count {
            return Err(refused_text(format!(
                "{count} garments, held and reference for {} and {}; hint: at least one garment, and both for each",
                held.len(),
                references.len()
            )));
        }
        let losses: LossesConfig = to_value(losses, "losses")?;
        if let Some((key, what, hint)) = losses.problem() {
            return Err(refused_text(format!("{key} {what}\nhelp: {hint}")));
        }
        let mut materials: Vec<GarmentMaterial> = to_value(materials, "materials")?;
        if !materials.is_empty() && materials.len() != count {
            let given = materials.len();
            return Err(refused_text(format!(
                "{given} materials for {count} garments; hint: one for each, None where it is that of the losses"
            )));
        }
        for (i, material) in materials.iter().enumerate() {
            material.check().map_err(|what| refused_text(format!("garment {i}: {what}")))?;
        }
        materials.resize(count, GarmentMaterial::default());
        let files: Vec<PathBuf> = garments.iter().chain([&body]).filter_map(MeshInput::file).collect();
        let skinning = skinning.as_ref().map(|s| transforms(s, s.as_array().nrows())).transpose()?;
        let layers = layers.unwrap_or_else(|| {
            (0..count).flat_map(|outer| (0..outer).map(move |inner| (inner, outer))).collect()
        });
        let is_wrong = |&(inner, outer): &(usize, usize)| inner >= outer || outer >= count;
        if let Some(pair) = layers.iter().position(is_wrong) {
            let (inner, outer) = layers[pair];
            let error = EnergyError::LayerPair { pair, inner, outer, garments: count };
            return Err(refused(Report::from_err(error)));
        }
        call(py, &files, || {
            let body = checked_body(body.triangles("body")?)?;
            let garments = triangles("garment", garments)?;
            let rest: Vec<TriMesh> = garments.into_iter().map(|garment| garment.mesh).collect();
            let references = held.iter().zip(references).enumerate().map(|(i, (held, reference))| {
                let given = |CopiedRows(positions)| moved(&format!("reference {i}"), &rest[i], positions);
                let reference = reference.map(given).transpose()?;
                Ok(held.then(|| reference.as_ref().unwrap_or(&rest[i]).positions().to_vec()))
            });
            let references = references.collect::<Result<_, Report>>()?;
            let garments = SceneGarments { rest, references, losses, materials, layers };
            if let Some(found) = skinning.as_ref().filter(|t| t.len() != garments.vertex_count()) {
                let (found, expected) = (found.len(), garments.vertex_count());
                return Err(Report::msg(format!(
                    "{found} transforms for {expected} vertices of all garments"
                )));
            }
            let scene = Self {
                garments: Arc::new(garments),
                body,
                transforms: skinning,
                single: Prepared::of(Arc::default()),
                double: Prepared::of(Arc::default()),
            };
            match is_double {
                true => scene.energy::<f64>().map(|_| ())?,
                false => scene.energy::<f32>().map(|_| ())?,
            }
            Ok(scene)
        })
    }

    /// The same garments on another posed body, with another skinning.
    fn on_body(
        &self,
        py: Python<'_>,
        positions: CopiedRows,
        skinning: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<Self> {
        let skinning = skinning.as_ref().map(|s| transforms(s, self.garments.vertex_count())).transpose()?;
        if self.transforms.is_some() && skinning.is_none() && self.needs_transforms() {
            return Err(refused_text(
                "garments are held by their posed positions; hint: give transforms of this body",
            ));
        }
        call(py, &[], || {
            Ok::<_, Report>(Self {
                garments: self.garments.clone(),
                body: moved("body", &self.body, positions.0)?,
                transforms: skinning,
                single: Prepared::of(self.single.garments.clone()),
                double: Prepared::of(self.double.garments.clone()),
            })
        })
    }

    /// Vertices of every garment.
    #[getter]
    fn vertex_counts(&self) -> Vec<usize> {
        self.garments.rest.iter().map(TriMesh::vertex_count).collect()
    }

    /// Whether canonical positions are needed.
    #[getter]
    fn needs_canonical(&self) -> bool {
        self.transforms.is_none() && self.needs_transforms()
    }
}

impl PyScene {
    fn needs_transforms(&self) -> bool {
        let weight = self.garments.losses.weight(Term::Holding).at(1.0);
        weight != 0.0 && self.garments.references.iter().any(Option::is_some)
    }

    /// Value and gradient at checked positions.
    fn evaluate<T: Precision>(
        &self,
        posed: &[[T; 3]],
        canonical: &[[T; 3]],
        sample: u32,
    ) -> Result<SceneValue<T>, Report> {
        let count = self.garments.vertex_count();
        for (what, positions) in [("positions", posed), ("canonical positions", canonical)] {
            let (found, is_canonical) = (positions.len(), what != "positions");
            if found != count && !(is_canonical && found == 0 && !self.needs_canonical()) {
                let hint = if found == 0 { "; hint: held garments need them, or transforms" } else { "" };
                return Err(Report::msg(format!(
                    "{found} {what} for the {count} vertices of the scene{hint}"
                )));
            }
            // Within a kilometre, as the post-process asks; what is not a number fails as well.
            let is_near = |p: &[T; 3]| p.iter().all(|x| Real::to_f64(*x).abs() <= FARTHEST_POSITION);
            if let Some(vertex) = positions.iter().position(|p| !is_near(p)) {
                let place = positions[vertex].map(Real::to_f64);
                return Err(Report::msg(format!(
                    "vertex {vertex} (from 0) of the {what} is at {place:?}; hint: positions are finite, in metres, within a kilometre \
                     of the origin"
                )));
            }
        }
        let energy = self.energy::<T>()?;
        if energy.settings.repulsion_subset.is_none() || sample == energy.settings.repulsion_sample {
            return Ok(energy.evaluate(posed, canonical));
        }
        let mut sampled = energy.clone();
        sampled.settings.repulsion_sample = sample;
        Ok(sampled.evaluate(posed, canonical))
    }

    /// Every term, summed over garments or pairs: 0 where nothing has it, NaN where it has no weight and was not evaluated.
    fn terms<T>(value: &SceneValue<T>, is_weighted: impl Fn(Term) -> bool) -> [f64; Term::COUNT] {
        let all = || value.garments.iter().chain(&value.layers);
        Term::ALL.map(|term| match is_weighted(term) {
            true => all().filter_map(|raw: &TermMap<Option<f64>>| raw[term]).sum(),
            false => f64::NAN,
        })
    }
}

type Evaluated<'py, T> =
    (f64, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<T>>, Option<Bound<'py, PyArray2<T>>>);

fn evaluate<'py, T: Precision>(
    py: Python<'py>,
    scenes: &[PyRef<'py, PyScene>],
    posed: &[PyReadonlyArray2<'py, T>],
    canonical: &[Option<PyReadonlyArray2<'py, T>>],
    sample: u32,
) -> PyResult<Vec<Evaluated<'py, T>>> {
    if scenes.len() != posed.len() || scenes.len() != canonical.len() {
        return Err(refused_text(format!("positions of {} scenes for {}", posed.len(), scenes.len())));
    }
    let posed = posed.iter().map(rows).collect::<PyResult<Vec<_>>>()?;
    let canonical =
        canonical.iter().map(|c| c.as_ref().map_or(Ok(&[][..]), rows)).collect::<PyResult<Vec<_>>>()?;
    let scenes: Vec<&PyScene> = scenes.iter().map(|scene| &**scene).collect();
    let values = call(py, &[], || {
        let one = |i: usize| scenes[i].evaluate(posed[i], canonical[i], sample);
        match scenes.len() {
            1 => Ok(vec![one(0)?]),
            count => (0..count).into_par_iter().map(one).collect::<Result<Vec<_>, Report>>(),
        }
    })?;
    let results = values.into_iter().zip(scenes).zip(canonical).map(|((value, scene), canonical)| {
        let losses = &scene.garments.losses;
        let terms = PyScene::terms(&value, |term| losses.weight(term).at(1.0) != 0.0);
        let of_canonical = (!canonical.is_empty()).then(|| array(py, value.canonical_gradient));
        let terms = PyArray1::from_slice(py, &terms);
        (value.total, terms, array(py, value.posed_gradient), of_canonical)
    });
    Ok(results.collect())
}

/// Total, terms and gradients of scenes at positions [ΣV, 3] and, where they are needed, canonical positions.
#[pyfunction]
pub fn evaluate_f32<'py>(
    py: Python<'py>,
    scenes: Vec<PyRef<'py, PyScene>>,
    posed: Vec<PyReadonlyArray2<'py, f32>>,
    canonical: Vec<Option<PyReadonlyArray2<'py, f32>>>,
    sample: u32,
) -> PyResult<Vec<Evaluated<'py, f32>>> {
    evaluate(py, &scenes, &posed, &canonical, sample)
}

/// The same in double precision.
#[pyfunction]
pub fn evaluate_f64<'py>(
    py: Python<'py>,
    scenes: Vec<PyRef<'py, PyScene>>,
    posed: Vec<PyReadonlyArray2<'py, f64>>,
    canonical: Vec<Option<PyReadonlyArray2<'py, f64>>>,
    sample: u32,
) -> PyResult<Vec<Evaluated<'py, f64>>> {
    evaluate(py, &scenes, &posed, &canonical, sample)
}
