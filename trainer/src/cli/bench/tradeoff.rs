//! `clothcombo bench tradeoff`.

use super::step::short;
use crate::cli::train::load_under_bar;
use crate::cli::values::{measuring_seconds, picture_file};
use crate::cli::verbosity::say;
use crate::config::{Config, LossesConfig, ValidationConfig};
use crate::dataset::{Dataset, PreparedScene, ValidationGroup, prepare, sample_validation};
use crate::evaluation::median_ms;
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::inference::tensor_store::TensorStore;
use crate::picture::{Line, LinePanel, draw_lines, save_png};
use crate::run::checkpoint::TrainedModel;
use crate::system::device::Backend;
use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::{Tensor, TensorData, bf16, f16};
use clap::Parser;
use clothcombo_model::ClothCombo;
use clothcombo_physics::energy::{GarmentEnergies, SceneEnergy, SceneGarment};
use clothcombo_physics::mesh::Topology;
use clothcombo_physics::query::{Distance, Surface};
use clothcombo_physics::real::Real;
use miette::{IntoDiagnostic, Report, miette};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

/// Speed against error: eigenpairs, half-precision weights, other networks; precision and distance of the losses
#[derive(Parser)]
#[command(
    after_help = "Examples:\n  clothcombo bench tradeoff --checkpoint runs/open --picture tradeoff.png\n  \
        clothcombo bench tradeoff --checkpoint runs/wide --checkpoint runs/narrow\n\n\
        Differences are measured from the first checkpoint as it was trained, on held-out validation scenes."
)]
pub struct Arguments {
    /// Run, checkpoints or checkpoint folder; further ones, trained on the same data, are compared with the first
    #[arg(long, value_name = "DIR", required = true)]
    checkpoint: Vec<PathBuf>,
    /// Numbers of eigenpairs
    #[arg(long, value_delimiter = ',', default_values_t = [16, 24, 32, 48, 64, 96, 128])]
    eigen_counts: Vec<usize>,
    /// Validation scenes of one garment
    #[arg(long, default_value_t = 8)]
    single_scenes: usize,
    /// Validation scenes of several layers
    #[arg(long, default_value_t = 4)]
    layered_scenes: usize,
    /// Time spent on each single measurement [s]
    #[arg(long, default_value_t = 0.2, value_parser = measuring_seconds)]
    seconds: f64,
    /// Writes time and difference over the eigenpairs (PNG)
    #[arg(long, value_name = "FILE", value_parser = picture_file())]
    picture: Option<PathBuf>,
    /// Print JSON instead of Markdown tables
    #[arg(long)]
    json: bool,
}

/// One way to drape.
#[derive(Clone, Debug, Serialize)]
struct Drapes {
    variant: String,
    eigen_count: usize,
    /// Embedding and draping one scene, mean over the scenes [ms].
    ms: f64,
    /// Mean and largest distance of a vertex from where the first variant puts it [mm].
    mean_mm: f64,
    largest_mm: f64,
    /// Weighted sum of all energies, mean over the scenes, and its difference from the first variant's.
    energy: f64,
    energy_percent: f64,
    #[serde(skip)]
    draped: Vec<Draped>,
}

/// One way to evaluate the losses.
#[derive(Clone, Debug, Serialize)]
struct LossForm {
    variant: &'static str,
    /// Value and gradient of one scene, mean over the scenes [ms].
    ms: f64,
    energy_percent: f64,
    /// Norm of the gradient's difference over that of the first variant's gradient.
    gradient_percent: f64,
}

/// Runs the verb.
///
/// # Errors
/// When a checkpoint or its data cannot be read, or checkpoints do not fit the same data.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let first = TrainedModel::open(&arguments.checkpoint[0])?;
    let config = first.config.clone();
    let dataset = Arc::new(load_under_bar(&config)?);
    let scenes = scenes(&dataset, &config, arguments)?;
    let trained = networks(&first, &dataset)?;

    let k = config.model.eigen_count;
    let base = drapes(
        &format!("as trained, k = {k}"),
        k,
        trained.clone(),
        &dataset,
        &scenes,
        None,
        arguments.seconds,
    )?;
    let mut rows = vec![base.clone()];
    let mut add = |name: &str, k: usize, model: ClothCombo, dataset: &Arc<Dataset>| -> Result<(), Report> {
        say(&format!("measuring {name}"));
        rows.push(drapes(name, k, model, dataset, &scenes, Some(&base), arguments.seconds)?);
        Ok(())
    };
    add("weights in bf16", k, trained.clone().map(&mut Rounded(|x| bf16::from_f32(x).to_f32())), &dataset)?;
    add("weights in f16", k, trained.clone().map(&mut Rounded(|x| f16::from_f32(x).to_f32())), &dataset)?;
    for &count in arguments.eigen_counts.iter().filter(|count| **count != k) {
        let mut other = config.clone();
        other.model.eigen_count = count;
        let dataset = Arc::new(load_under_bar(&other)?);
        add(&format!("k = {count}"), count, trained.clone(), &dataset)?;
    }
    for path in &arguments.checkpoint[1..] {
        let other = TrainedModel::open(path)?;
        let model = &other.config.model;
        let own = Config { model: model.clone(), ..config.clone() };
        let dataset = match model.eigen_count {
            same if same == k => dataset.clone(),
            _ => Arc::new(load_under_bar(&own)?),
        };
        let name = format!("{} (width {})", path.display(), model.width);
        add(&name, model.eigen_count, networks(&other, &dataset)?, &dataset)?;
    }
    let losses = loss_forms(&config.losses, &scenes, &base.draped, arguments.seconds)?;
    if let Some(path) = &arguments.picture {
        let picture = draw_lines("Speed against error", &panels(&rows)).into_diagnostic()?;
        save_png(&picture, path).into_diagnostic()?;
    }
    if arguments.json {
        let report = serde_json::json!({ "drapes": rows, "losses": losses });
        println!("{}", serde_json::to_string_pretty(&report).into_diagnostic()?);
    } else {
        print_tables(&rows, &losses);
    }
    Ok(())
}

fn scenes(dataset: &Dataset, config: &Config, arguments: &Arguments) -> Result<Vec<PreparedScene>, Report> {
    let validation = ValidationConfig {
        single_scenes: arguments.single_scenes,
        layered_scenes: arguments.layered_scenes,
        ..config.validation.clone()
    };
    let mut scenes = Vec::new();
    for group in [ValidationGroup::Single, ValidationGroup::Layered] {
        for draw in sample_validation(dataset, config.validation_seed(), &validation, group) {
            scenes.push(prepare(dataset, &config.losses, draw, 1.0)?);
        }
    }
    match scenes.is_empty() {
        true => Err(miette!(help = "give --single-scenes or --layered-scenes", "there is no scene to drape")),
        false => Ok(scenes),
    }
}

fn networks(trained: &TrainedModel, dataset: &Dataset) -> Result<ClothCombo, Report> {
    trained.check_fits(dataset)?;
    Ok(trained.networks(&Backend::preferred().device())?)
}

fn drapes(
    variant: &str,
    eigen_count: usize,
    model: ClothCombo,
    dataset: &Arc<Dataset>,
    scenes: &[PreparedScene],
    base: Option<&Drapes>,
    seconds: f64,
) -> Result<Drapes, Report> {
    let device = Backend::preferred().device();
    let tensors = TensorStore::new(dataset.clone(), dataset.dimensions(), &device);
    let mut draped = Vec::with_capacity(scenes.len());
    let (mut ms, mut energy) = (0.0, 0.0);
    for scene in scenes {
        // Networks made anew have embedded nothing yet.
        ms += median_ms(seconds, || Networks::new(model.clone(), &tensors).drape(scene))?;
        let found = Networks::new(model.clone(), &tensors).drape(scene)?;
        energy += scene.bodies[0].energy.value(&found.posed, &found.canonical).total;
        draped.push(found);
    }
    let distances: Vec<f64> = match base {
        None => vec![0.0],
        Some(base) => base
            .draped
            .iter()
            .zip(&draped)
            .flat_map(|(a, b)| a.posed.iter().zip(&b.posed))
            .map(|(a, b)| (0..3).map(|axis| f64::from(a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt())
            .collect(),
    };
    let count = scenes.len() as f64;
    let energy = energy / count;
    Ok(Drapes {
        variant: variant.to_owned(),
        eigen_count,
        ms: ms / count,
        mean_mm: 1e3 * distances.iter().sum::<f64>() / distances.len() as f64,
        largest_mm: 1e3 * distances.iter().copied().fold(0.0, f64::max),
        energy,
        energy_percent: base.map_or(0.0, |base| 100.0 * (energy - base.energy) / base.energy.abs()),
        draped,
    })
}

/// Rounds every parameter as a function does.
struct Rounded<F>(F);

impl<F: Fn(f32) -> f32> ModuleMapper for Rounded<F> {
    fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (id, value, mapper) = parameter.consume();
        let (shape, device) = (value.shape(), value.device());
        let values: Vec<f32> = value.into_data().try_to_vec().expect("parameters are f32");
        let rounded: Vec<f32> = values.into_iter().map(&self.0).collect();
        Param::from_mapped_value(id, Tensor::from_data(TensorData::new(rounded, shape), &device), mapper)
    }
}

fn loss_forms(
    losses: &LossesConfig,
    scenes: &[PreparedScene],
    draped: &[Draped],
    seconds: f64,
) -> Result<Vec<LossForm>, Report> {
    let distances = [Distance::NearestVertex, Distance::ClosestPoint];
    let mut forms = Vec::new();
    let mut first: Option<(f64, Vec<[f64; 3]>)> = None;
    for (variant, distance, wide) in [
        ("f32, nearest vertex", distances[0], false),
        ("f64, nearest vertex", distances[0], true),
        ("f32, closest point of the surface", distances[1], false),
        ("f64, closest point of the surface", distances[1], true),
    ] {
        let (mut ms, mut energy, mut gradient) = (0.0, 0.0, Vec::new());
        for (scene, draped) in scenes.iter().zip(draped) {
            let (time, value, mut slope) = match wide {
                true => evaluated::<f64>(losses, scene, distance, draped, seconds)?,
                false => evaluated::<f32>(losses, scene, distance, draped, seconds)?,
            };
            ms += time / scenes.len() as f64;
            energy += value;
            gradient.append(&mut slope);
        }
        let (base_energy, base_gradient) = first.get_or_insert_with(|| (energy, gradient.clone()));
        let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
        let apart =
            norm(&mut gradient.as_flattened().iter().zip(base_gradient.as_flattened()).map(|(a, b)| a - b));
        forms.push(LossForm {
            variant,
            ms,
            energy_percent: 100.0 * (energy - *base_energy) / base_energy.abs(),
            gradient_percent: 100.0 * apart / norm(&mut base_gradient.as_flattened().iter().copied()),
        });
    }
    Ok(forms)
}

/// Time [ms], value and posed gradient of a scene's losses in scalars `T`.
fn evaluated<T: Real>(
    losses: &LossesConfig,
    scene: &PreparedScene,
    distance: Distance,
    draped: &Draped,
    seconds: f64,
) -> Result<(f64, f64, Vec<[f64; 3]>), Report> {
    let narrow = &scene.bodies[0].energy;
    let settings = clothcombo_physics::EnergySettings { distance, ..losses.energy_settings() };
    let scalars = |positions: &[[f32; 3]]| -> Vec<[T; 3]> {
        positions.iter().map(|p| p.map(|v| T::from_f64(f64::from(v)))).collect()
    };
    let garment = |(garment, dressed): (&Arc<crate::dataset::PreparedGarment>, &SceneGarment<f32>)| {
        let mesh = &garment.garment.rest;
        let energies = GarmentEnergies::new(mesh, &Topology::new(mesh), &settings, garment.garment.holding);
        Ok(SceneGarment {
            energies: Arc::new(energies.into_diagnostic()?),
            holding_reference: scalars(&dressed.holding_reference),
            pull_back: dressed.pull_back.clone(),
            weights: dressed.weights,
        })
    };
    let garments =
        scene.garments.iter().zip(&narrow.garments).map(garment).collect::<Result<Vec<_>, Report>>()?;
    let energy = SceneEnergy::<T> {
        body: Arc::new(Surface::new(scalars(&narrow.body.positions), narrow.body.faces.clone())),
        garments,
        layers: narrow.layers.clone(),
        settings,
    };
    let (posed, canonical) = (scalars(&draped.posed), scalars(&draped.canonical));
    let ms = median_ms(seconds, || Ok::<_, Report>(energy.evaluate(&posed, &canonical)))?;
    let value = energy.evaluate(&posed, &canonical);
    let gradient = value.posed_gradient.iter().map(|g| g.map(Real::to_f64)).collect();
    Ok((ms, value.total, gradient))
}

fn panels(rows: &[Drapes]) -> Vec<LinePanel> {
    let mut by_count: Vec<&Drapes> = rows
        .iter()
        .filter(|row| row.variant.starts_with("k = ") || row.variant.starts_with("as trained"))
        .collect();
    by_count.sort_by_key(|row| row.eigen_count);
    let line = |name: &str, value: fn(&Drapes) -> f64| Line {
        name: name.to_owned(),
        points: by_count.iter().map(|row| (row.eigen_count as f64, value(row))).collect(),
    };
    vec![
        LinePanel {
            title: "eigenpairs k".into(),
            lines: vec![line("embedding and draping a scene [ms]", |row| row.ms)],
        },
        LinePanel {
            title: "eigenpairs k".into(),
            lines: vec![
                line("mean distance from the drape as trained [mm]", |row| row.mean_mm),
                line("largest distance [mm]", |row| row.largest_mm),
                line("energy difference [%], absolute", |row| row.energy_percent.abs()),
            ],
        },
    ]
}

fn print_tables(rows: &[Drapes], losses: &[LossForm]) {
    println!(
        "Embedding and draping a scene; distances are those of the vertices from the drape as trained.\n"
    );
    println!("| variant | time [ms] | mean distance [mm] | largest [mm] | energy | energy difference [%] |");
    println!("|---|---:|---:|---:|---:|---:|");
    for r in rows {
        println!(
            "| {} | {} | {:.3} | {:.2} | {:.4} | {:+.3} |",
            r.variant,
            short(r.ms),
            r.mean_mm,
            r.largest_mm,
            r.energy,
            r.energy_percent
        );
    }
    println!("\nAll losses of a scene with their gradient.\n");
    println!("| variant | time [ms] | energy difference [%] | gradient difference [%] |");
    println!("|---|---:|---:|---:|");
    for l in losses {
        println!(
            "| {} | {} | {:+.5} | {:.4} |",
            l.variant,
            short(l.ms),
            l.energy_percent,
            l.gradient_percent
        );
    }
}
