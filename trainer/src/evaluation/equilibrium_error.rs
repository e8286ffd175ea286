//! How far a state is from the equilibrium of its scene: energy above the minimum, and distance to the minimiser.

use clothcombo_physics::equilibrium::Solution;
use serde::Serialize;

/// How far a state is from the minimum.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct StateError {
    /// Weighted sum of all energies (J).
    pub energy: f64,
    /// Above the minimum (J).
    pub excess: f64,
    /// The same in percent of what a baseline has above it.
    pub excess_percent: f64,
    /// Mean distance of the vertices to the minimiser (mm).
    pub distance_mm: f64,
}

impl StateError {
    /// Of `positions` with `energy`; the baseline has `baseline_excess` above `minimum`.
    pub fn new(energy: f64, positions: &[[f64; 3]], minimum: &Solution, baseline_excess: f64) -> Self {
        let excess = energy - minimum.energy();
        Self {
            energy,
            excess,
            excess_percent: if baseline_excess > 0.0 { 100.0 * excess / baseline_excess } else { 0.0 },
            distance_mm: 1e3 * mean_distance(positions, &minimum.positions),
        }
    }
}

/// Mean distance of two states of the same vertices (m).
pub fn mean_distance(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let sum: f64 =
        a.iter().zip(b).map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()).sum();
    sum / a.len().max(1) as f64
}
