//! A trained model with the data it is evaluated on.

use crate::config::Config;
use crate::dataset::{
    Dataset, DatasetError, HeldOut, PreparedScene, SceneSample, prepare, sample_evaluation,
};
use crate::inference::networks::Networks;
use crate::inference::tensor_store::TensorStore;
use crate::picture::chart::axis::number_text;
use crate::run::checkpoint::TrainedModel;
use burn::tensor::Device;
use clothcombo_model::ClothCombo;
use clothcombo_physics::energy::Term;
use miette::Report;
use std::sync::Arc;

/// A trained model, its configuration and its data.
pub struct ModelUnderTest {
    /// Losses, data and seed.
    pub config: Config,
    /// The data.
    pub dataset: Arc<Dataset>,
    /// Its tensors.
    pub tensors: TensorStore,
    /// The networks, without automatic differentiation.
    pub model: ClothCombo,
}

impl ModelUnderTest {
    /// `trained` on `dataset`, which was loaded for `config`.
    ///
    /// # Errors
    /// When the data is not that of the model, or its parameters cannot be read.
    pub fn new(
        trained: &TrainedModel,
        config: Config,
        dataset: Arc<Dataset>,
        device: &Device,
    ) -> Result<Self, Report> {
        trained.check_data(&config, &dataset)?;
        let tensors = TensorStore::new(dataset.clone(), trained.state.dimensions(), device);
        Ok(Self { model: trained.networks(device)?, config, dataset, tensors })
    }

    /// The networks ready to drape.
    pub fn networks(&self) -> Networks<'_> {
        Networks::new(self.model.clone(), &self.tensors)
    }

    /// Weight and margin of one of the collisions in the configuration, as columns call it.
    pub fn collision_form(&self, term: Term) -> String {
        let losses = &self.config.losses;
        let settings = losses.energy_settings();
        let epsilon = match term {
            Term::LayerCollision => settings.layer_collision_epsilon,
            _ => settings.body_collision_epsilon,
        };
        let scale = match losses.reference_vertices {
            vertices if vertices > 0.0 => format!(" · {vertices}/N"),
            _ => String::new(),
        };
        format!("as trained: {}{scale}, ε {} mm", losses.weight(term).at(1.0), number_text(1e3 * epsilon, 3))
    }

    /// All garments of the dataset, by their indices.
    pub fn garments(&self) -> Vec<usize> {
        (0..self.dataset.garments.len()).collect()
    }

    /// Names of garments.
    pub fn names(&self, garments: &[usize]) -> Vec<String> {
        garments.iter().map(|&garment| self.dataset.garments.info(garment).name.clone()).collect()
    }

    /// Scene `index` of random stream `stream` (`at`), sampled as [`sample_evaluation`] says.
    pub fn sample(&self, at: [usize; 2], pool: &[usize], layers: usize, poses: HeldOut) -> SceneSample {
        sample_evaluation(&self.dataset, self.config.validation_seed(), at, pool, layers, poses)
    }

    /// The same of garments of all sets, in a held-out window.
    pub fn sample_outfit(&self, at: [usize; 2], layers: usize) -> SceneSample {
        self.sample(at, &self.garments(), layers, HeldOut::Windows)
    }

    /// Prepares a scene, losses with the weights they end with.
    ///
    /// # Errors
    /// When a garment cannot be read.
    pub fn prepare(&self, sample: &SceneSample) -> Result<PreparedScene, DatasetError> {
        prepare(&self.dataset, &self.config.losses, sample.clone(), 1.0)
    }
}
