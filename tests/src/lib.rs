//! Fixtures for the contract tests: the smallest run that is still the real thing.

use burn::module::Module;
use clothcombo_model::gradient_bucket;
use clothcombo_trainer::config::{Config, Trains, load};
use clothcombo_trainer::dataset::PreparedScene;
use clothcombo_trainer::inference::networks::TensorStore;
use clothcombo_trainer::training::learner::Learner;
use std::path::Path;

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

/// Loss of `scenes` and its gradient for all parameters, in the order of the networks.
pub fn loss_and_gradient(
    mut learner: Learner,
    tensors: &TensorStore,
    scenes: &[PreparedScene],
    trains: Trains,
) -> (f64, Vec<f32>) {
    let computed =
        learner.compute(tensors, scenes, scenes.len(), trains, false).expect("the scenes are valid");
    let mut gradient = gradient_bucket(learner.model(), &computed.gradients);
    // What comes after tells which parameters have one.
    gradient.truncate(learner.model().num_params());
    (computed.loss, gradient)
}
