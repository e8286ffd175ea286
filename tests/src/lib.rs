//! Fixtures for the contract tests: the smallest run that is still the real thing.

pub mod objects;

use burn::module::Module;
use clothcombo_model::{ClothCombo, gradient_bucket};
use clothcombo_trainer::config::{Config, OptimizerConfig, Trains, load};
use clothcombo_trainer::dataset::{Dataset, PreparedScene};
use clothcombo_trainer::inference::tensor_store::TensorStore;
use clothcombo_trainer::system::device::default_device;
use clothcombo_trainer::training::learner::{Learner, StepInput, new_optimizer};
use clothcombo_trainer::training::process_group::RankPartition;
use clothcombo_trainer::training::scenes::prepare_step;
use clothcombo_trainer::training::schedule::Schedule;
use std::path::Path;
use std::sync::Arc;

/// A run of a few steps on built-in data: every network, all three stages, up to three layers.
pub const TINY: &str = include_str!("../fixtures/tiny.toml");

/// What the contract tests have otherwise: two bodies per step, the pose filter, a checkpoint every thirty steps, pictures.
const CONTRACTS: [&str; 4] = [
    "stages.0.bodies=2",
    "data.poses.max_self_intersection=0.1",
    "output.checkpoint_every=30",
    "output.sample_scenes=1",
];

/// [`TINY`] as the contract tests have it, with `overrides`, read as a user's file would be.
pub fn tiny_config(folder: &Path, overrides: &[&str]) -> Config {
    let file = folder.join("tiny.toml");
    std::fs::write(&file, TINY).expect("the test folder is writable");
    let overrides: Vec<String> = CONTRACTS.iter().chain(overrides).map(|s| (*s).to_owned()).collect();
    load(&file, &overrides).expect("the fixture is valid")
}

/// Number of cases and seed of a fuzz test: `few` from seed 1, unless `CLOTHCOMBO_FUZZ_CASES` and `CLOTHCOMBO_FUZZ_SEED` ask
/// for others.
pub fn fuzz_cases(few: usize) -> (usize, u64) {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    (number("CLOTHCOMBO_FUZZ_CASES").map_or(few, |n| n as usize), number("CLOTHCOMBO_FUZZ_SEED").unwrap_or(1))
}

/// A run of the [`tiny_config`] that has not begun: its data and untrained networks.
pub struct Untrained {
    /// The configuration.
    pub config: Config,
    /// Body, garments, poses.
    pub dataset: Arc<Dataset>,
    /// Tensors of the garments on the preferred device.
    pub tensors: TensorStore,
    /// The networks, with automatic differentiation.
    pub model: ClothCombo,
}

impl Untrained {
    /// With `overrides` of the configuration; `folder` is for its file.
    pub fn new(folder: &Path, overrides: &[&str]) -> Self {
        let config = tiny_config(folder, overrides);
        let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).expect("built-in data"));
        let device = default_device().autodiff();
        let dimensions = dataset.dimensions();
        let tensors = TensorStore::new(dataset.clone(), dimensions, &device);
        let model = ClothCombo::new(&config.model, &dimensions, config.seed, &device).expect("valid sizes");
        Self { config, dataset, tensors, model }
    }

    /// All scenes of `step`.
    pub fn scenes(&self, step: u64) -> Vec<PreparedScene> {
        self.scenes_with(&self.config, step)
    }

    /// The same with the losses of another configuration.
    pub fn scenes_with(&self, config: &Config, step: u64) -> Vec<PreparedScene> {
        let schedule = Schedule::new(config);
        prepare_step(&self.dataset, config, &schedule, step, RankPartition::WHOLE)
            .expect("garments are there")
    }

    /// The first step from `first` on whose first scene has garments that can touch.
    pub fn step_with_contacts(&self, first: u64) -> u64 {
        let touches = |step: &u64| !self.scenes(*step)[0].contacts.is_empty();
        (first..).find(touches).expect("some outfit has neighbours")
    }

    /// The networks with an optimiser without any state.
    pub fn learner(&self) -> Learner {
        self.learner_with(&self.config.optimizer)
    }

    /// The same with other settings of the optimiser.
    pub fn learner_with(&self, optimizer: &OptimizerConfig) -> Learner {
        Learner::new(self.model.clone(), new_optimizer(optimizer), optimizer)
    }

    /// Loss of `scenes` and its gradient for all parameters, in the order of the networks.
    pub fn loss_and_gradient(&self, scenes: &[PreparedScene], trains: Trains) -> (f64, Vec<f32>) {
        loss_and_gradient(self.learner(), &self.tensors, scenes, trains)
    }
}

/// Loss of `scenes` and its gradient for all parameters, in the order of the networks.
pub fn loss_and_gradient(
    mut learner: Learner,
    tensors: &TensorStore,
    scenes: &[PreparedScene],
    trains: Trains,
) -> (f64, Vec<f32>) {
    let input = StepInput::whole(tensors, scenes, trains);
    let output = learner.forward_backward(&input).expect("the scenes are valid");
    let mut gradient = gradient_bucket(learner.model(), &output.gradients);
    // What comes after tells which parameters have one.
    gradient.truncate(learner.model().num_params());
    (output.loss, gradient)
}
