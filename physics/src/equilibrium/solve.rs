//! The minimisation loop.

use std::ops::ControlFlow;
use std::time::Instant;

use super::advance::{Model, State, advance, longest};
use super::lbfgs::Lbfgs;
use super::nonsmooth::{NonsmoothPoint, balance};
use super::preconditioner::Preconditioner;
use super::problem::{norm, relative};
use super::{EquilibriumError, Problem, Progress, Solution, SolverSettings, Step, Stop};
use crate::vec3::{distance_squared, is_finite, sub};

/// Iterations between two looks at the scale of the forces, which costs an evaluation of
/// each term.
const LOOK_EVERY: usize = 10;

/// The iteration from which on vertices are kept on nonsmooth points: before, they only pass.
const FIRST_LOOK: usize = 10;

/// Progress is judged over this many iterations.
const WINDOW: usize = 60;

/// Less than this share of all that was gained, gained over [`WINDOW`] iterations, is no progress.
const LEAST_GAIN: f64 = 1e-9;

/// Most times that vertices are held in one iteration.
const MOST_HOLDS: usize = 8;

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
    let mut state = first_state(problem, start)?;
    let mut step = Step {
        iteration: 0,
        energy: state.energy,
        gradient_norm: norm(&state.gradient),
        displacement: 0.0,
        evaluations: 1,
        milliseconds: 0.0,
    };
    let mut force_scale = problem.force_scale(start);
    let mut preconditioner: Option<Preconditioner> = None;
    let mut memory = Lbfgs::new(settings.memory);
    let mut age = 0;
    // Vertices before nonsmooth points that made the last step short.
    let mut blocking: Vec<usize> = Vec::new();
    // Vertices at discontinuities: held until the next look.
    let mut at_discontinuities: Vec<usize> = Vec::new();
    // The positions before the last step, and the gradient there.
    let mut last: Option<(Vec<[f64; 3]>, Vec<[f64; 3]>)> = None;
    let mut history = Vec::new();

    let stop = loop {
        if step.iteration.is_multiple_of(LOOK_EVERY) && step.iteration > 0 {
            force_scale = problem.force_scale(&state.positions);
            at_discontinuities.clear();
        }
        // Vertices of a smaller gradient than this may all be wrong together.
        let least = 0.1 * settings.tolerance * force_scale / (state.positions.len() as f64).sqrt();
        let looks_at_nonsmooth = step.iteration >= FIRST_LOOK;
        if looks_at_nonsmooth
            && let Some(positions) = problem.onto_nonsmooth_points(&state.positions, &state.gradient, least)
        {
            let (energy, gradient) = problem.value_and_gradient(&positions);
            step.evaluations += 1;
            if energy < state.energy && gradient.iter().all(|g| is_finite(*g)) {
                state = State { positions, energy, gradient };
                step = Step { energy, gradient_norm: norm(&state.gradient), ..step };
            }
        }
        step.milliseconds = 1e3 * clock.elapsed().as_secs_f64();
        history.push(step);
        if observer(&Progress { step: &step, positions: &state.positions }).is_break() {
            break Stop::Cancelled;
        }
        let mut nonsmooth: Vec<NonsmoothPoint> = match looks_at_nonsmooth {
            true => problem.nonsmooth_points(&state.positions, &state.gradient, least),
            false => Vec::new(),
        };
        let mut balanced = state.gradient.clone();
        balance(&nonsmooth, &mut balanced);
        let residual = norm(&balanced);
        if let Some((positions, gradient)) = last.take() {
            memory.push(difference(&state.positions, &positions), difference(&balanced, &gradient));
        }
        // The scale of some iterations ago is only believed when it says no.
        if relative(residual, force_scale) <= settings.tolerance {
            force_scale = problem.force_scale(&state.positions);
            if relative(residual, force_scale) <= settings.tolerance {
                break Stop::Converged;
            }
        }
        if !is_progressing(&history) {
            break Stop::Stalled;
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

        let preconditioner = preconditioner.get_or_insert_with(|| {
            age = settings.refactorise_every;
            Preconditioner::new(problem, start)
        });
        // They had the last step, the others have this one.
        nonsmooth.extend(blocking.drain(..).map(|vertex| NonsmoothPoint::held(vertex, balanced[vertex])));
        nonsmooth
            .extend(at_discontinuities.iter().map(|&vertex| NonsmoothPoint::held(vertex, balanced[vertex])));
        let (mut holds, mut nonsmooth_was_wrong) = (0, false);
        let next = loop {
            if age >= settings.refactorise_every {
                preconditioner.refresh(problem, &state.positions);
                age = 0;
            }
            let model = Model { gradient: &balanced, nonsmooth: &nonsmooth, memory: &memory, preconditioner };
            let blocked = match advance(problem, &state, &model, settings, &mut step.evaluations) {
                Ok((next, slowed)) => {
                    blocking = slowed;
                    break Some(next);
                }
                Err(blocked) => blocked,
            };
            if !blocked.at_discontinuities.is_empty() && holds < MOST_HOLDS && !nonsmooth_was_wrong {
                nonsmooth.extend(
                    blocked
                        .at_discontinuities
                        .iter()
                        .map(|&vertex| NonsmoothPoint::held(vertex, balanced[vertex])),
                );
                at_discontinuities.extend(blocked.at_discontinuities);
                holds += 1;
            } else if age > 0 || !memory.is_empty() {
                memory.clear();
                age = settings.refactorise_every;
            } else if !blocked.turned.is_empty() && holds < MOST_HOLDS && !nonsmooth_was_wrong {
                // A few vertices before a nonsmooth point hold up all others: for once without them.
                nonsmooth.extend(
                    blocked.turned.into_iter().map(|vertex| NonsmoothPoint::held(vertex, balanced[vertex])),
                );
                holds += 1;
            } else if !nonsmooth.is_empty() && !nonsmooth_was_wrong {
                // The model of the nonsmooth points was wrong somewhere: once without.
                nonsmooth.clear();
                balanced.clone_from(&state.gradient);
                nonsmooth_was_wrong = true;
            } else {
                break None;
            }
        };
        let Some(next) = next else { break Stop::Stalled };
        age += 1;
        let moved = longest(&difference(&next.positions, &state.positions));
        step = Step {
            iteration: step.iteration + 1,
            energy: next.energy,
            gradient_norm: norm(&next.gradient),
            displacement: moved,
            ..step
        };
        last = Some((std::mem::replace(&mut state, next).positions, balanced));
    };
    let residual = problem.unbalanced_norm(&state.positions, &state.gradient);
    let relative_gradient = relative(residual, problem.force_scale(&state.positions));
    let exhausted = matches!(stop, Stop::Stalled | Stop::Iterations | Stop::Time);
    let stop = if exhausted && relative_gradient <= settings.tolerance { Stop::Converged } else { stop };
    let factorisations = preconditioner.map_or(0, |p| p.factorisations);
    Ok(Solution { positions: state.positions, stop, relative_gradient, history, factorisations })
}

fn first_state(problem: &Problem<'_>, start: &[[f64; 3]]) -> Result<State, EquilibriumError> {
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
    Ok(State { positions: start.to_vec(), energy, gradient })
}

/// `a − b`.
fn difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> Vec<[f64; 3]> {
    a.iter().zip(b).map(|(a, b)| sub(*a, *b)).collect()
}

/// Whether the last [`WINDOW`] iterations gained a share of the energy that is worth while.
fn is_progressing(history: &[Step]) -> bool {
    let Some(earlier) = history.len().checked_sub(WINDOW + 1) else { return true };
    let energy = |i: usize| history[i].energy;
    let last = history.len() - 1;
    energy(earlier) - energy(last) > LEAST_GAIN * (energy(0) - energy(last))
}
