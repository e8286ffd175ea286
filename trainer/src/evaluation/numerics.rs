//! Time and error of numerical choices: precision of the weights, eigenpairs, distance to the body.

use super::{Evaluator, ModelUnderTest, Section, Table};
use crate::dataset::{Dataset, HeldOut, PreparedScene};
use crate::evaluation::equilibrium_error::mean_distance;
use crate::evaluation::timing::{REPETITION_SECONDS, median_ms};
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::inference::reference::wide;
use crate::inference::tensor_store::{DrapeError, TensorStore};
use crate::run::report::table::{Column, number, plain};
use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::{Tensor, TensorData, bf16, f16};
use clothcombo_physics::energy::SceneEnergy;
use clothcombo_physics::query::Distance;
use miette::Report;
use serde_json::{Value, json};
use std::sync::Arc;

const CHOICE_COLUMNS: [Column<'_>; 4] = [
    ("choice", "/name", plain),
    ("time [ms]", "/milliseconds", number),
    ("energy [J]", "/energy", number),
    ("distance from the drape as trained [mm]", "/distance_mm", number),
];

/// Drapes scenes of one to three garments by variants of the networks, and evaluates both distances of the losses.
///
/// # Errors
/// When a scene cannot be draped, or the data not be prepared for another number of eigenpairs.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    let ModelUnderTest { config, dataset, model, .. } = evaluator.model;
    let garments = evaluator.model.garments();
    let scene = |i: usize| {
        let sample = evaluator.model.sample([14, i], &garments, 1 + i % 3, HeldOut::Windows);
        evaluator.model.prepare(&sample)
    };
    let scenes = (0..evaluator.counts.pareto[0]).map(scene).collect::<Result<Vec<_>, _>>()?;
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
        let energies = energies.map(|(s, d)| s.bodies[0].energy.value(&d.posed, &d.canonical).total);
        choices.push(json!({
            "name": name,
            "milliseconds": mean_ms(scenes.iter(), drape)?,
            "energy": energies.sum::<f64>(),
            "distance_mm": 1e3 * distance,
        }));
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
        let of_drapes = energies.iter().zip(&drapes).map(|(e, d)| e.value(&d.posed, &d.canonical).total);
        choices.push(json!({
            "name": format!("losses, distance to the {name} of the body"),
            "milliseconds": mean_ms(energies.iter().zip(&drapes), evaluate)?,
            "energy": of_drapes.sum::<f64>(),
            "distance_mm": Value::Null,
        }));
    }
    let table = Table::new("Numerical choices: time and error", &choices, &CHOICE_COLUMNS)
        .with_note("Networks: embedding and draping a scene. Losses: all of a scene with their gradient.");
    Ok(vec![Section::new("numerics", "Numerical choices", "", choices, vec![table])])
}

/// Mean over the items of the median time of `run` (ms).
fn mean_ms<I: Copy, R, E>(
    items: impl ExactSizeIterator<Item = I>,
    run: impl Fn(I) -> Result<R, E>,
) -> Result<f64, E> {
    let count = items.len() as f64;
    let times =
        items.map(|item| median_ms(REPETITION_SECONDS, || run(item))).collect::<Result<Vec<_>, E>>()?;
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
