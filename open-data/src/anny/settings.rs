//! How the body model is learned.

/// How the body model is learned from random people.
#[derive(Clone, Debug, PartialEq)]
pub struct AnnySettings {
    /// Number of random adults.
    pub people: usize,
    /// Number of shape components kept.
    pub shape_components: usize,
    /// Seed of the random adults.
    pub seed: u64,
}

impl Default for AnnySettings {
    fn default() -> Self {
        Self { people: 300, shape_components: 16, seed: 0 }
    }
}
