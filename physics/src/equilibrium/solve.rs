//! The minimisation loop.

use std::ops::ControlFlow;
use std::time::Instant;

use super::kinks::{Kink, balance, project};
use super::lbfgs::{Memory, product};
use super::line_search::{Trial, search};
use super::preconditioner::Preconditioner;
use super::problem::{norm, relative};
use super::{EquilibriumError, Problem, Progress, Solution, SolverSettings, Step, Stop};
use crate::vec3::{add_scaled, distance_squared, is_finite, norm_squared, sub};

/// Iterations between two looks at the scale of the forces, which costs an evaluation.
const LOOK_EVERY: usize = 10;

/// The iteration from which on vertices are kept on kinks: before, they only pass.
const FIRST_LOOK: usize = 10;

/// Progress is judged over this many iterations.
const WINDOW: usize = 60;

/// Less than this share of all that was gained, gained over [`WINDOW`] iterations, is no progress.
const LEAST_GAIN: f64 = 1e-6;

/// A state of the search.
struct State {
    positions: Vec<[f64; 3]>,
    energy: f64,
    gradient: Vec<[f64; 3]>,
}

/// Lowers the energy of `problem` from posed positions `start` `[ΣV, 3]` [m] until it cannot or may not be lowered any
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
    let mut memory = Memory::new(settings.memory);
    let mut age = 0;
    let mut kinks: Vec<Kink> = Vec::new();
    // The last step, and the gradient before it.
    let mut last: Option<(Vec<[f64; 3]>, Vec<[f64; 3]>)> = None;
    let mut history = Vec::new();

    let stop = loop {
        step.milliseconds = 1e3 * clock.elapsed().as_secs_f64();
        history.push(step);
        if observer(&Progress { step: &step, positions: &state.positions }).is_break() {
            break Stop::Cancelled;
        }
        if step.iteration.is_multiple_of(LOOK_EVERY) && step.iteration > 0 {
            force_scale = problem.force_scale(&state.positions);
        }
        // Vertices of a smaller gradient than this may all be wrong together.
        let least = 0.1 * settings.tolerance * force_scale / (state.positions.len() as f64).sqrt();
        if step.iteration >= FIRST_LOOK {
            if let Some(positions) = problem.onto_kinks(&state.positions, &state.gradient, least) {
                let (energy, gradient) = problem.value_and_gradient(&positions);
                step.evaluations += 1;
                if energy < state.energy && gradient.iter().all(|g| is_finite(*g)) {
                    state = State { positions, energy, gradient };
                    step = Step { energy, gradient_norm: norm(&state.gradient), ..step };
                    if let Some(entry) = history.last_mut() {
                        *entry = step;
                    }
                }
            }
            kinks = problem.kinks(&state.positions, &state.gradient, least);
        }
        let mut balanced = state.gradient.clone();
        balance(&kinks, &mut balanced);
        let residual = norm(&balanced);
        if let Some((moved, before)) = last.take() {
            memory.push(moved, difference(&balanced, &before));
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
        let next = loop {
            if age >= settings.refactorise_every {
                preconditioner.refresh(problem, &state.positions);
                age = 0;
            }
            let model = Model { gradient: &balanced, kinks: &kinks, memory: &memory, preconditioner };
            let found = advance(problem, &state, &model, settings, &mut step.evaluations);
            if found.is_some() || (age == 0 && memory.is_empty() && kinks.is_empty()) {
                break found;
            }
            if age == 0 && memory.is_empty() {
                // The model of the kinks was wrong somewhere: once without.
                kinks.clear();
                balanced.clone_from(&state.gradient);
            }
            memory.clear();
            age = settings.refactorise_every;
        };
        let Some(next) = next else { break Stop::Stalled };
        age += 1;
        let moved = difference(&next.positions, &state.positions);
        step = Step {
            iteration: step.iteration + 1,
            energy: next.energy,
            gradient_norm: norm(&next.gradient),
            displacement: longest(&moved),
            ..step
        };
        last = Some((moved, balanced));
        state = next;
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

/// What a step is chosen by.
struct Model<'a> {
    /// The subgradient of smallest norm.
    gradient: &'a [[f64; 3]],
    kinks: &'a [Kink],
    memory: &'a Memory,
    preconditioner: &'a Preconditioner,
}

/// One step downhill along the kinks of `model`; `None` if there is none along the direction of its memory.
fn advance(
    problem: &Problem<'_>,
    state: &State,
    model: &Model<'_>,
    settings: &SolverSettings,
    evaluations: &mut usize,
) -> Option<State> {
    // −P H P g is downhill for every projection P.
    let mut along = model.gradient.to_vec();
    project(model.kinks, &mut along);
    let mut direction = model.memory.direction(&along, |q| model.preconditioner.apply(q));
    project(model.kinks, &mut direction);
    let slope = product(&direction, model.gradient);
    let reach = longest(&direction);
    if !(slope < 0.0 && reach.is_finite()) {
        return None;
    }
    let evaluate = |length: f64| {
        *evaluations += 1;
        let positions: Vec<[f64; 3]> =
            state.positions.iter().zip(&direction).map(|(p, d)| add_scaled(*p, length, *d)).collect();
        let (energy, gradient) = problem.value_and_gradient(&positions);
        Trial {
            value: energy,
            slope: product(&direction, &gradient),
            state: State { positions, energy, gradient },
        }
    };
    let (_, trial) = search(state.energy, slope, settings.step_bound / reach, evaluate)?;
    trial.state.gradient.iter().all(|g| is_finite(*g)).then_some(trial.state)
}

/// Whether the last [`WINDOW`] iterations gained a share of the energy that is worth while.
fn is_progressing(history: &[Step]) -> bool {
    let Some(earlier) = history.len().checked_sub(WINDOW + 1) else { return true };
    let energy = |i: usize| history[i].energy;
    let last = history.len() - 1;
    energy(earlier) - energy(last) > LEAST_GAIN * (energy(0) - energy(last))
}

/// The longest of vectors.
fn longest(x: &[[f64; 3]]) -> f64 {
    x.iter().map(|x| norm_squared(*x)).fold(0.0, f64::max).sqrt()
}
