//! A step whose loss or gradient was not finite, as a file that can be replayed.
//!
//! ```text
//! incidents/step-120.json   configuration, garments, shapes, poses, energies per term, loss, gradient norm
//! incidents/step-120.bpk    the weights the step started from
//! ```
//! The scene is kept by its numbers, not by its seed alone: it replays even where the generator has changed since.

use crate::config::{Config, Injected, Trains, parse, to_toml};
use crate::dataset::{BodySample, Dataset, PreparedScene, SceneSample, prepare};
use crate::inference::tensor_store::TensorStore;
use crate::run::checkpoint::{checksum, load_model, save_model};
use crate::system::exact::Exact;
use crate::training::learner::{Learner, StepInput, StepOutput};
use crate::training::schedule::ScheduleAt;
use burn::tensor::Device;
use clothcombo_data::asset::Pose;
use clothcombo_data::format::atomic;
use clothcombo_model::ClothCombo;
use clothcombo_physics::energy::{Term, TermMap};
use miette::{Report, miette};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Version of the file; others are refused.
const INCIDENT_FORMAT: u32 = 2;

/// A step whose loss or gradient was not finite.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Incident {
    /// Version of the file.
    pub format: u32,
    /// Steps done, this one included.
    pub step: u64,
    /// Name of the stage.
    pub stage: String,
    /// What was trained.
    pub trains: Trains,
    /// Seed of the run.
    pub seed: u64,
    /// Fraction of the run that was done, which the weights of the losses follow.
    pub run_progress: Exact,
    /// Adam's step size.
    pub learning_rate: Exact,
    /// Share of the full pose.
    pub pose_scale: Exact,
    /// What a test broke on purpose.
    pub injected: Option<Injected>,
    /// Weighted loss.
    pub loss: Exact,
    /// Global gradient norm before clipping, as in the log of the run.
    pub gradient_norm: Exact,
    /// The scenes of the step.
    pub scenes: Vec<IncidentScene>,
    /// File of the weights, beside this one.
    pub weights: String,
    /// BLAKE3 of that file.
    pub weights_checksum: String,
    /// The configuration, as TOML.
    pub config: String,
}

/// Garments on bodies.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IncidentScene {
    /// Inner → outer.
    pub garments: Vec<IncidentGarment>,
    /// Garments below them of which only the thickness counted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub below: Vec<IncidentGarment>,
    /// Bodies the garments were draped on.
    pub bodies: Vec<IncidentBody>,
    /// Number of the random sample of pairs that the repulsion looked at.
    pub repulsion_sample: u32,
}

/// A garment, found again by its place and name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IncidentGarment {
    /// Place in the dataset.
    pub index: usize,
    /// Name.
    pub name: String,
    /// Number of vertices.
    pub vertices: usize,
}

/// One body with the energies of the garments on it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IncidentBody {
    /// Shape parameters β.
    pub shape: Vec<Exact>,
    /// Pose θ: axis-angle per joint (rad).
    pub pose: Vec<[Exact; 3]>,
    /// Weighted sum of all energies.
    pub total: Exact,
    /// Raw energies of every garment.
    pub garments: Vec<BTreeMap<String, Exact>>,
    /// Raw energies of every pair of layers.
    pub layers: Vec<BTreeMap<String, Exact>>,
}

/// What surrounds a step that failed.
pub struct Circumstances<'a> {
    /// Configuration of the run.
    pub config: &'a Config,
    /// Its data.
    pub dataset: &'a Dataset,
    /// Steps done, this one included.
    pub step: u64,
    /// The schedule at this step.
    pub at: &'a ScheduleAt,
    /// What a test broke on purpose.
    pub injected: Option<Injected>,
    /// The weights, which the step left alone.
    pub model: &'a ClothCombo,
}

impl Incident {
    /// Writes a failed step into `folder` and returns the file.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(
        folder: &Path,
        around: &Circumstances,
        scenes: &[PreparedScene],
        output: &StepOutput,
    ) -> Result<PathBuf, Report> {
        let path = folder.join(format!("step-{}.json", around.step));
        let unusable = |e: &dyn Display| unusable(&path, e);
        std::fs::create_dir_all(folder).map_err(|e| unusable(&e))?;
        let weights = format!("step-{}.bpk", around.step);
        save_model(around.model, &folder.join(&weights)).map_err(|e| unusable(&e))?;
        let weights_checksum = checksum(&folder.join(&weights)).map_err(|e| unusable(&e))?;
        let stage = &around.config.stages[around.at.stage];
        let incident = Self {
            format: INCIDENT_FORMAT,
            step: around.step,
            stage: stage.name.clone(),
            trains: stage.trains,
            seed: around.config.seed,
            run_progress: around.at.run_progress.into(),
            learning_rate: around.at.learning_rate.into(),
            pose_scale: around.at.pose_scale.into(),
            injected: around.injected,
            loss: output.loss.into(),
            gradient_norm: output.gradient_norm.into(),
            scenes: describe(around.dataset, scenes, output),
            weights,
            weights_checksum,
            config: to_toml(around.config).map_err(|e| unusable(&e))?,
        };
        let text = serde_json::to_vec_pretty(&incident).map_err(|e| unusable(&e))?;
        atomic::write(&path, &text).map_err(|e| unusable(&e))?;
        Ok(path)
    }

    /// Reads an incident.
    ///
    /// # Errors
    /// When it is damaged or of another version.
    pub fn read(path: &Path) -> Result<Self, Report> {
        let text = std::fs::read_to_string(path).map_err(|e| unusable(path, &e))?;
        let tree: serde_json::Value =
            serde_json::from_str(&text).map_err(|e| unusable(path, &format!("is no incident: {e}")))?;
        match tree["format"].as_u64() {
            Some(version) if version == u64::from(INCIDENT_FORMAT) => {}
            _ => return Err(unusable(path, &format!("is no incident of version {INCIDENT_FORMAT}"))),
        }
        let incident: Self = serde_json::from_value(tree).map_err(|e| unusable(path, &e))?;
        match incident.scenes.iter().all(|s| !s.garments.is_empty() && !s.bodies.is_empty()) {
            true if !incident.scenes.is_empty() => Ok(incident),
            _ => Err(unusable(path, &"has no scene")),
        }
    }

    /// The configuration of the run, with `overrides`.
    ///
    /// # Errors
    /// When it cannot be used.
    pub fn configuration(&self, path: &Path, overrides: &[String]) -> Result<Config, Report> {
        Ok(parse(&self.config, path, overrides)?)
    }

    /// Computes the step again, from the weights beside `path`, and returns the incident that it makes now.
    ///
    /// # Errors
    /// When weights or data are not what they were.
    pub fn replay(
        &self,
        path: &Path,
        config: &Config,
        dataset: &Arc<Dataset>,
        device: &Device,
    ) -> Result<Self, Report> {
        let device = device.clone().autodiff();
        let model = self.model(path, config, dataset, &device)?;
        let mut scenes = Vec::with_capacity(self.scenes.len());
        for scene in &self.scenes {
            let sample = scene.to_sample(dataset, path)?;
            scenes.push(prepare(dataset, &config.losses, sample, self.run_progress.0)?);
        }
        if self.injected == Some(Injected::Position) {
            spoil_position(&mut scenes);
        }
        let tensors = TensorStore::new(dataset.clone(), dataset.dimensions(), &device);
        let mut learner = Learner::fresh(model, &config.optimizer);
        let spoil = self.injected == Some(Injected::Gradient);
        let input = StepInput { spoil_gradient: spoil, ..StepInput::whole(&tensors, &scenes, self.trains) };
        let output = learner.train_step(&input, self.learning_rate.0)?;
        Ok(Self {
            loss: output.loss.into(),
            gradient_norm: output.gradient_norm.into(),
            scenes: describe(dataset, &scenes, &output),
            ..self.clone()
        })
    }

    fn model(
        &self,
        path: &Path,
        config: &Config,
        dataset: &Dataset,
        device: &Device,
    ) -> Result<ClothCombo, Report> {
        let file = path.with_file_name(&self.weights);
        let sum = checksum(&file).map_err(|e| unusable(&file, &e))?;
        if sum != self.weights_checksum {
            return Err(unusable(&file, &"does not match its checksum"));
        }
        load_model(&file, &config.model, &dataset.dimensions(), device)
            .flatten()
            .map_err(|e| unusable(&file, &e))
    }

    /// All numbers that a replay must reproduce, by name, in order.
    pub fn numbers(&self) -> Vec<(String, Exact)> {
        let mut out = vec![("loss".to_owned(), self.loss), ("gradient norm".to_owned(), self.gradient_norm)];
        for (s, scene) in self.scenes.iter().enumerate() {
            for (b, body) in scene.bodies.iter().enumerate() {
                let place = format!("scene {s}, body {b}");
                out.push((format!("{place}: total"), body.total));
                for (garment, energies) in scene.garments.iter().zip(&body.garments) {
                    out.extend(energies.iter().map(|(t, v)| (format!("{place}, {}: {t}", garment.name), *v)));
                }
                for (pair, energies) in body.layers.iter().enumerate() {
                    out.extend(energies.iter().map(|(t, v)| (format!("{place}, pair {pair}: {t}"), *v)));
                }
            }
        }
        out
    }
}

/// What is wrong with the incident or the weights in `path`.
fn unusable(path: &Path, reason: &dyn Display) -> Report {
    miette!(
        help = "an incident is RUN/incidents/step-N.json with step-N.bpk beside it; copy both",
        "{}: {reason}",
        path.display()
    )
}

/// Gives the first vertex of the first body a NaN coordinate.
pub(crate) fn spoil_position(scenes: &mut [PreparedScene]) {
    if let Some(vertex) = scenes.first_mut().and_then(|s| s.bodies.first_mut()?.start.first_mut()) {
        vertex[0] = f32::NAN;
    }
}

fn describe(dataset: &Dataset, scenes: &[PreparedScene], output: &StepOutput) -> Vec<IncidentScene> {
    let energies = |values: &TermMap<Option<f64>>| -> BTreeMap<String, Exact> {
        Term::ALL.into_iter().filter_map(|t| Some((t.name().to_owned(), Exact(values[t]?)))).collect()
    };
    let of_scene = |(scene, outputs): (&PreparedScene, &Vec<_>)| {
        let garment = |&index: &usize| {
            let info = dataset.garments.info(index);
            IncidentGarment { index, name: info.name.clone(), vertices: info.vertices }
        };
        let bodies = scene.sample.bodies.iter().zip(outputs).map(
            |(body, output): (&BodySample, &clothcombo_physics::autodiff::SceneLossOutput)| {
                let value = output.value();
                IncidentBody {
                    shape: body.shape.iter().copied().map(Exact).collect(),
                    pose: body.pose.rotations.iter().map(|r| r.map(Exact)).collect(),
                    total: value.total.into(),
                    garments: value.garments.iter().map(energies).collect(),
                    layers: value.layers.iter().map(energies).collect(),
                }
            },
        );
        IncidentScene {
            garments: scene.sample.garments.iter().map(garment).collect(),
            below: scene.sample.below.iter().map(garment).collect(),
            bodies: bodies.collect(),
            repulsion_sample: scene.sample.repulsion_sample,
        }
    };
    scenes.iter().zip(&output.scenes).map(of_scene).collect()
}

impl IncidentScene {
    /// The scene as it was sampled.
    fn to_sample(&self, dataset: &Dataset, path: &Path) -> Result<SceneSample, Report> {
        let index = |garment: &IncidentGarment| {
            let changed = |reason: String| {
                miette!(
                    help = "restore the data of the run, or point to it with --set data.garments.0.folder=…",
                    "garment {:?} of the incident {reason}",
                    garment.name
                )
            };
            let is_it = |i: usize| dataset.garments.info(i).name == garment.name;
            let index = Some(garment.index)
                .filter(|&i| i < dataset.garments.len() && is_it(i))
                .or_else(|| (0..dataset.garments.len()).find(|&i| is_it(i)))
                .ok_or_else(|| changed("is not in the dataset any more".into()))?;
            match dataset.garments.info(index).vertices {
                found if found == garment.vertices => Ok(index),
                found => Err(changed(format!("has {found} vertices now, it had {}", garment.vertices))),
            }
        };
        let bodies = self.bodies.iter().map(|body| {
            let pose = Pose { rotations: body.pose.iter().map(|r| r.map(|v| v.0)).collect() };
            if body.shape.len() != dataset.shape_count || pose.rotations.len() > dataset.body.joint_count() {
                return Err(unusable(path, &"has a shape or pose that the body of the run does not take"));
            }
            let shape: Vec<f64> = body.shape.iter().map(|v| v.0).collect();
            match shape.iter().chain(pose.rotations.as_flattened()).all(|v| v.is_finite()) {
                true => Ok(BodySample { shape, pose }),
                false => Err(unusable(path, &"has a shape or pose that is not finite")),
            }
        });
        Ok(SceneSample {
            garments: self.garments.iter().map(index).collect::<Result<_, _>>()?,
            below: self.below.iter().map(index).collect::<Result<_, _>>()?,
            bodies: bodies.collect::<Result<_, _>>()?,
            repulsion_sample: self.repulsion_sample,
        })
    }
}
