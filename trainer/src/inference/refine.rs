//! Steps of the static solver from the networks' state, for users who trade time for accuracy.

use super::error::DraperError;
use clothcombo_physics::energy::SceneEnergy;
use clothcombo_physics::equilibrium::{Problem, SolverSettings, solve};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// No vertex moves farther than this in one step [m]: less than the thickness of a limb, so that no vertex passes through
/// one.
const STEP_BOUND: f64 = 0.005;
/// Refinement ends where a vertex has come farther than this from where the networks left it (m).
const REACH: f64 = 0.05;

/// What the refinement did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Refinement {
    /// Accepted steps.
    pub steps: usize,
    /// Why it stopped.
    pub stop: String,
    /// Weighted sum of all energies before (J).
    pub energy_before: f64,
    /// And after (J); never more.
    pub energy_after: f64,
    /// Farthest displacement of a vertex (mm).
    pub largest_move_mm: f64,
}

/// Lowers `energy` from `start` `[ΣV, 3]` (m) for at most `steps` steps.
///
/// # Errors
/// When the energy at the start is not finite.
pub fn refine(
    energy: &SceneEnergy<f64>,
    start: &[[f64; 3]],
    steps: usize,
) -> Result<(Vec<[f64; 3]>, Refinement), DraperError> {
    let settings = SolverSettings {
        iterations: steps,
        step_bound: STEP_BOUND,
        escape_distance: Some(REACH),
        ..SolverSettings::default()
    };
    let problem = Problem::new(energy)?;
    let solution = solve(&problem, start, &settings, &mut |_| ControlFlow::Continue(()))?;
    let moved = solution
        .positions
        .iter()
        .zip(start)
        .map(|(p, q)| (0..3).map(|a| (p[a] - q[a]).powi(2)).sum::<f64>().sqrt());
    let done = Refinement {
        steps: solution.iterations(),
        stop: solution.stop.name().to_owned(),
        energy_before: solution.history[0].energy,
        energy_after: solution.energy(),
        largest_move_mm: 1e3 * moved.fold(0.0, f64::max),
    };
    Ok((solution.positions, done))
}
