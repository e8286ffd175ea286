//! A linear or logarithmic axis with round ticks.

/// The range of an axis ignores values of larger magnitude, so that differences and logarithms stay finite.
const DRAWABLE_LIMIT: f64 = 1e30;
/// Smallest ratio of largest to smallest value for which a logarithmic axis says more than a linear one.
const LOG_RATIO: f64 = 3.0;
/// Decades shown at most below the largest value.
const DECADES: f64 = 9.0;
/// Free space beyond the extreme values, as a share of the axis.
const AXIS_MARGIN: f64 = 0.07;

/// An axis over a fixed range.
#[derive(Clone, Debug)]
pub(crate) struct ChartAxis {
    low: f64,
    high: f64,
    is_logarithmic: bool,
}

impl ChartAxis {
    /// An axis over exactly this range; a range without extent is widened.
    pub(crate) fn linear(low: f64, high: f64) -> Self {
        let (low, high) = widened(low, high);
        Self { low, high, is_logarithmic: false }
    }

    /// The axis that shows all `values` with a margin: logarithmic where none is negative and the positive ones spread
    /// over more than a factor of [`LOG_RATIO`], else linear. Zeros then lie on the lower edge.
    pub(crate) fn fitting(values: impl Iterator<Item = f64> + Clone) -> Self {
        let drawable = values.filter(|value| value.abs() < DRAWABLE_LIMIT);
        let low = drawable.clone().fold(f64::INFINITY, f64::min);
        let high = drawable.clone().fold(f64::NEG_INFINITY, f64::max);
        if low > high {
            return Self::linear(0.0, 1.0);
        }
        let positive = drawable.filter(|&value| value > 1.0 / DRAWABLE_LIMIT).fold(f64::INFINITY, f64::min);
        if low >= 0.0 && positive.is_finite() && high > LOG_RATIO * positive {
            let (low, high) = (positive.log10().max(high.log10() - DECADES), high.log10());
            let margin = AXIS_MARGIN * (high - low);
            return Self {
                low: 10_f64.powf(low - margin),
                high: 10_f64.powf(high + margin),
                is_logarithmic: true,
            };
        }
        let (low, high) = widened(low, high);
        let margin = AXIS_MARGIN * (high - low);
        Self { low: low - margin, high: high + margin, is_logarithmic: false }
    }

    /// Position of `value` from 0 to 1. A value outside the range is at the nearer end, one that is no number at the lower.
    pub(crate) fn share(&self, value: f64) -> f64 {
        let value = value.max(self.low).min(self.high);
        if self.is_logarithmic {
            let low = self.low.log10();
            (value.log10() - low) / (self.high.log10() - low)
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// At most about `count` round values inside the range, ascending.
    pub(crate) fn ticks(&self, count: usize) -> Vec<f64> {
        let count = count.clamp(2, 50);
        if !self.is_logarithmic {
            let step = round_step((self.high - self.low) / count as f64);
            let first = (self.low / step).ceil();
            return (0..=count)
                .map(|k| (first + k as f64) * step)
                .filter(|&value| value <= self.high)
                .collect();
        }
        let (low, high) = (self.low.log10(), self.high.log10());
        let per_decade = count as f64 / (high - low);
        let mantissas: &[f64] = match per_decade {
            6.0.. => &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0],
            3.0.. => &[1.0, 2.0, 5.0],
            2.0.. => &[1.0, 3.0],
            _ => &[1.0],
        };
        let stride = ((high - low) / count as f64).ceil().max(1.0) as usize;
        (low.floor() as i32..=high.ceil() as i32)
            .step_by(stride)
            .flat_map(|decade| mantissas.iter().map(move |mantissa| mantissa * 10_f64.powi(decade)))
            .filter(|value| (self.low..=self.high).contains(value))
            .collect()
    }

    /// The label of a tick: as many digits as tell neighbouring ticks apart.
    pub(crate) fn label(&self, tick: f64) -> String {
        if self.is_logarithmic {
            return number_text(tick, 2);
        }
        let (range, size) = (self.high - self.low, self.low.abs().max(self.high.abs()));
        let digits = (size / range).log10().ceil().clamp(0.0, 8.0) as usize + 2;
        if tick.abs() < 1e-9 * range { "0".to_owned() } else { number_text(tick, digits) }
    }
}

/// The range, made wider than rounding errors where it is not.
fn widened(low: f64, high: f64) -> (f64, f64) {
    let size = low.abs().max(high.abs());
    if high - low > 1e-6 * size && high > low {
        return (low, high);
    }
    let half = if size > 1e-12 { 0.1 * size } else { 1.0 };
    (low - half, high + half)
}

/// The smallest of 1, 2 and 5 times a power of ten that is not below `step`.
fn round_step(step: f64) -> f64 {
    let decade = 10_f64.powf(step.log10().floor());
    [1.0, 2.0, 5.0]
        .into_iter()
        .map(|mantissa| mantissa * decade)
        .find(|&rounded| rounded >= step * (1.0 - 1e-9))
        .unwrap_or(10.0 * decade)
}

/// A number in a few characters: plain where that is short, else with an exponent.
pub(crate) fn number_text(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor();
    if !(-3.0..6.0).contains(&magnitude) {
        let text = format!("{value:.*e}", digits.saturating_sub(1));
        return match text.split_once('e') {
            Some((mantissa, exponent)) if mantissa.contains('.') => {
                format!("{}e{exponent}", mantissa.trim_end_matches('0').trim_end_matches('.'))
            }
            _ => text,
        };
    }
    let decimals = (digits as f64 - 1.0 - magnitude).max(0.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_is_logarithmic_only_where_that_helps() {
        let fitting = |values: &[f64]| ChartAxis::fitting(values.iter().copied());
        assert!(fitting(&[0.01, 5.0]).is_logarithmic);
        assert!(fitting(&[0.0, 0.01, 5.0]).is_logarithmic);
        assert!(!fitting(&[-0.01, 5.0]).is_logarithmic);
        assert!(!fitting(&[1.0, 2.0]).is_logarithmic);
        assert!(!fitting(&[]).is_logarithmic);
        let wild = [f64::NAN, f64::INFINITY, 1e300, -1e300, 1e-300, 0.0, 7.0, -7.0];
        for &a in &wild {
            for &b in &wild {
                let axis = fitting(&[a, b]);
                assert!(axis.low < axis.high && (axis.high - axis.low).is_finite(), "{a} {b}: {axis:?}");
                assert!((0.0..=1.0).contains(&axis.share(1.0)));
            }
        }
    }

    #[test]
    fn ticks_are_round_inside_and_few() {
        let cases = [
            (0.013, 820.0),
            (1.0, 4.0),
            (2.0, 2.1),
            (-3.0, 9.0),
            (-0.4632, -0.4631),
            (1e-9, 1e9),
            (3.1, 9.9),
        ];
        for (low, high) in cases {
            let axis = ChartAxis::fitting([low, high].into_iter());
            for count in [3, 5, 8] {
                let ticks = axis.ticks(count);
                assert!(ticks.len() >= 2 && ticks.len() <= count + 2, "{axis:?} {count}: {ticks:?}");
                assert!(ticks.iter().all(|tick| (axis.low..=axis.high).contains(tick)));
                let texts: Vec<String> = ticks.iter().map(|tick| axis.label(*tick)).collect();
                for (tick, text) in ticks.iter().zip(&texts) {
                    let read: f64 = text.parse().unwrap();
                    assert!(
                        (read - tick).abs() <= 1e-6 * tick.abs().max(axis.high - axis.low),
                        "{tick} {text}"
                    );
                }
            }
        }
    }

    #[test]
    fn numbers_are_short() {
        let cases: [(f64, &str); 8] = [
            (0.0, "0"),
            (0.04123, "0.0412"),
            (2.0, "2"),
            (1234.5, "1234"),
            (-0.463, "-0.463"),
            (1.5e-7, "1.5e-7"),
            (2e9, "2e9"),
            (222.5, "222"),
        ];
        for (value, text) in cases {
            assert_eq!(number_text(value, 3), text);
        }
    }
}
