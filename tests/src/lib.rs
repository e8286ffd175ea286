//! Fixtures for the contract tests: the smallest run that is still the real thing.

use clothcombo_trainer::config::{Config, load};
use std::path::Path;

/// A run of a few steps on built-in data: every network, all three stages, up to three layers.
pub const TINY: &str = r#"
seed = 3
[data]
body = "mannequin"
[[data.garments]]
generate = { count = 3, seed = 5, vertices = 200, categories = ["t_shirt", "trousers", "skirt"] }
[model]
width = 16
embedding = 16
diffusion_blocks = 2
diffusion_width = 16
eigen_count = 12
mlp_layers = 4
siren_layers = 3
siren_width = 16
skinning_layers = 2
skinning_width = 16
[[stages]]
name = "single"
trains = "single"
steps = 20
scenes_per_step = 2
learning_rate = 1e-3
pose_scale = { from = 0.0, to = 1.0, start = 0.0, end = 0.5 }
[[stages]]
name = "untangling"
trains = "untangling"
steps = 20
layers = [2, 3]
learning_rate = 1e-3
[[stages]]
name = "all"
trains = "all"
steps = 20
layers = [1, 3]
learning_rate = 1e-4
[validation]
single_scenes = 2
layered_scenes = 2
layers = [2, 3]
[output]
checkpoint_every = 30
sample_scenes = 1
"#;

/// [`TINY`] with `overrides`, read as a user's file would be.
pub fn tiny_config(folder: &Path, overrides: &[&str]) -> Config {
    let file = folder.join("tiny.toml");
    std::fs::write(&file, TINY).expect("the test folder is writable");
    let overrides: Vec<String> = overrides.iter().map(|s| (*s).to_owned()).collect();
    load(&file, &overrides).expect("the fixture is valid")
}

/// Number of cases and seed of a fuzz test: `few` from seed 1, unless `CLOTHCOMBO_FUZZ_CASES` and `CLOTHCOMBO_FUZZ_SEED` ask
/// for others.
pub fn fuzz_cases(few: usize) -> (usize, u64) {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    (number("CLOTHCOMBO_FUZZ_CASES").map_or(few, |n| n as usize), number("CLOTHCOMBO_FUZZ_SEED").unwrap_or(1))
}
