//! Time and error of numerical choices: precision of the weights, eigenpairs, distance to the body.

use super::subject::Subject;
use super::table::{Table, number};
use crate::dataset::{Dataset, HeldOut, PreparedScene};
use crate::evaluation::equilibrium_error::mean_distance;
use crate::evaluation::median_ms;
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::inference::reference::wide;
use crate::inference::tensor_store::{DrapeError, TensorStore};
use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::{Tensor, TensorData, bf16, f16};
use clothcombo_physics::energy::SceneEnergy;
use clothcombo_physics::query::Distance;
use miette::Report;
use serde::Serialize;
use std::sync::Arc;

/// Repetitions of a measurement last this long (s).
const SECONDS: f64 = 0.05;

/// What one choice gives on all scenes.
#[derive(Clone, Debug, Serialize)]
pub struct NumericalChoice {
    /// Its name.
    pub name: String,
    /// Mean time of a scene (ms): to embed and drape it, or for its losses with their gradient.
    pub ms: f64,
    /// Energy of all scenes (J).
    pub energy: f64,
    /// Mean distance from the vertices draped by the model as trained (mm); none for losses.
    pub distance_mm: Option<f64>,
}

/// Drapes `scenes` scenes of one to three garments by variants of the networks, and evaluates both distances of the losses.
///
/// # Errors
/// When a scene cannot be draped, or the data not be prepared for another number of eigenpairs.
pub fn ask(subject: &Subject, question: usize, scenes: usize) -> Result<Vec<NumericalChoice>, Report> {
    let Subject { config, dataset, model, .. } = subject;
    let all: Vec<usize> = (0..dataset.garments.len()).collect();
    let sample = |i: usize| subject.draw([question, i], &all, 1 + i % 3, HeldOut::Windows);
    let scenes = (0..scenes).map(|i| subject.prepare(sample(i))).collect::<Result<Vec<_>, _>>()?;
    let count = config.model.eigen_count;
    let mut variants = vec![
        (format!("network as trained, {count} eigenpairs"), model.clone(), dataset.clone()),
        (
            "weights in bf16".into(),
            model.clone().map(&mut Rounded(|x| bf16::from_f32(x).to_f32())),
            dataset.clone(),
        ),
        (
            "weights in f16".into(),
            model.clone().map(&mut Rounded(|x| f16::from_f32(x).to_f32())),
            dataset.clone(),
        ),
    ];
    for count in [count.div_ceil(2), count.div_ceil(4)] {
        let mut config = config.clone();
        config.model.eigen_count = count;
        let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {})?);
        variants.push((format!("{count} eigenpairs"), model.clone(), dataset));
    }
    let mut choices = Vec::new();
    let mut as_trained: Option<Vec<Draped>> = None;
    for (name, model, dataset) in variants {
        let tensors = TensorStore::new(dataset.clone(), dataset.dimensions(), &model.devices()[0]);
        // New networks have embedded nothing yet, so that the time includes the embedding.
        let drape = |scene| Networks::new(model.clone(), &tensors).drape(scene);
        let drapes = scenes.iter().map(drape).collect::<Result<Vec<_>, DrapeError>>()?;
        let expected = as_trained.get_or_insert_with(|| drapes.clone());
        let vertices = |drapes: &[Draped]| drapes.iter().flat_map(|d| wide(&d.posed)).collect::<Vec<_>>();
        let distance = mean_distance(&vertices(&drapes), &vertices(expected));
        let energies = scenes.iter().zip(&drapes);
        choices.push(NumericalChoice {
            name,
            ms: mean_ms(scenes.iter(), drape)?,
            energy: energies.map(|(s, d)| s.bodies[0].energy.value(&d.posed, &d.canonical).total).sum(),
            distance_mm: Some(1e3 * distance),
        });
    }
    let drapes = as_trained.unwrap_or_default();
    for (name, distance) in
        [("nearest vertex", Distance::NearestVertex), ("closest point", Distance::ClosestPoint)]
    {
        let energy = |scene: &PreparedScene| {
            let mut energy = SceneEnergy::clone(&scene.bodies[0].energy);
            energy.settings.distance = distance;
            energy
        };
        let energies: Vec<SceneEnergy<f32>> = scenes.iter().map(energy).collect();
        let evaluate = |(energy, draped): (&SceneEnergy<f32>, &Draped)| {
            Ok::<_, Report>(energy.evaluate(&draped.posed, &draped.canonical))
        };
        choices.push(NumericalChoice {
            name: format!("losses, distance to the {name} of the body"),
            ms: mean_ms(energies.iter().zip(&drapes), evaluate)?,
            energy: energies.iter().zip(&drapes).map(|(e, d)| e.value(&d.posed, &d.canonical).total).sum(),
            distance_mm: None,
        });
    }
    Ok(choices)
}

/// Mean over the items of the median time of `run` (ms).
fn mean_ms<I: Copy, R, E>(
    items: impl ExactSizeIterator<Item = I>,
    run: impl Fn(I) -> Result<R, E>,
) -> Result<f64, E> {
    let count = items.len() as f64;
    let times = items.map(|item| median_ms(SECONDS, || run(item))).collect::<Result<Vec<_>, E>>()?;
    Ok(times.into_iter().sum::<f64>() / count)
}

/// Rounds every parameter.
struct Rounded(fn(f32) -> f32);

impl ModuleMapper for Rounded {
    fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (id, value, mapper) = parameter.consume();
        let (shape, device) = (value.shape(), value.device());
        let values: Vec<f32> = value.into_data().try_to_vec().expect("parameters are f32");
        let rounded: Vec<f32> = values.into_iter().map(self.0).collect();
        Param::from_mapped_value(id, Tensor::from_data(TensorData::new(rounded, shape), &device), mapper)
    }
}

/// The choices as a table.
pub fn table(choices: &[NumericalChoice]) -> Table {
    let head = ["choice", "time [ms]", "energy [J]", "distance from the drape as trained [mm]"];
    let mut table = Table::new("Numerical choices: time and error", &head)
        .with_note("Networks: embedding and draping a scene. Losses: all of a scene with their gradient.");
    let distance = |c: &NumericalChoice| number(c.distance_mm.unwrap_or(f64::NAN));
    let row = |c: &NumericalChoice| vec![c.name.clone(), number(c.ms), number(c.energy), distance(c)];
    table.rows = choices.iter().map(row).collect();
    table
}
