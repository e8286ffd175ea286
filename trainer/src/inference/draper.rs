//! A trained model with a body, ready to drape.

use super::embedded::EmbeddedGarments;
use super::shape_space::ShapeSpace;
use super::shipped::shipped_model;
use super::source::GarmentCatalog;
use crate::dataset::{ActiveJoints, DatasetError, Preprocessor, SceneBuilder, load_body};
use crate::inference::RefineSteps;
use crate::run::checkpoint::TrainedModel;
use crate::system::device::default_device;
use burn::tensor::Device;
use clothcombo_data::asset::{BODY_JOINT_COUNT, Body};
use clothcombo_model::{ClothCombo, Dimensions};
use clothcombo_physics::contact::resolve::ResolveSettings;
use miette::{Report, miette};
use std::path::{Path, PathBuf};
use std::sync::Arc;

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
        Self {
            body: None,
            cache: None,
            cache_limit: 10 << 30,
            device: default_device(),
            refine: None,
            resolve: true,
            post_process: ResolveSettings::default(),
        }
    }
}

/// A trained model with a body, ready to drape. Clones share both, and the garments they have met.
#[derive(Clone)]
pub struct Draper {
    pub(super) trained: Arc<TrainedModel>,
    pub(super) model: ClothCombo,
    pub(super) preprocessor: Arc<Preprocessor>,
    pub(super) shape_space: Arc<ShapeSpace>,
    pub(super) joints: Arc<ActiveJoints>,
    pub(super) settings: DraperSettings,
    pub(super) embedded: Arc<EmbeddedGarments>,
}

impl Draper {
    /// Loads a model (see [`TrainedModel::open`]; without `model` the shipped one) and its body.
    ///
    /// # Errors
    /// When there is no model, it cannot be read, or the body does not have its joints.
    pub fn load(model: Option<&Path>, settings: &DraperSettings) -> Result<Self, Report> {
        let trained = match model {
            Some(path) => TrainedModel::open(path)?,
            None => shipped_model()?,
        };
        let (body, shape_space) = body_of(&trained, settings.body.as_deref())?;
        let joints = ActiveJoints::named(&body, &trained.state.joints).expect("the body has them by now");
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
    pub fn catalog(&self, folders: &[PathBuf]) -> Result<GarmentCatalog, DatasetError> {
        GarmentCatalog::new(folders, &self.trained.config)
    }

    pub(super) fn dimensions(&self) -> Dimensions {
        self.trained.state.dimensions()
    }

    /// What prepares scenes as the model was trained on them.
    pub(super) fn scene_builder(&self) -> SceneBuilder<'_> {
        let config = &self.trained.config;
        SceneBuilder {
            body: self.body(),
            joints: &self.joints,
            encoding: config.data.poses.encoding,
            losses: &config.losses,
            graph: config.model.graph,
            layer_thickness: config.layer_thickness(),
        }
    }
}

/// Shape components kept of a body whose shape space is not the model's, at least.
const OTHER_COMPONENTS: usize = 16;

/// The body that is dressed, with all joints that the networks know, and what its shape means to them. Joints are known by name:
/// those that the body lacks are at rest, and what hangs on joints that the networks do not know goes to the nearest ancestor
/// ([`ActiveJoints`]).
fn body_of(trained: &TrainedModel, named: Option<&str>) -> Result<(Body, ShapeSpace), Report> {
    let count = trained.state.shape_count;
    let (body, shape_space) = match named {
        None => (model_body(trained)?, ShapeSpace::Own),
        Some(name) => {
            let body = load_body(name, count.max(OTHER_COMPONENTS))?;
            if body.joint_count() < BODY_JOINT_COUNT {
                return Err(DatasetError::few_joints(&body).into());
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
    let body = body.with_joints(&trained.state.joints).map_err(|missing| {
        miette!(
            help = "use the body the model was trained on, or one with joints of the same names",
            "body '{name}' has no joint {}",
            missing.join(", ")
        )
    })?;
    Ok((body, shape_space))
}

/// The body the model was trained on.
fn model_body(trained: &TrainedModel) -> Result<Body, Report> {
    trained.body()?.ok_or_else(|| {
        miette!(
            help = "put it beside the model as body.npz, run from the folder its path is relative to, or pass --body",
            "the model was trained on body {}, which is not there",
            trained.config.data.body
        )
    })
}
