//! A step length with Armijo's decrease.

use crate::vec3::is_finite;

/// Armijo: the share of the decrease that the slope at the start predicts. Half of it is what the minimum along the line has.
const DECREASE: f64 = 0.1;

/// Most trials.
const TRIALS: usize = 12;

/// A state of the search.
pub(super) struct SolverState {
    /// Posed positions (m).
    pub positions: Vec<[f64; 3]>,
    /// Weighted sum of all energies there (J).
    pub energy: f64,
    /// Its gradient (N).
    pub gradient: Vec<[f64; 3]>,
}

/// Tries lengths from 1 downwards from a state of `energy` and derivative `slope < 0` along the line. A trial that is
/// too long is followed by the minimum of the parabola through value and slope at the start and the value of the trial,
/// between a tenth and half of its length. Returns step length and state; `None` if no trial had the decrease.
pub(super) fn search(
    energy: f64,
    slope: f64,
    mut evaluate: impl FnMut(f64) -> SolverState,
) -> Option<(f64, SolverState)> {
    let mut length = 1.0;
    for _ in 0..TRIALS {
        let trial = evaluate(length);
        // Written so that NaN is too far; the second condition keeps the energy falling where the product rounds to nothing.
        if trial.energy <= energy + DECREASE * length * slope && trial.energy < energy {
            return trial.gradient.iter().all(|g| is_finite(*g)).then_some((length, trial));
        }
        let parabola = -0.5 * slope * length * length / (trial.energy - energy - slope * length);
        length = match parabola.is_finite() {
            true => parabola.clamp(0.1 * length, 0.5 * length),
            false => 0.5 * length,
        };
    }
    None
}
