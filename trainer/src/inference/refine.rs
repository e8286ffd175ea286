//! Steps of the static solver that make no intersection and lower the energy that networks and post-process leave.

use clothcombo_physics::energy::SceneEnergy;
use clothcombo_physics::equilibrium::{EquilibriumError, Problem, SolverSettings, Stop, solve};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::str::FromStr;
use std::time::Duration;

/// No vertex moves farther than this in one step (m): about as far as the faces of the body near it stay the same.
const STEP_BOUND: f64 = 0.02;
/// With [`RefineSteps::Auto`], refinement ends with a step that lowers the energy by less than this share of all steps together…
const LEAST_REFINE_GAIN: f64 = 0.01;
/// …or after this time.
const MOST_TIME: Duration = Duration::from_secs(2);
/// Refinement ends where a vertex has come farther than this from where it began (m).
const FARTHEST_MOVE: f64 = 0.05;
/// What a step leaves between the elements of triangles (m): a twentieth of the post-process's gap.
const LEFT_BETWEEN: f64 = 5e-5;

/// How many steps a refinement takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefineSteps {
    /// At most so many; 0: no refinement.
    AtMost(usize),
    /// Until a step lowers the energy by less than 1 % of what all did together, or two seconds are over.
    Auto,
}

/// Most steps that are taken: far more than gain anything.
const MOST_REFINE_STEPS: usize = 1000;

impl RefineSteps {
    /// At most so many, if that is a number of steps that is worth asking for.
    ///
    /// # Errors
    /// For more than 1000, in words.
    pub fn at_most(steps: usize) -> Result<Self, String> {
        match steps <= MOST_REFINE_STEPS {
            true => Ok(Self::AtMost(steps)),
            false => Err(format!("it must be at most {MOST_REFINE_STEPS} steps, or auto")),
        }
    }

    /// For so many frames: four steps for one, which gain most of what eight do; none for a motion, whose time they treble.
    pub fn default_of(frames: usize) -> Self {
        Self::AtMost(if frames == 1 { 4 } else { 0 })
    }
}

impl FromStr for RefineSteps {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            number => Self::at_most(number.parse().map_err(|_| "expected a number of steps, or auto")?),
        }
    }
}

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

/// Lowers `energy` from `start` `[ΣV, 3]` (m) for as many `steps`; no triangles intersect then that did not at the start.
///
/// # Errors
/// When the energy at the start is not finite.
pub fn refine(
    energy: &SceneEnergy<f64>,
    start: &[[f64; 3]],
    steps: RefineSteps,
) -> Result<(Vec<[f64; 3]>, Refinement), EquilibriumError> {
    let settings = SolverSettings {
        iterations: match steps {
            RefineSteps::AtMost(steps) => steps,
            RefineSteps::Auto => SolverSettings::default().iterations,
        },
        step_bound: STEP_BOUND,
        time: (steps == RefineSteps::Auto).then_some(MOST_TIME),
        escape_distance: Some(FARTHEST_MOVE),
        margin: Some(LEFT_BETWEEN),
        ..SolverSettings::default()
    };
    let problem = Problem::new(energy)?;
    let mut energies: Vec<f64> = Vec::new();
    let solution = solve(&problem, start, &settings, &mut |progress| {
        energies.push(progress.step.energy);
        let is_done = steps == RefineSteps::Auto && is_enough(&energies);
        if is_done { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    let moved = solution
        .positions
        .iter()
        .zip(start)
        .map(|(p, q)| (0..3).map(|a| (p[a] - q[a]).powi(2)).sum::<f64>().sqrt());
    let done = Refinement {
        steps: solution.iterations(),
        stop: match solution.stop {
            Stop::Cancelled => "enough".to_owned(),
            stop => stop.name().to_owned(),
        },
        energy_before: solution.history[0].energy,
        energy_after: solution.energy(),
        largest_move_mm: 1e3 * moved.fold(0.0, f64::max),
    };
    Ok((solution.positions, done))
}

/// Whether the last of the steps between `energies` lowered them by less than [`LEAST_REFINE_GAIN`] of what all did.
fn is_enough(energies: &[f64]) -> bool {
    match energies {
        [first, .., before, last] => before - last < LEAST_REFINE_GAIN * (first - last),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_a_number_or_auto_and_the_last_small_one_is_enough() {
        assert_eq!("4".parse(), Ok(RefineSteps::AtMost(4)));
        assert_eq!("auto".parse(), Ok(RefineSteps::Auto));
        assert!("1000".parse::<RefineSteps>().is_ok());
        for refused in ["-1", "1001", "99999999999999999999999"] {
            assert!(refused.parse::<RefineSteps>().is_err(), "{refused}");
        }
        assert!(!is_enough(&[1.0]) && !is_enough(&[1.0, 0.5]) && !is_enough(&[1.0, 0.5, 0.4]));
        assert!(is_enough(&[1.0, 0.5, 0.499]));
    }
}
