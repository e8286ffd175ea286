//! A step length with Armijo's decrease and the weak Wolfe slope, by bracketing.
//!
//! Lewis and Overton, "Nonsmooth optimization via quasi-Newton methods" (Math. Prog. 2013), algorithm 2.6: it ends after
//! finitely many trials at almost every nonsmooth point. A trial that is too long is followed by the minimum of the parabola through
//! value and slope at the start and the value of the trial, kept away from the ends of the bracket.

/// Armijo: the share of the decrease that the slope at the start predicts.
const DECREASE: f64 = 1e-4;

/// Wolfe: the share of the slope at the start that may remain.
const SLOPE: f64 = 0.9;

/// Most trials.
const TRIALS: usize = 40;

/// How close to the ends of a bracket an interpolated trial may lie, as a share of the bracket.
const INTERPOLATION_MARGIN: f64 = 0.1;

/// A trial of the line search.
pub(super) struct Trial<S> {
    /// Energy there.
    pub value: f64,
    /// Its derivative along the line.
    pub slope: f64,
    /// Whatever the caller keeps of it.
    pub state: S,
}

/// Searches from a point of energy `value` and derivative `slope < 0`; steps are at most `longest`. Returns step length and
/// trial; `None` if no trial had the decrease.
///
/// If only the decrease can be had (the longest step is still steep, or trials ran out) the lowest such trial is taken.
pub(super) fn search<S>(
    value: f64,
    slope: f64,
    longest: f64,
    mut evaluate: impl FnMut(f64) -> Trial<S>,
) -> Option<(f64, Trial<S>)> {
    let (mut low, mut high) = (0.0, f64::INFINITY);
    let mut length = longest.min(1.0);
    let mut best: Option<(f64, Trial<S>)> = None;
    for _ in 0..TRIALS {
        let trial = evaluate(length);
        let expected = value + DECREASE * length * slope;
        // Written so that NaN is too far; the last condition keeps the energy falling where the product rounds to nothing.
        if !(trial.value <= expected && trial.value < value) {
            high = length;
            let rise = trial.value - value - slope * length;
            let parabola = -0.5 * slope * length * length / rise;
            let width = high - low;
            let middle = low + 0.5 * width;
            length = match low == 0.0 && parabola.is_finite() {
                true => parabola.clamp(low + INTERPOLATION_MARGIN * width, middle),
                false => middle,
            };
            continue;
        }
        let steep = trial.slope < SLOPE * slope;
        if !steep || length >= longest {
            return Some((length, trial));
        }
        if best.as_ref().is_none_or(|(_, b)| trial.value <= b.value) {
            best = Some((length, trial));
        }
        low = length;
        length = if high.is_finite() { 0.5 * (low + high) } else { (2.0 * length).min(longest) };
        if length <= low {
            return best;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(f: impl Fn(f64) -> (f64, f64)) -> impl Fn(f64) -> Trial<()> {
        move |t| {
            let (value, slope) = f(t);
            Trial { value, slope, state: () }
        }
    }

    #[test]
    fn finds_a_step_far_from_one() {
        for minimum in [1e-6, 1e-3, 1.0, 50.0] {
            let f = |t: f64| ((t - minimum).powi(2), 2.0 * (t - minimum));
            let (value, slope) = f(0.0);
            let (t, found) = search(value, slope, 1e3, trial(f)).unwrap();
            assert!(found.value < value && found.slope >= SLOPE * slope, "{minimum}: {t}");
        }
    }

    #[test]
    fn steps_over_a_nonsmooth_point_and_stops_before_a_discontinuity() {
        // |t − 0.3| − …: the slope condition can only hold beyond the nonsmooth point.
        let bent = |t: f64| if t < 0.3 { (0.3 - t, -1.0) } else { (2.0 * (t - 0.3), 2.0) };
        let (t, found) = search(0.3, -1.0, 10.0, trial(bent)).unwrap();
        assert!(t > 0.3 && found.value < 0.3);
        // Falls to the discontinuity at 0.2, where it jumps up: only decrease can be had.
        let jump = |t: f64| if t < 0.2 { (-t, -1.0) } else { (100.0, -1.0) };
        let (t, found) = search(0.0, -1.0, 10.0, trial(jump)).unwrap();
        assert!(t < 0.2 && t > 0.19 && found.value < 0.0);
        // The discontinuity is where we are.
        assert!(search(0.0, -1.0, 10.0, trial(|_| (1.0, -1.0))).is_none());
        assert!(search(0.0, -1.0, 10.0, trial(|_| (f64::NAN, f64::NAN))).is_none());
    }

    #[test]
    fn never_longer_than_allowed() {
        let (t, _) = search(0.0, -1.0, 0.25, trial(|t| (-t, -1.0))).unwrap();
        assert_eq!(t, 0.25);
    }
}
