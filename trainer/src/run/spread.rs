//! Mean, median and 95th percentile.

use serde::{Serialize, Serializer};

/// Mean, median and 95th percentile over scenes.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Spread {
    /// Mean.
    #[serde(serialize_with = "number_or_text")]
    pub mean: f64,
    /// Median.
    #[serde(serialize_with = "number_or_text")]
    pub median: f64,
    /// 95th percentile.
    #[serde(serialize_with = "number_or_text")]
    pub p95: f64,
}

impl Spread {
    /// The spread of `values`; all zero when there are none.
    pub fn of(mut values: Vec<f64>) -> Self {
        if values.is_empty() {
            return Self::default();
        }
        values.sort_by(f64::total_cmp);
        let n = values.len();
        let median = 0.5 * (values[(n - 1) / 2] + values[n / 2]);
        let p95 = values[((n as f64 * 0.95).ceil() as usize).clamp(1, n) - 1];
        Self { mean: values.iter().sum::<f64>() / n as f64, median, p95 }
    }
}

/// A number that JSON knows as it is; infinities and NaN as text, so that they do not look like missing values.
///
/// # Errors
/// The serializer's.
pub fn number_or_text<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    match value.is_finite() {
        true => serializer.serialize_f64(*value),
        false => serializer.collect_str(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_of_known_values() {
        let s = Spread::of((1..=100).map(f64::from).collect());
        assert_eq!((s.mean, s.median, s.p95), (50.5, 50.5, 95.0));
        assert_eq!(Spread::of(vec![7.0]).p95, 7.0);
    }
}
