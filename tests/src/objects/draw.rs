//! Random numbers of one object.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The source of one object's proportions.
pub(super) struct Draw {
    rng: ChaCha8Rng,
    /// How many triangles it has, roughly.
    pub triangles: usize,
}

impl Draw {
    /// For object `number` of `seed`.
    pub fn new(seed: u64, number: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(number);
        // Coarse meshes are as frequent as fine ones.
        let triangles = rng.random_range(250f64.ln()..3600f64.ln()).exp() as usize;
        Self { rng, triangles }
    }

    /// A number from `low` to `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.rng.random::<f64>()
    }

    /// An integer from `low` to below `high`.
    pub fn range(&mut self, low: usize, high: usize) -> usize {
        self.rng.random_range(low..high)
    }

    /// Whether something of this probability happens.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.rng.random::<f64>() < probability
    }

    /// One of several.
    pub fn any<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.range(0, choices.len())]
    }

    /// −1 or 1.
    pub fn sign(&mut self) -> f64 {
        self.any(&[-1.0, 1.0])
    }
}
