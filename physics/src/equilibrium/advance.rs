//! One step of the search, and the vertices that block it.

use super::lbfgs::{Lbfgs, product};
use super::line_search::{Trial, search};
use super::nonsmooth::{NonsmoothPoint, project};
use super::preconditioner::Preconditioner;
use super::{Problem, SolverSettings};
use crate::energy::LayerTouch;
use crate::vec3::{add_scaled, dot, is_finite, norm_squared, sub};
use std::collections::{HashMap, HashSet};

/// How far ahead the forces are looked at where no step goes downhill (m): past a nonsmooth point that is hit at once, and not
/// past much else.
const LOOK_AHEAD_STEP: f64 = 1e-6;

/// A shorter step, in units of what the quasi-Newton matrix asks for, is not its curvature's fault.
const SHORT: f64 = 0.1;

/// At most one in so many vertices is held in its place for the others to move.
const MOST_HELD: usize = 10;

/// A state of the search.
pub(super) struct State {
    /// Posed positions (m).
    pub positions: Vec<[f64; 3]>,
    /// Weighted sum of all energies there (J).
    pub energy: f64,
    /// Its gradient (N).
    pub gradient: Vec<[f64; 3]>,
}

/// What a step is chosen by.
pub(super) struct Model<'a> {
    /// The subgradient of smallest norm.
    pub gradient: &'a [[f64; 3]],
    /// Where vertices move along, not across.
    pub nonsmooth: &'a [NonsmoothPoint],
    /// What the last steps taught.
    pub memory: &'a Lbfgs,
    /// What the terms know of the curvature.
    pub preconditioner: &'a Preconditioner,
}

/// The vertices that block a step.
#[derive(Debug, Default)]
pub(super) struct Blocked {
    /// Vertices whose forces turn against the step.
    pub turned: Vec<usize>,
    /// Vertices at a discontinuity: beyond it another part of a garment is nearest, and they violate its layer order.
    pub at_discontinuities: Vec<usize>,
}

/// One step downhill along the nonsmooth points of `model`, and the vertices that made it short, if it is; if there is no step
/// along the direction of its memory, the vertices that block it.
pub(super) fn advance(
    problem: &Problem<'_>,
    state: &State,
    model: &Model<'_>,
    settings: &SolverSettings,
    evaluations: &mut usize,
) -> Result<(State, Vec<usize>), Blocked> {
    // −P H P g is downhill for every projection P.
    let mut along = model.gradient.to_vec();
    project(model.nonsmooth, &mut along);
    let mut direction = model.memory.direction(&along, |q| model.preconditioner.apply(q));
    project(model.nonsmooth, &mut direction);
    let slope = product(&direction, model.gradient);
    let reach = longest(&direction);
    if !(slope < 0.0 && reach.is_finite()) {
        return Err(Blocked::default());
    }
    let mut evaluate = |length: f64| {
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
    match search(state.energy, slope, settings.step_bound / reach, &mut evaluate) {
        Some((length, trial)) if trial.state.gradient.iter().all(|g| is_finite(*g)) => {
            let slowed = match length < SHORT {
                true => turned_against(&direction, model.gradient, &trial.state.gradient),
                false => Vec::new(),
            };
            Ok((trial.state, slowed))
        }
        _ => {
            let ahead = evaluate(LOOK_AHEAD_STEP / reach).state;
            Err(Blocked {
                turned: turned_against(&direction, model.gradient, &ahead.gradient),
                at_discontinuities: at_discontinuities(problem, state, &ahead),
            })
        }
    }
}

/// The vertices whose forces turn most against `direction` between `here` and `ahead`: as many as must be held for the others
/// to go on downhill.
fn turned_against(direction: &[[f64; 3]], here: &[[f64; 3]], ahead: &[[f64; 3]]) -> Vec<usize> {
    let turned = |v: usize| dot(direction[v], sub(ahead[v], here[v]));
    let mut order: Vec<usize> = (0..direction.len()).filter(|v| turned(*v) > 0.0).collect();
    order.sort_by(|a, b| turned(*b).total_cmp(&turned(*a)));
    let mut left = product(direction, ahead);
    let held = order.iter().take_while(|v| {
        let needed = left >= 0.0;
        left -= dot(direction[**v], ahead[**v]);
        needed
    });
    let held: Vec<usize> = held.copied().collect();
    // Where everything turns, nothing blocks the rest.
    if held.len() > direction.len() / MOST_HELD { Vec::new() } else { held }
}

/// The vertices whose contact with other garments costs more `ahead` than `here`, most first: as many as must be held for the
/// energy to fall, with the faces that they are nearest to.
fn at_discontinuities(problem: &Problem<'_>, here: &State, ahead: &State) -> Vec<usize> {
    let touches = [here, ahead].map(|state| problem.layer_touches(&state.positions));
    let mut rises: HashMap<(usize, usize), f64> = HashMap::new();
    for (touches, sign) in touches.iter().zip([-1.0, 1.0]) {
        touches
            .iter()
            .for_each(|touch| *rises.entry((touch.pair, touch.vertex)).or_default() += sign * touch.energy);
    }
    let mut order: Vec<_> = rises.into_iter().filter(|(_, rise)| *rise > 0.0).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut left = ahead.energy - here.energy;
    let needed = |(_, rise): &&((usize, usize), f64)| {
        let needed = left >= 0.0;
        left -= rise;
        needed
    };
    let held: HashSet<_> = order.iter().take_while(needed).map(|(key, _)| *key).collect();
    let is_held = |touch: &&LayerTouch| held.contains(&(touch.pair, touch.vertex));
    let of_touch = |touch: &LayerTouch| [touch.vertex].into_iter().chain(touch.corners);
    let mut vertices: Vec<usize> = touches.iter().flatten().filter(is_held).flat_map(of_touch).collect();
    vertices.sort_unstable();
    vertices.dedup();
    if vertices.len() > here.positions.len() / MOST_HELD { Vec::new() } else { vertices }
}

/// The longest of vectors.
pub(super) fn longest(x: &[[f64; 3]]) -> f64 {
    x.iter().map(|x| norm_squared(*x)).fold(0.0, f64::max).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy::tests::scenes::{only, scene_of};
    use crate::energy::{EnergySettings, LayerContact, Term};
    use crate::mesh::shapes;

    #[test]
    fn a_vertex_in_the_middle_between_two_sheets_is_at_a_discontinuity() {
        // Two sheets of one garment, 2 cm apart, that both look up. In the middle the upper one becomes the nearer, and a
        // vertex of another garment violates its layer order at once.
        let sheet = |height: f64, size: f64, cells: usize| {
            let grid = shapes::grid(size, size, cells, cells);
            shapes::mapped(&grid, |[x, y, _]| [x - 0.5 * size, height, 0.5 * size - y])
        };
        let inner = shapes::union(&[&sheet(0.0, 0.3, 12), &sheet(0.02, 0.3, 12)]);
        let outer = sheet(0.0099, 0.1, 4);
        let far = shapes::mapped(&shapes::icosphere(0.1, 1), |[x, y, z]| [x + 100.0, y, z]);
        let settings =
            EnergySettings { layer_contact: LayerContact::ClosestPoint, ..EnergySettings::default() };
        let count = inner.vertex_count();
        let scene = scene_of::<f64>(vec![inner, outer], &far, settings, only(Term::LayerCollision), 0.0, 1);
        let problem = Problem::new(&scene.energy).unwrap();
        let state = |positions: Vec<[f64; 3]>| {
            let (energy, gradient) = problem.value_and_gradient(&positions);
            State { positions, energy, gradient }
        };
        let moved = |vertex: usize, height: f64| {
            let mut positions = scene.posed.clone();
            positions[vertex][1] = height;
            state(positions)
        };
        let here = state(scene.posed.clone());
        assert_eq!(here.energy, 0.0);
        let ahead = moved(count + 12, 0.0101);
        assert!(ahead.energy > 0.0);
        let found = at_discontinuities(&problem, &here, &ahead);
        assert!(
            found.contains(&(count + 12)) && !found.iter().any(|v| *v > count && *v != count + 12),
            "{found:?}"
        );
        // With corners of a face of both sheets.
        let heights: HashSet<_> = found.iter().map(|v| (1e3 * scene.posed[*v][1]).round() as i64).collect();
        assert_eq!(heights, HashSet::from([0, 10, 20]));
        // No other side, no discontinuity.
        assert!(at_discontinuities(&problem, &here, &moved(count + 12, 0.0095)).is_empty());
    }

    #[test]
    fn the_vertices_that_turn_against_a_step_are_held_and_no_others() {
        // Forty vertices fall along x; one is driven back as soon as it moves, another a little less fast.
        let direction = vec![[1.0, 0.0, 0.0]; 40];
        let here = vec![[-1.0, 0.0, 0.0]; 40];
        let mut ahead = here.clone();
        ahead[7] = [100.0, 0.0, 0.0];
        ahead[9] = [-0.5, 0.0, 0.0];
        assert_eq!(turned_against(&direction, &here, &ahead), [7]);
        // With the second worst the others still go downhill.
        ahead[9] = [60.0, 0.0, 0.0];
        assert_eq!(turned_against(&direction, &here, &ahead), [7, 9]);
        // Nothing turned; everything turned.
        assert!(turned_against(&direction, &here, &here).is_empty());
        assert!(turned_against(&direction, &here, &vec![[1.0, 0.0, 0.0]; 40]).is_empty());
    }
}
