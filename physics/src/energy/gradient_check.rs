//! Every gradient against difference quotients of its value, in `f64`: the proof that a term is what it claims to be.
//!
//! [`check_gradient`] takes one [`Term`] of a scene and compares, along single coordinates and along random directions that
//! move many vertices at once, the analytic derivative with central differences. A walk over [`Term::ALL`] covers a ninth
//! term without a change here: the check knows values and gradients, not formulas.
//!
//! Positions and steps are multiples of one power of two, so that a step moves a coordinate by exactly what it is divided by.
//!
//! **Scale.** Errors are relative to the largest entry of the term's gradient in the scene. At a minimum that is rounding
//! noise, so it counts at least as much as the largest entry after every coordinate moved by a random amount of up to one
//! hundredth of an edge. A term that is silent there as well must be exactly constant.

use rayon::prelude::*;

pub use super::difference_quotient::GRADIENT_TOLERANCE;
use super::difference_quotient::{Ladder, Line, LineResult, Probe, nan_max};
use super::{SceneEnergy, SceneValue, Term, TermMap};
use crate::mesh::shapes::SplitMix;

/// First step in units of the shortest median edge.
const FIRST_STEP: f64 = 1e-2;

/// Edges longer than this do not lengthen the first step (m): a rest shape in the wrong unit does not enlarge the body.
const LONGEST_EDGE: f64 = 0.02;

/// Directions in large scenes move this many vertices: with all of them some nearest vertex always changes.
const MOVED_VERTICES: usize = 64;

/// Positions are multiples of the extent of the scene over 2 to this power.
const QUANTUM_BITS: f64 = 50.0;

/// Components of a direction are multiples of one over this.
const COMPONENTS: f64 = 64.0;

/// How much is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GradientCheck {
    /// Random coordinates; every other one is drawn from those with a gradient.
    pub coordinates: usize,
    /// Random directions that move many vertices at once.
    pub directions: usize,
    /// Seed of both.
    pub seed: u64,
}

impl Default for GradientCheck {
    fn default() -> Self {
        Self { coordinates: 24, directions: 4, seed: 1 }
    }
}

/// What [`check_gradient`] found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GradientReport {
    /// Raw value of the term, summed over the garments and pairs of the scene.
    pub value: f64,
    /// Largest entry of its gradient.
    pub largest: f64,
    /// What errors are relative to, see the module.
    pub scale: f64,
    /// Largest difference between the gradient and its quotients, relative to `scale`; infinite if a term without any
    /// gradient nearby is not constant.
    pub error: f64,
    /// Largest error of the quotients themselves, by their own estimate, relative to `scale`.
    pub resolution: f64,
    /// Lines compared.
    pub lines: usize,
    /// How many of them were compared on both sides of a nonsmooth point.
    pub nonsmooth: usize,
}

impl GradientReport {
    /// Whether gradient and quotients agree to [`GRADIENT_TOLERANCE`].
    pub fn passes(&self) -> bool {
        self.error <= GRADIENT_TOLERANCE
    }
}

/// Compares the gradient of `term` in `scene` with difference quotients at `posed` and `canonical` (`[ΣV, 3]` (m) each, as in
/// [`SceneEnergy::evaluate`]). `None` if the scene has no such term: no garment is held, or no pair of layers.
///
/// # Panics
/// As [`SceneEnergy::evaluate`].
pub fn check_gradient(
    scene: &SceneEnergy<f64>,
    term: Term,
    posed: &[[f64; 3]],
    canonical: &[[f64; 3]],
    settings: &GradientCheck,
) -> Option<GradientReport> {
    let scene = with_only(scene, term);
    raw_value(&scene.value(posed, canonical), term)?;
    let edges = scene.garments.iter().map(|g| g.energies.as_inner().median_edge());
    let edge = edges.fold(LONGEST_EDGE, f64::min);
    Some(match scene.needs_canonical() {
        true => {
            let gradient = |x: &[[f64; 3]]| {
                let value = scene.evaluate(posed, x);
                (value.total, value.canonical_gradient)
            };
            check_function(&|x| scene.value(posed, x).total, &gradient, canonical, edge, settings)
        }
        false => {
            let gradient = |x: &[[f64; 3]]| {
                let value = scene.evaluate(x, canonical);
                (value.total, value.posed_gradient)
            };
            check_function(&|x| scene.value(x, canonical).total, &gradient, posed, edge, settings)
        }
    })
}

/// The same for any function of positions: `value`, and value with `gradient`, at `positions` `[V, 3]` (m) of a mesh with edges
/// of about `edge` (m).
pub fn check_function(
    value: &(dyn Fn(&[[f64; 3]]) -> f64 + Sync),
    gradient: &(dyn Fn(&[[f64; 3]]) -> (f64, Vec<[f64; 3]>) + Sync),
    positions: &[[f64; 3]],
    edge: f64,
    settings: &GradientCheck,
) -> GradientReport {
    let extent = positions.iter().flatten().fold(1.0, |m: f64, x| m.max(x.abs()));
    let quantum = (extent.log2().ceil() - QUANTUM_BITS).exp2();
    let snapped: Vec<[f64; 3]> =
        positions.iter().map(|p| p.map(|x| (x / quantum).round() * quantum)).collect();
    let probe = Probe { value, gradient, positions: &snapped };
    let (here, gradient) = probe.evaluate(&[], 0.0);
    let largest = largest_entry(&gradient);

    let mut random = SplitMix::new(settings.seed);
    let first_step = FIRST_STEP * edge;
    let everything: Line = (0..3 * positions.len()).map(|c| (c, random.symmetric())).collect();
    let scale = largest.max(largest_entry(&probe.evaluate(&everything, first_step).1));
    // Where the value is large against its gradient (far away, gravity), a short step drowns in rounding.
    let resolving = f64::EPSILON * here.abs() / (1e-2 * GRADIENT_TOLERANCE * scale);
    let first_step = if resolving.is_finite() { first_step.max(resolving.min(extent)) } else { first_step };

    let lines = lines(&gradient, settings, &mut random);
    let ladder = Ladder { first: first_step, unit: COMPONENTS * quantum, scale };
    let results: Vec<LineResult> =
        lines.par_iter().map(|line| ladder.check(&probe, line, &gradient)).collect();
    let relative = |x: f64| match (x == 0.0, scale > 0.0) {
        (true, _) => 0.0,
        (false, true) => x / scale,
        (false, false) => f64::INFINITY,
    };
    let worst = |f: fn(&LineResult) -> f64| results.iter().map(|r| relative(f(r))).fold(0.0, nan_max);
    GradientReport {
        value: here,
        largest,
        scale,
        error: worst(|r| r.error),
        resolution: if scale > 0.0 { worst(|r| r.resolution) } else { 0.0 },
        lines: results.len(),
        nonsmooth: results.iter().filter(|r| r.is_nonsmooth).count(),
    }
}

/// The raw value of `term` summed over garments and pairs; `None` if nothing evaluated it.
pub fn raw_value<T>(value: &SceneValue<T>, term: Term) -> Option<f64> {
    let raw = value.garments.iter().chain(&value.layers).filter_map(|raw| raw[term]);
    raw.fold(None, |sum, v| Some(sum.unwrap_or(0.0) + v))
}

/// `scene` with weight 1 for `term` and 0 for all others.
pub fn with_only<T: crate::Real>(scene: &SceneEnergy<T>, term: Term) -> SceneEnergy<T> {
    let weights = TermMap::from_fn(|t| if t == term { 1.0 } else { 0.0 });
    let mut scene = scene.clone();
    scene.garments.iter_mut().for_each(|g| g.weights = weights);
    scene.layers.iter_mut().for_each(|l| l.weights = weights);
    scene
}

/// Largest absolute entry; NaN if any is.
pub fn largest_entry<T: crate::Real>(gradient: &[[T; 3]]) -> f64 {
    gradient.as_flattened().iter().map(|g| crate::Real::to_f64(*g).abs()).fold(0.0, nan_max)
}

fn lines(gradient: &[[f64; 3]], settings: &GradientCheck, random: &mut SplitMix) -> Vec<Line> {
    let count = 3 * gradient.len();
    let alive: Vec<usize> = (0..count).filter(|&c| gradient[c / 3][c % 3] != 0.0).collect();
    let mut below = |n: usize| (random.next_u64() % n.max(1) as u64) as usize;
    let mut lines: Vec<Line> = (0..settings.coordinates)
        .map(|k| {
            // So that a sparse term is tested where it acts.
            let c = if k % 2 == 0 && !alive.is_empty() { alive[below(alive.len())] } else { below(count) };
            vec![(c, 1.0)]
        })
        .collect();
    for _ in 0..settings.directions {
        let mut vertices: Vec<usize> = if gradient.len() <= 8 * MOVED_VERTICES {
            (0..gradient.len()).collect()
        } else {
            let alive_or_any = |k: usize, below: &mut dyn FnMut(usize) -> usize| match alive.is_empty()
                || k.is_multiple_of(2)
            {
                true => below(gradient.len()),
                false => alive[below(alive.len())] / 3,
            };
            (0..MOVED_VERTICES).map(|k| alive_or_any(k, &mut below)).collect()
        };
        vertices.sort_unstable();
        vertices.dedup();
        let mut symmetric = || below(2 * COMPONENTS as usize + 1) as f64 / COMPONENTS - 1.0;
        lines.push(
            vertices.iter().flat_map(|v| [3 * v, 3 * v + 1, 3 * v + 2]).map(|c| (c, symmetric())).collect(),
        );
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: GradientCheck = GradientCheck { coordinates: 30, directions: 4, seed: 3 };

    /// `Σ f(x)` over all coordinates, with `f` and its claimed derivative.
    fn report(f: fn(f64) -> f64, slope: fn(f64) -> f64, at: f64) -> GradientReport {
        let positions: Vec<[f64; 3]> = (0..6).map(|v| [at, at + 0.1 * f64::from(v), at - 0.13]).collect();
        let value = |x: &[[f64; 3]]| x.iter().flatten().map(|x| f(*x)).sum::<f64>();
        let gradient = |x: &[[f64; 3]]| (value(x), x.iter().map(|p| p.map(slope)).collect());
        check_function(&value, &gradient, &positions, 0.02, &SETTINGS)
    }

    #[test]
    fn a_derivative_passes_and_one_that_is_a_little_off_does_not() {
        let good = report(f64::exp, f64::exp, 0.4);
        assert!(good.passes() && good.nonsmooth == 0 && good.error < 1e-8, "{good:?}");
        let off = report(f64::exp, |x| x.exp() * (1.0 + 5e-6), 0.4);
        // A line along all 18 coordinates at once adds up their errors: √18 times 5e-6.
        assert!(!off.passes() && off.error < 2.5e-5 && off.nonsmooth == 0, "{off:?}");
    }

    #[test]
    fn a_steep_function_is_resolved_by_its_own_scale() {
        const WIDTH: f64 = 1e-6;
        let good = report(|x| (x / WIDTH).atan(), |x| WIDTH / (WIDTH * WIDTH + x * x), 0.0);
        assert!(good.passes(), "{good:?}");
    }

    #[test]
    fn nonsmooth_points_and_jumps_are_checked_on_both_sides() {
        for (f, slope) in [
            (f64::abs as fn(f64) -> f64, f64::signum as fn(f64) -> f64),
            (|x| x.sin() + f64::from(x > 0.0), f64::cos),
        ] {
            let good = report(f, slope, 0.0);
            assert!(good.passes() && good.nonsmooth > 0, "{good:?}");
        }
        // A nonsmooth point is no excuse for a wrong slope beside it, nor is a claimed one where the function is smooth.
        let wrong = report(f64::abs, |x| x.signum() * 1.001, 0.0);
        assert!(!wrong.passes(), "{wrong:?}");
        let invented = report(|x| x, |x| 1.0 + 0.1 * x.signum(), 0.0);
        assert!(!invented.passes(), "{invented:?}");
    }

    #[test]
    fn silence_must_be_silence() {
        assert!(report(|_| 2.0, |_| 0.0, 0.3).passes());
        assert!(!report(|x| x, |_| 0.0, 0.3).passes());
    }
}
