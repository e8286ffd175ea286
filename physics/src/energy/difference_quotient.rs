//! Derivatives of a function along a line by difference quotients.
//!
//! **Step.** No single step suits a logarithm near contact and a polynomial a kilometre away. Quotients of a falling ladder
//! of steps are extrapolated to zero (Ridders, "Accurate computation of F'(x) and F'(x)F''(x)", 1982), and the entry with the
//! smallest error estimate is taken; the estimate includes the rounding of the value and never looks at the gradient that
//! is being tested.
//!
//! **Nonsmooth points.** Nearest vertices, the repulsion's radius and the gates change in jumps, and the angle of a
//! hinge is not smooth at π: there is no derivative there. A line is excused from the central check only if the jump is
//! *shown*: the gradient, or the part of the value that the gradient does not explain (the residual of the trapezoid
//! rule), must differ between the two ends of the line and fail to shrink with its length. Of a differentiable function
//! both shrink at least linearly, even if the gradient is wrong. On such a line both sides are checked instead, each
//! with quotients that stay on it. At the point itself no derivative exists; what the term returns there is the
//! gradient of one of its sides, and bounded by [`super::gradient_bound`] like any other.

use crate::vec3;

/// Largest relative difference between a gradient and its quotients that counts as agreement.
pub const GRADIENT_TOLERANCE: f64 = 1e-6;

/// Ratio of one step of the ladder to the next.
const LADDER: f64 = 4.0;

/// Steps of the ladder.
const RUNGS: usize = 9;

/// Uncertainty of a quotient, in units of the tolerance, below which no further step is tried.
const CERTAIN: f64 = 0.02;

/// The larger one; NaN if either is, where `f64::max` would hide it.
pub(super) fn nan_max(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// A direction: coordinates `3·vertex + axis` and their components.
pub(super) type Line = Vec<(usize, f64)>;

/// A function at positions that can be moved.
pub(super) struct Probe<'a> {
    pub value: &'a (dyn Fn(&[[f64; 3]]) -> f64 + Sync),
    pub gradient: &'a (dyn Fn(&[[f64; 3]]) -> (f64, Vec<[f64; 3]>) + Sync),
    pub positions: &'a [[f64; 3]],
}

impl Probe<'_> {
    fn moved(&self, line: &[(usize, f64)], t: f64) -> Vec<[f64; 3]> {
        let mut positions = self.positions.to_vec();
        for &(c, component) in line {
            positions[c / 3][c % 3] += t * component;
        }
        positions
    }

    pub fn evaluate(&self, line: &[(usize, f64)], t: f64) -> (f64, Vec<[f64; 3]>) {
        (self.gradient)(&self.moved(line, t))
    }

    fn value(&self, line: &[(usize, f64)], t: f64) -> f64 {
        (self.value)(&self.moved(line, t))
    }
}

fn along(gradient: &[[f64; 3]], line: &[(usize, f64)]) -> f64 {
    line.iter().map(|&(c, component)| gradient[c / 3][c % 3] * component).sum()
}

/// A derivative by quotients, and how far off it may be by its own estimate.
#[derive(Debug, Clone, Copy)]
struct Quotient {
    derivative: f64,
    uncertainty: f64,
}

pub(super) struct LineResult {
    /// Difference between the derivative that is checked and the quotient.
    pub error: f64,
    /// How far off the quotient may be by its own estimate.
    pub resolution: f64,
    /// Whether the two sides of the origin were compared.
    pub is_nonsmooth: bool,
}

pub(super) struct Ladder {
    pub first: f64,
    /// Steps are multiples of this (m).
    pub unit: f64,
    /// What errors are relative to.
    pub scale: f64,
}

impl Ladder {
    pub fn check(&self, probe: &Probe<'_>, line: &Line, gradient: &[[f64; 3]]) -> LineResult {
        let expected = along(gradient, line);
        let quotient = self.quotient(probe, line, 0.0, self.first);
        let error = (quotient.derivative - expected).abs();
        let result = LineResult { error, resolution: quotient.uncertainty, is_nonsmooth: false };
        if error <= GRADIENT_TOLERANCE * self.scale || !self.jumps(probe, line) {
            return result;
        }
        let [left, right] = [-1.0, 1.0].map(|side| self.side(probe, line, side));
        LineResult {
            error: nan_max(left.error, right.error),
            resolution: left.resolution.max(right.resolution),
            is_nonsmooth: true,
        }
    }

    /// Whether something jumps at the origin of the line: see the module.
    fn jumps(&self, probe: &Probe<'_>, line: &Line) -> bool {
        let across = |h: f64| {
            let [(low, before), (high, after)] = [-h, h].map(|t| probe.evaluate(line, t));
            let pairs = before.iter().zip(&after);
            let gradient = pairs.map(|(a, b)| vec3::norm(vec3::sub(*a, *b))).fold(0.0, nan_max);
            let explained = h * (along(&before, line) + along(&after, line));
            let noise = 8.0 * f64::EPSILON * (low.abs() + high.abs());
            let residual = (high - low - explained).abs();
            (gradient, if residual > noise { residual } else { 0.0 })
        };
        // A jump persists, everything else shrinks at least in proportion.
        let persists = |wide: f64, narrow: f64| narrow > 2.0 / LADDER * wide;
        let steps: Vec<f64> = self.steps(self.first).collect();
        steps.windows(2).rev().any(|pair| {
            let (wide, narrow) = (across(pair[0]), across(pair[1]));
            (persists(wide.0, narrow.0) && narrow.0 > GRADIENT_TOLERANCE * self.scale)
                || persists(wide.1, narrow.1)
        })
    }

    /// The check on one side of a nonsmooth point: the best of several distances from it, with quotients that do not reach it.
    fn side(&self, probe: &Probe<'_>, line: &Line, side: f64) -> LineResult {
        let mut best = LineResult { error: f64::INFINITY, resolution: 0.0, is_nonsmooth: true };
        for distance in self.steps(self.first) {
            let centre = side * distance;
            let expected = along(&probe.evaluate(line, centre).1, line);
            let quotient = self.quotient(probe, line, centre, 0.5 * distance);
            let error = (quotient.derivative - expected).abs();
            if error < best.error {
                best = LineResult { error, resolution: quotient.uncertainty, is_nonsmooth: true };
            }
            if best.error <= GRADIENT_TOLERANCE * self.scale {
                break;
            }
        }
        best
    }

    fn steps(&self, first: f64) -> impl Iterator<Item = f64> {
        let unit = self.unit;
        let rounded = move |k: i32| (first * LADDER.powi(-k) / unit).round() * unit;
        (0..RUNGS as i32).map(rounded).filter(|h: &f64| *h > 0.0)
    }

    /// Ridders' extrapolation of central differences about `centre`.
    fn quotient(&self, probe: &Probe<'_>, line: &Line, centre: f64, first: f64) -> Quotient {
        let mut best = Quotient { derivative: 0.0, uncertainty: f64::INFINITY };
        let mut previous: Vec<f64> = Vec::new();
        for h in self.steps(first) {
            let (low, high) = (probe.value(line, centre - h), probe.value(line, centre + h));
            let rounding = f64::EPSILON * (low.abs() + high.abs()) / h;
            let mut row = vec![(high - low) / (2.0 * h)];
            let mut factor = 1.0;
            for column in 1..=previous.len() {
                factor *= LADDER * LADDER;
                let finer = row[column - 1];
                let extrapolated = (factor * finer - previous[column - 1]) / (factor - 1.0);
                let spread =
                    nan_max((extrapolated - finer).abs(), (extrapolated - previous[column - 1]).abs());
                let uncertainty = spread + rounding;
                if uncertainty < best.uncertainty {
                    best = Quotient { derivative: extrapolated, uncertainty };
                }
                row.push(extrapolated);
            }
            previous = row;
            if previous.len() >= 3 && best.uncertainty <= CERTAIN * GRADIENT_TOLERANCE * self.scale {
                break;
            }
        }
        best
    }
}
