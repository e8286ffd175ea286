//! Inference. In: a trained model, any garments in their order, any body. Out: draped garments, with a certificate of what still
//! intersects.
//!
//! ```no_run
//! use clothcombo_data::asset::Pose;
//! use clothcombo_data::fit::FitSettings;
//! use clothcombo_trainer::inference::{BodyState, Draper, DraperSettings};
//! use std::path::Path;
//!
//! let draper = Draper::load(Some(Path::new("runs/smoke")), &DraperSettings::default())?;
//! let catalog = draper.catalog(&[])?;
//! let hints = FitSettings::default();
//! let garments = ["t_shirt_000003", "skirt_000005"].map(|name| catalog.find(name, draper.body(), None, &hints));
//! let outfit = draper.outfit(garments.into_iter().collect::<Result<_, _>>()?)?;
//! let drape = draper.drape(&outfit, &BodyState::new(vec![1.0, -0.5], Pose::t_pose(22)))?;
//! for (garment, draped) in outfit.garments.iter().zip(&drape.garments) {
//!     println!("{}: {} vertices", garment.name, draped.positions.len());
//! }
//! # Ok::<(), clothcombo_trainer::inference::DraperError>(())
//! ```
//!
//! [`Draper::outfit`] does what depends on the garments alone (binding, operators, embedding), once per garment and process,
//! and once per machine with a cache; [`Draper::drape`] does what depends on the body: networks, post-process,
//! refinement; [`Draper::drape_motion`] does it for the frames of a motion. The networks see the pose without its heading;
//! positions come back in the frame of the given pose.

mod acceleration;
mod acceptance;
mod bodies;
pub mod descent;
mod drape;
pub(crate) mod draped;
mod embedded;
mod error;
mod frame;
pub mod layer_interaction;
mod motion;
mod names;
mod network_drape;
pub mod networks;
pub mod on_body;
mod outfit;
pub mod output;
mod phase_times;
pub mod reference;
mod refine;
mod report;
mod shape_space;
mod shipped;
mod smooth;
mod source;
mod temporal_filter;
pub mod tensor_store;
mod warnings;

pub use acceleration::{Acceleration, acceleration};
pub use bodies::{Bodies, BodyReport, FrameRange, Moment, file_and_frame, read_pose};
pub use clothcombo_physics::contact::resolve::Certificate;
pub use drape::{Drape, GarmentDrape};
pub use draped::Draped;
pub use embedded::GarmentTimes;
pub use error::DraperError;
pub use motion::DrapeProgress;
pub use names::UniqueNames;
pub use outfit::{MAX_GARMENTS, MAX_VERTICES, Outfit, OutfitGarment};
pub use phase_times::PhaseTimes;
pub use refine::{RefineSteps, Refinement, refine};
pub use report::{DrapedGarmentReport, FrameReport, ModelReport, Report, ScoredPositions};
pub use shipped::shipped_model;
pub use smooth::{MOST_RADIUS, Smoothing, smooth};
pub use source::{GarmentCatalog, GivenGarment};
pub use warnings::{log_repairs, warn_about_order};

use crate::dataset::{ActiveJoints, DatasetError, Preprocessor, load_body};
use crate::run::checkpoint::TrainedModel;
use crate::system::device::default_device;
use burn::tensor::Device;
use clothcombo_data::asset::{BODY_JOINT_COUNT, Body, Pose};
use clothcombo_model::ClothCombo;
use clothcombo_physics::contact::resolve::ResolveSettings;
use embedded::EmbeddedGarments;
use frame::Frame;
use shape_space::ShapeSpace;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// How a [`Draper`] is set up.
#[derive(Clone, Debug)]
pub struct DraperSettings {
    /// `"mannequin"` or a body npz; default: the body the model was trained on.
    pub body: Option<String>,
    /// Folder of the on-disk cache of bindings, operators and embeddings; none computes them anew in every process.
    pub cache: Option<PathBuf>,
    /// Largest size of the cache (bytes).
    pub cache_limit: u64,
    /// The compute device, without automatic differentiation.
    pub device: Device,
    /// Steps of the static solver after networks and post-process, 0 for none; default: [`RefineSteps::default_of`].
    pub refine: Option<RefineSteps>,
    /// Whether the post-process resolves what still intersects.
    pub resolve: bool,
    /// How it does that.
    pub post_process: ResolveSettings,
}

impl Default for DraperSettings {
    fn default() -> Self {
        let post_process = ResolveSettings::default();
        Self {
            body: None,
            cache: None,
            cache_limit: 10 << 30,
            device: default_device(),
            refine: None,
            resolve: true,
            post_process,
        }
    }
}

/// A body to be dressed.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyState {
    /// Shape parameters β; missing ones are 0.
    pub shape: Vec<f64>,
    /// Pose θ.
    pub pose: Pose,
    /// The posed surface `[V, 3]` (m) that counts for contact, where it is known better than by shape and pose: a scan, or
    /// another program's correctives.
    pub surface: Option<Vec<[f64; 3]>>,
    /// Where its pelvis stands (m); `surface` is there already.
    pub place: [f64; 3],
}

impl BodyState {
    /// The body model's own surface at this shape and pose.
    pub fn new(shape: Vec<f64>, pose: Pose) -> Self {
        Self { shape, pose, surface: None, place: [0.0; 3] }
    }
}

/// A trained model with a body, ready to drape. Clones share both, and the garments they have met.
#[derive(Clone)]
pub struct Draper {
    trained: Arc<TrainedModel>,
    model: ClothCombo,
    preprocessor: Arc<Preprocessor>,
    shape_space: Arc<ShapeSpace>,
    joints: Arc<ActiveJoints>,
    settings: DraperSettings,
    embedded: Arc<EmbeddedGarments>,
}

impl Draper {
    /// Loads a model (see [`TrainedModel::open`]; without `model` the shipped one) and its body.
    ///
    /// # Errors
    /// When there is no model, it cannot be read, or the body does not have its joints.
    pub fn load(model: Option<&Path>, settings: &DraperSettings) -> Result<Self, DraperError> {
        let trained = match model {
            Some(path) => TrainedModel::open(path)?,
            None => shipped_model()?,
        };
        let (body, shape_space) = body_of(&trained, settings.body.as_deref())?;
        let joints = ActiveJoints::named(&body, &trained.state.joints)
            .map_err(|missing| DraperError::Joints { body: body.name.clone(), missing })?;
        let model = trained.networks(&settings.device)?;
        let mut preprocessor = Preprocessor::new(&trained.config, Arc::new(body));
        if let Some(folder) = &settings.cache {
            preprocessor = preprocessor.with_cache_in(folder, settings.cache_limit);
        }
        Ok(Self {
            trained: Arc::new(trained),
            model,
            preprocessor: Arc::new(preprocessor),
            shape_space: Arc::new(shape_space),
            joints: Arc::new(joints),
            settings: settings.clone(),
            embedded: Arc::default(),
        })
    }

    /// The same model and body with the refinement and post-process of `settings`; body, cache and device stay.
    pub fn with(&self, settings: &DraperSettings) -> Self {
        let DraperSettings { refine, resolve, post_process, .. } = settings.clone();
        Self {
            settings: DraperSettings { refine, resolve, post_process, ..self.settings.clone() },
            ..self.clone()
        }
    }

    /// The body model.
    pub fn body(&self) -> &Body {
        &self.preprocessor.body
    }

    /// The trained model.
    pub fn trained(&self) -> &TrainedModel {
        &self.trained
    }

    /// How it was set up.
    pub fn settings(&self) -> &DraperSettings {
        &self.settings
    }

    /// Garments by name: those of `folders`, and those the model was trained on as far as they are there.
    ///
    /// # Errors
    /// When a folder cannot be listed.
    pub fn catalog(&self, folders: &[PathBuf]) -> Result<GarmentCatalog, DraperError> {
        GarmentCatalog::new(folders, &self.trained.config)
    }

    /// Prepares and embeds garments, innermost first. A garment this draper has met before, by content, costs nothing.
    ///
    /// # Errors
    /// For more garments than an outfit may have, or one that cannot be prepared.
    pub fn outfit(&self, garments: Vec<GivenGarment>) -> Result<Outfit, DraperError> {
        Outfit::check(&garments)?;
        let embedded = garments.iter().map(|source| self.embedded.get(self, source));
        let embedded = embedded.collect::<Result<_, _>>()?;
        Outfit::new(self, garments, embedded)
    }

    /// Drapes `outfit` on `body`.
    ///
    /// # Errors
    /// When shape or pose do not fit the body model, or the networks diverge.
    pub fn drape(&self, outfit: &Outfit, body: &BodyState) -> Result<Drape, DraperError> {
        let made = self.network_drape(outfit, body)?;
        let refine = self.refine_steps(1);
        self.drape_frame(outfit, Frame { body, refine, last: None }, made, &mut |_| ())
    }

    fn dimensions(&self) -> clothcombo_model::Dimensions {
        self.trained.state.dimensions()
    }
}

/// Shape components kept of a body whose shape space is not the model's, at least.
const OTHER_COMPONENTS: usize = 16;

/// The body that is dressed, with all joints that the networks know, and what its shape means to them. Joints are known by name:
/// those that the body lacks are at rest, and what hangs on joints that the networks do not know goes to the nearest ancestor
/// ([`ActiveJoints`]).
fn body_of(trained: &TrainedModel, named: Option<&str>) -> Result<(Body, ShapeSpace), DraperError> {
    let count = trained.state.shape_count;
    let (body, shape_space) = match named {
        None => (model_body(trained)?, ShapeSpace::Own),
        Some(name) => {
            let body = load_body(name, count.max(OTHER_COMPONENTS))?;
            if body.joint_count() < BODY_JOINT_COUNT {
                return Err(
                    DatasetError::FewJoints { name: body.name.clone(), joints: body.joint_count() }.into()
                );
            }
            let model_body = model_body(trained).ok();
            match ShapeSpace::new(&body, model_body, trained.config.data.shape_range) {
                // Of its own body the networks know so many components.
                ShapeSpace::Own => (body.with_shape_components(count), ShapeSpace::Own),
                other => (body, other),
            }
        }
    };
    let name = body.name.clone();
    let body = body
        .with_joints(&trained.state.joints)
        .map_err(|missing| DraperError::Joints { body: name, missing })?;
    Ok((body, shape_space))
}

/// The body the model was trained on.
fn model_body(trained: &TrainedModel) -> Result<Body, DraperError> {
    trained.body()?.ok_or_else(|| DraperError::NoBody { body: trained.config.data.body.clone() })
}

fn elapsed(clock: Instant) -> f64 {
    1e3 * clock.elapsed().as_secs_f64()
}
