//! The wardrobe of a run: body, garments with everything precomputed, poses.

use super::active_joints::ActiveJoints;
use super::poses::PoseLibrary;
use crate::config::{Config, GarmentSource};
use clothcombo_data::asset::{BODY_JOINT_COUNT, Binding, BindingSettings, Body, BodyFileSettings, Garment};
use clothcombo_data::dataset::load_garment_folder;
use clothcombo_data::generate::{GarmentGenerator, GarmentSettings, mannequin};
use clothcombo_physics::energy::GarmentEnergies;
use clothcombo_physics::mesh::{Topology, TriMesh};
use clothcombo_physics::operators::SurfaceOperators;
use miette::Diagnostic;
use rayon::prelude::*;
use std::error::Error as StdError;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use thiserror::Error;

/// Why the data of a run cannot be used.
#[derive(Debug, Error, Diagnostic)]
pub enum LibraryError {
    /// A file is missing or wrong; the message names it and says how to mend it.
    #[error("{0}")]
    Data(String),
    /// A garment cannot be prepared.
    #[error("garment {name}: {reason}")]
    #[diagnostic(help("`clothcombo check` lists every defect of a garment file"))]
    Garment {
        /// Its name.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// A garment is over the configured limit.
    #[error("garment {name} has {vertices} vertices, more than data.max_vertices = {limit}")]
    #[diagnostic(help("raise data.max_vertices (memory grows with it), or decimate the garment"))]
    TooLarge {
        /// Its name.
        name: String,
        /// Its vertex count.
        vertices: usize,
        /// The limit.
        limit: usize,
    },
    /// Nothing is left to train on.
    #[error("all {0} garments are held out, none is left to train on")]
    #[diagnostic(help("shorten data.held_out_garments"))]
    AllHeldOut(usize),
    /// A held-out name fits no garment.
    #[error("data.held_out_garments names {name:?}, which is no garment of this run")]
    #[diagnostic(help("the garments are: {available}"))]
    UnknownHeldOut {
        /// The name.
        name: String,
        /// The existing names.
        available: String,
    },
    /// One side of the pose split is empty.
    #[error("{}: {train} frames to train on and {held_out} held out", folder.display())]
    #[diagnostic(help(
        "both must be positive: change data.poses.held_out_clips, held_out_share or held_out_block"
    ))]
    EmptySplit {
        /// The motion folder.
        folder: PathBuf,
        /// Training frames.
        train: usize,
        /// Held-out frames.
        held_out: usize,
    },
    /// The skeleton is too small for the poses.
    #[error("body {name} has {joints} joints, poses turn the {BODY_JOINT_COUNT} body joints of SMPL")]
    #[diagnostic(help(
        "use a body whose first joints are SMPL's: SMPL, SMPL-H, SMPL-X, or one imported by `clothcombo import`"
    ))]
    FewJoints {
        /// The body.
        name: String,
        /// Its joints.
        joints: usize,
    },
    /// More shape components are asked for than the body has.
    #[error("data.shape_components = {asked}, but the body has {available}")]
    #[diagnostic(help("use 0 to take all the body has"))]
    ShapeComponents {
        /// Asked for.
        asked: usize,
        /// Present.
        available: usize,
    },
}

impl LibraryError {
    /// Wraps an error of the data crate, whose message already names file and mend; causes are appended.
    pub(crate) fn data(error: impl StdError) -> Self {
        let mut text = error.to_string();
        let mut source = error.source();
        while let Some(cause) = source {
            let cause_text = cause.to_string();
            if !text.contains(&cause_text) {
                text = format!("{text}: {cause_text}");
            }
            source = cause.source();
        }
        LibraryError::Data(text)
    }
}

/// A garment with everything that does not change during training.
pub struct LibraryGarment {
    /// Rest mesh, category, provenance.
    pub garment: Garment,
    /// DiffusionNet's operators.
    pub operators: SurfaceOperators,
    /// Constants of its energies.
    pub energies: Arc<GarmentEnergies<f32>>,
    /// Initial skin weights of the active joints, `[V, J]`.
    pub skin_weights: Vec<f32>,
    /// 1 for each active joint that carries the garment, `[J]`.
    pub joint_mask: Vec<f32>,
    /// Shape displacement per unit β, `[V, 3, K]`; zero without shape transfer.
    pub shape_directions: Vec<f32>,
    /// Number of shape components K stored in `shape_directions`.
    pub shape_stride: usize,
}

impl LibraryGarment {
    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.garment.rest.vertex_count()
    }

    /// Where the garment starts on a body of shape β: rest positions plus the transferred shape displacement.
    pub fn start_positions(&self, shape: &[f64]) -> Vec<[f32; 3]> {
        let k = self.shape_stride;
        let directions = &self.shape_directions;
        self.garment
            .rest
            .positions()
            .par_iter()
            .enumerate()
            .with_min_len(512)
            .map(|(v, p)| {
                std::array::from_fn(|axis| {
                    let row = &directions[(3 * v + axis) * k..(3 * v + axis + 1) * k];
                    let moved: f64 = row.iter().zip(shape).map(|(d, b)| f64::from(*d) * b).sum();
                    (p[axis] + moved) as f32
                })
            })
            .collect()
    }
}

/// The wardrobe.
pub struct Library {
    /// The body model.
    pub body: Arc<Body>,
    /// All garments, in source order.
    pub garments: Vec<LibraryGarment>,
    /// Indices of the garments that are trained on.
    pub training: Vec<usize>,
    /// Indices of the garments that are held out.
    pub held_out: Vec<usize>,
    /// Joints the networks see.
    pub joints: ActiveJoints,
    /// Poses.
    pub poses: PoseLibrary,
    /// Shape components drawn.
    pub shape_count: usize,
    /// Range every component is drawn from.
    pub shape_range: [f64; 2],
}

/// Reads `"mannequin"` or a body npz with at most `shape_components` components (0: all it has).
///
/// # Errors
/// When the file is not a body model.
pub fn load_body(name: &str, shape_components: usize) -> Result<Body, LibraryError> {
    let settings = match shape_components {
        0 => BodyFileSettings { shape_components: usize::MAX },
        limit => BodyFileSettings { shape_components: limit },
    };
    match name {
        "mannequin" => Ok(mannequin()),
        path => Body::load(Path::new(path), &settings).map_err(LibraryError::data),
    }
}

impl Library {
    /// Loads and prepares everything `config` names. `progress(done, total, name)` is called per garment.
    ///
    /// # Errors
    /// [`LibraryError`] names the file or garment at fault.
    pub fn load(
        config: &Config,
        progress: &(dyn Fn(usize, usize, &str) + Sync),
    ) -> Result<Self, LibraryError> {
        let body = Arc::new(load_body(&config.data.body, config.data.shape_components)?);
        let mut garments = Vec::new();
        for source in &config.data.garments {
            garments.extend(read_source(source, &body)?);
        }
        Self::from_garments(config, body, garments, progress)
    }

    /// Prepares `garments` on `body` as `config` says.
    ///
    /// # Errors
    /// As [`Library::load`].
    pub fn from_garments(
        config: &Config,
        body: Arc<Body>,
        garments: Vec<Garment>,
        progress: &(dyn Fn(usize, usize, &str) + Sync),
    ) -> Result<Self, LibraryError> {
        if body.joint_count() < BODY_JOINT_COUNT {
            return Err(LibraryError::FewJoints { name: body.name.clone(), joints: body.joint_count() });
        }
        let limit = config.data.max_vertices;
        if let Some(g) = garments.iter().find(|g| g.rest.vertex_count() > limit) {
            let vertices = g.rest.vertex_count();
            return Err(LibraryError::TooLarge { name: g.name.clone(), vertices, limit });
        }
        let shape_count = match config.data.shape_components {
            0 => body.shape_count,
            asked if asked <= body.shape_count => asked,
            asked => return Err(LibraryError::ShapeComponents { asked, available: body.shape_count }),
        };
        let poses = PoseLibrary::new(&config.data.poses, &body)?;
        let (training, held_out) = split(&garments, &config.data.held_out_garments)?;

        let start = &config.start;
        let settings = BindingSettings {
            smoothing_iterations: start.smoothing_iterations,
            skirt_smoothing_iterations: start.skirt_smoothing_iterations,
            smooth: start.smooth_weights,
            shape_transfer: start.shape_transfer,
        };
        let bindings: Vec<Binding> = garments.par_iter().map(|g| Binding::new(g, &body, &settings)).collect();
        let joints = ActiveJoints::new(&body, &bindings);

        let done = AtomicUsize::new(0);
        let total = garments.len();
        let prepared = garments
            .into_par_iter()
            .zip(bindings)
            .map(|(garment, binding)| {
                let named = |reason: String| LibraryError::Garment { name: garment.name.clone(), reason };
                let operators = SurfaceOperators::new(&garment.rest, config.model.eigen_count)
                    .map_err(|e| named(e.to_string()))?;
                let topology = Topology::new(&garment.rest);
                let energies = GarmentEnergies::new(
                    &garment.rest,
                    &topology,
                    &config.losses.energy_settings(),
                    garment.holding,
                )
                .map_err(|e| named(e.to_string()))?;
                progress(done.fetch_add(1, Ordering::Relaxed) + 1, total, &garment.name);
                let skin_weights = joints.restrict(&binding.skin_weights);
                Ok(LibraryGarment {
                    joint_mask: joints.mask(&skin_weights),
                    skin_weights,
                    shape_stride: body.shape_count,
                    shape_directions: binding.shape_directions,
                    operators,
                    energies: Arc::new(energies),
                    garment,
                })
            })
            .collect::<Result<Vec<_>, LibraryError>>()?;
        Ok(Self {
            body,
            garments: prepared,
            training,
            held_out,
            joints,
            poses,
            shape_count,
            shape_range: config.data.shape_range,
        })
    }

    /// Rest meshes of `garments`.
    pub fn rest_meshes(&self, garments: &[usize]) -> Vec<&TriMesh> {
        garments.iter().map(|&g| &self.garments[g].garment.rest).collect()
    }
}

fn read_source(source: &GarmentSource, body: &Body) -> Result<Vec<Garment>, LibraryError> {
    if let Some(folder) = &source.folder {
        let garments = load_garment_folder(folder, body).map_err(LibraryError::data)?;
        return Ok(garments.into_iter().map(|g| g.garment).collect());
    }
    let Some(generate) = &source.generate else { return Ok(Vec::new()) };
    let settings = GarmentSettings { target_vertices: generate.vertices, ..GarmentSettings::default() };
    let generator = GarmentGenerator::new(body).map_err(LibraryError::data)?;
    (0..generate.count)
        .into_par_iter()
        .map(|i| {
            let category = generate.categories[i % generate.categories.len()];
            let seed = generate.seed.wrapping_add(i as u64);
            generator.generate(category, seed, &settings).map_err(LibraryError::data)
        })
        .collect()
}

fn split(garments: &[Garment], held_out: &[String]) -> Result<(Vec<usize>, Vec<usize>), LibraryError> {
    if let Some(name) = held_out.iter().find(|n| !garments.iter().any(|g| &g.name == *n)) {
        let available = garments.iter().map(|g| g.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(LibraryError::UnknownHeldOut { name: name.clone(), available });
    }
    let (out, train): (Vec<usize>, Vec<usize>) =
        (0..garments.len()).partition(|&i| held_out.contains(&garments[i].name));
    if train.is_empty() {
        return Err(LibraryError::AllHeldOut(garments.len()));
    }
    Ok((train, out))
}
