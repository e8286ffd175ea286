//! The minimisation loop.

use std::ops::ControlFlow;
use std::time::Instant;

use super::filtered_steps::{FilteredSteps, contact_mesh};
use super::hessian::Hessian;
use super::line_search::{SolverState, search};
use super::problem::relative;
use super::{EquilibriumError, Problem, Progress, Solution, SolverSettings, Step, Stop};
use crate::vec3::{add_scaled, distance_squared, dot, is_finite, norm_squared, sub};

/// Iterations between two looks at the scale of the forces, which costs an evaluation of each term.
const LOOK_EVERY: usize = 10;

/// Levenberg's shift at first, at least and at most, in units of the mean diagonal entry. It follows the steps: what no
/// term holds (a rigid motion, a fold that opens) and what the model leaves out would be a step of any length
/// otherwise.
const SHIFT: [f64; 3] = [1e-2, 1e-6, 1e-2];

/// Factors on the shift after a full step that gained a good part of what its model promised, and after one that had to
/// be shortened.
const FACTORS: [f64; 2] = [0.3, 3.0];

/// From this share of the decrease that the slope predicts the gain is good: half of the half that it is if the model holds.
const GOOD: f64 = 0.25;

/// Where no step lowers the energy, most models that are tried, of more sides, narrower creases and a larger shift each.
const MOST_MODELS: usize = 10;

/// A larger shift than this is not tried.
const LARGEST_SHIFT: f64 = 1.0;

/// Width of the creases in the model (m), in units of the last step and at least and at most: the model sees across a
/// crease a small part of how far a step goes.
const CREASE_WIDTH: (f64, [f64; 2]) = (0.01, [1e-7, 1e-3]);

/// Progress is judged over this many iterations.
const WINDOW: usize = 10;

/// Less than this share of all that was gained, in units of the tolerance, gained over [`WINDOW`] iterations, is no progress.
const LEAST_PROGRESS: f64 = 1e-6;

/// Lowers the energy of `problem` from posed positions `start` `[ΣV, 3]` (m) until it cannot or may not be lowered any
/// more; [`Solution::stop`] says which. `observer` sees the start and every accepted step, and can end the search.
///
/// The result is a function of its arguments alone, whatever the number of threads, unless time or the observer end it.
///
/// # Errors
/// [`EquilibriumError`] for settings out of range and for a start that is not finite or has another number of vertices.
pub fn solve(
    problem: &Problem<'_>,
    start: &[[f64; 3]],
    settings: &SolverSettings,
    observer: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Solution, EquilibriumError> {
    settings.check()?;
    let clock = Instant::now();
    problem.forget();
    let mut state = first_state(problem, start)?;
    problem.look_around(start);
    let mut step = Step { iteration: 0, energy: state.energy, displacement: 0.0, milliseconds: 0.0 };
    let mut force_scale = problem.force_scale(start);
    let mut hessian = Hessian::new(problem.vertex_count());
    let mesh = settings.margin.map(|margin| (contact_mesh(problem.energy()), margin));
    let mut filter = mesh.as_ref().map(|(mesh, margin)| FilteredSteps::new(mesh, problem, start, *margin));
    let [mut shift, ..] = SHIFT;
    let mut reach = f64::INFINITY;
    let mut history: Vec<Step> = Vec::new();
    let stop = loop {
        if step.iteration.is_multiple_of(LOOK_EVERY) && step.iteration > 0 {
            force_scale = problem.force_scale(&state.positions);
        }
        step.milliseconds = 1e3 * clock.elapsed().as_secs_f64();
        history.push(step);
        if observer(&Progress { step: &step, positions: &state.positions }).is_break() {
            break Stop::Cancelled;
        }
        // The scale of some iterations ago is only believed when it says no.
        if is_balanced(problem, &state, force_scale, settings.tolerance) {
            force_scale = problem.force_scale(&state.positions);
            if is_balanced(problem, &state, force_scale, settings.tolerance) {
                break Stop::Converged;
            }
        }
        if !is_progressing(&history, settings.tolerance) {
            break Stop::Settled;
        }
        if let Some(bound) = settings.escape_distance {
            let is_far = |(p, q): (&[f64; 3], &[f64; 3])| distance_squared(*p, *q) > bound * bound;
            if state.positions.iter().zip(start).any(is_far) {
                break Stop::Escaped;
            }
        }
        if step.iteration >= settings.iterations {
            break Stop::Iterations;
        }
        if settings.time.is_some_and(|limit| clock.elapsed() >= limit) {
            break Stop::Time;
        }

        let (share, [least, most]) = CREASE_WIDTH;
        let mut width = (share * reach).clamp(least, most);
        let mut models = 0;
        let next = loop {
            let smooth = hessian.assemble(problem, &state.positions, &state.gradient, width);
            let found = hessian.direction(&smooth, shift).and_then(|d| {
                reach = longest(&d);
                let length = (settings.step_bound / reach).min(1.0);
                let moved = state.positions.iter().zip(&d).map(|(p, d)| add_scaled(*p, length, *d));
                let line = StepLine { problem, state: &state, to: moved.collect(), is_whole: length == 1.0 };
                match filter.as_mut() {
                    Some(filter) => line.advance_filtered(filter),
                    None => line.advance(),
                }
            });
            models += 1;
            match found {
                Some((share, next)) => {
                    let [longer, shorter] = FACTORS;
                    let factor = if share >= GOOD {
                        longer
                    } else if share == 0.0 {
                        shorter
                    } else {
                        1.0
                    };
                    shift = (shift * factor).clamp(SHIFT[1], SHIFT[2]);
                    break Some(next);
                }
                None if models == MOST_MODELS => break None,
                // The trials have seen more sides of the creases.
                None => {
                    width *= FACTORS[0];
                    shift = (shift * FACTORS[1]).min(LARGEST_SHIFT);
                }
            }
        };
        let Some(next) = next else { break Stop::Stalled };
        let moved = state.positions.iter().zip(&next.positions);
        step = Step {
            iteration: step.iteration + 1,
            energy: next.energy,
            displacement: moved.map(|(p, q)| distance_squared(*p, *q)).fold(0.0, f64::max).sqrt(),
            ..step
        };
        state = next;
    };
    let relative_gradient = problem.relative_gradient(&state.positions);
    let exhausted = !matches!(stop, Stop::Converged | Stop::Escaped | Stop::Cancelled);
    let stop = if exhausted && relative_gradient <= settings.tolerance { Stop::Converged } else { stop };
    Ok(Solution { positions: state.positions, stop, relative_gradient, history })
}

/// Where a search for the next state begins, and where it goes at most.
struct StepLine<'a> {
    problem: &'a Problem<'a>,
    state: &'a SolverState,
    to: Vec<[f64; 3]>,
    /// Whether that is as far as the model goes.
    is_whole: bool,
}

impl StepLine<'_> {
    /// A lower state on the line, and the share of the decrease predicted by the slope that it has, 0 where it is not
    /// as far as the model goes; `None` where the line does not go downhill.
    fn advance(&self) -> Option<(f64, SolverState)> {
        let Self { state, .. } = self;
        let moves: Vec<[f64; 3]> = self.to.iter().zip(&state.positions).map(|(q, p)| sub(*q, *p)).collect();
        let slope = product(&moves, &state.gradient);
        if slope.is_nan() || slope >= 0.0 {
            return None;
        }
        let evaluate = |length: f64| {
            let part =
                || state.positions.iter().zip(&moves).map(|(p, d)| add_scaled(*p, length, *d)).collect();
            let positions = if length == 1.0 { self.to.clone() } else { part() };
            let (energy, gradient) = self.problem.value_and_gradient(&positions);
            SolverState { positions, energy, gradient }
        };
        let (length, next) = search(state.energy, slope, evaluate)?;
        let share = if length == 1.0 && self.is_whole { (next.energy - state.energy) / slope } else { 0.0 };
        Some((share, next))
    }

    /// The same on what `filter` leaves of the line, which then has made the step.
    fn advance_filtered(self, filter: &mut FilteredSteps<'_>) -> Option<(f64, SolverState)> {
        let from = &self.state.positions;
        let mut to = self.to.clone();
        let before = filter.take(from, &mut to);
        let line = StepLine { is_whole: self.is_whole && to == self.to, to, ..self };
        let found = line.advance();
        match found {
            Some((_, next)) if next.positions != line.to => {
                // Part of a step takes elements that intersect already elsewhere than all of it.
                filter.take_back(before.clone());
                let mut to = next.positions.clone();
                filter.take(from, &mut to);
                if to != next.positions {
                    filter.take_back(before);
                    return None;
                }
                Some((0.0, next))
            }
            None => {
                filter.take_back(before);
                None
            }
            found => found,
        }
    }
}

/// Whether the forces at `state`, compared with `scale`, balance within `tolerance`.
fn is_balanced(problem: &Problem<'_>, state: &SolverState, scale: f64, tolerance: f64) -> bool {
    relative(problem.residual(&state.positions, &state.gradient), scale) <= tolerance
}

/// Whether the last [`WINDOW`] iterations gained a share of the energy that is worth while.
fn is_progressing(history: &[Step], tolerance: f64) -> bool {
    let Some(earlier) = history.len().checked_sub(WINDOW + 1) else { return true };
    let energy = |i: usize| history[i].energy;
    let last = history.len() - 1;
    energy(earlier) - energy(last) > LEAST_PROGRESS * tolerance * (energy(0) - energy(last))
}

fn first_state(problem: &Problem<'_>, start: &[[f64; 3]]) -> Result<SolverState, EquilibriumError> {
    let (expected, found) = (problem.vertex_count(), start.len());
    if expected != found {
        return Err(EquilibriumError::Count { what: "start positions", expected, found });
    }
    if let Some(vertex) = start.iter().position(|p| !is_finite(*p)) {
        return Err(EquilibriumError::StartPosition { vertex });
    }
    let (energy, gradient) = problem.value_and_gradient(start);
    if !(energy.is_finite() && gradient.iter().all(|g| is_finite(*g))) {
        return Err(EquilibriumError::StartEnergy);
    }
    Ok(SolverState { positions: start.to_vec(), energy, gradient })
}

/// Scalar product over all coordinates, summed in order.
fn product(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.iter().zip(b).map(|(a, b)| dot(*a, *b)).sum()
}

/// The longest of vectors.
fn longest(x: &[[f64; 3]]) -> f64 {
    x.iter().map(|x| norm_squared(*x)).fold(0.0, f64::max).sqrt()
}
