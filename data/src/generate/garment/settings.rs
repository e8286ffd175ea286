//! How garments are generated, and why one was not.

use crate::asset::Category;
use thiserror::Error;

/// How garments are generated.
#[derive(Debug, Clone, PartialEq)]
pub struct GarmentSettings {
    /// Vertices a garment has about, from 200 to 50,000. Default 1,200.
    pub target_vertices: usize,
    /// Relative spread of the number of vertices over seeds, 0–0.5. Default 0.25.
    pub resolution_spread: f64,
    /// Least distance between cloth and skin at rest (m). Default 5 mm.
    pub clearance: f64,
    /// Relative variation of the edge length within a garment, 0–0.25. Default 0.15: the triangulation is
    /// irregular, so that a network cannot learn it.
    pub sizing_variation: f64,
    /// Designs tried before giving up on a seed. Default 12.
    pub attempts: usize,
}

impl Default for GarmentSettings {
    fn default() -> Self {
        Self {
            target_vertices: 1200,
            resolution_spread: 0.25,
            clearance: 0.005,
            sizing_variation: 0.15,
            attempts: 12,
        }
    }
}

impl GarmentSettings {
    /// Whether every setting is in its range.
    ///
    /// # Errors
    /// [`GarmentError::Setting`] names the first that is not.
    pub fn check(&self) -> Result<(), GarmentError> {
        let fail = |setting, value: String, expected| Err(GarmentError::Setting { setting, value, expected });
        if !(200..=50_000).contains(&self.target_vertices) {
            return fail("target_vertices", self.target_vertices.to_string(), "200 to 50000");
        }
        if !(0.0..=0.5).contains(&self.resolution_spread) {
            return fail("resolution_spread", self.resolution_spread.to_string(), "0 to 0.5");
        }
        if !(0.003..=0.05).contains(&self.clearance) {
            return fail("clearance", self.clearance.to_string(), "0.003 to 0.05 (metres)");
        }
        if !(0.0..=0.25).contains(&self.sizing_variation) {
            return fail("sizing_variation", self.sizing_variation.to_string(), "0 to 0.25");
        }
        if !(1..=1000).contains(&self.attempts) {
            return fail("attempts", self.attempts.to_string(), "1 to 1000");
        }
        Ok(())
    }
}

/// Why no garment was generated.
#[derive(Debug, Error)]
pub enum GarmentError {
    /// The body is no T-posed human body with the SMPL joints.
    #[error("cannot cut garments for body '{body}': {reason}")]
    UnsuitableBody {
        /// Body name.
        body: String,
        /// What does not fit.
        reason: String,
    },
    /// A setting is out of range.
    #[error("garment generator: {setting} is {value}, expected {expected}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        expected: &'static str,
    },
    /// No design of this seed passed the checks.
    #[error(
        "no {category} for seed {seed} passed the checks in {attempts} designs; the last one {last}; \
         hint: use another seed, or more vertices if the garment has narrow parts"
    )]
    Exhausted {
        /// Wanted category.
        category: Category,
        /// Seed.
        seed: u64,
        /// How many designs were tried.
        attempts: usize,
        /// What was wrong with the last.
        last: String,
    },
}
