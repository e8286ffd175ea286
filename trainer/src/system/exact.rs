//! f64 values in JSON that come back to the bit, NaN and infinities included: as text.
//!
//! JSON numbers know no NaN, and `serde_json` reads the last digit of some of them differently than they were.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::fmt;

/// A number that is written as text, for example `"-0.25"` or `"NaN"`.
#[derive(Clone, Copy, PartialEq, PartialOrd, Default)]
pub struct Exact(pub f64);

impl Exact {
    /// Whether both are the same number to the bit, or both NaN (whose bits carry nothing).
    pub fn same(self, other: Self) -> bool {
        self.0.to_bits() == other.0.to_bits() || (self.0.is_nan() && other.0.is_nan())
    }
}

impl From<f64> for Exact {
    fn from(value: f64) -> Self {
        Self(value)
    }
}

impl fmt::Debug for Exact {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        fmt::Debug::fmt(&self.0, f)
    }
}

impl Serialize for Exact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // Rust prints the shortest text that reads back to the same bits.
        serializer.collect_str(&format_args!("{:?}", self.0))
    }
}

impl<'de> Deserialize<'de> for Exact {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map(Self).map_err(|_| de::Error::custom(format!("{text:?} is not a number")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_comes_back() {
        let tricky = [0.1 + 0.2, -0.0, f64::MIN_POSITIVE / 3.0, f64::MAX, 1.0 / 3.0, f64::INFINITY, f64::NAN];
        let values: Vec<Exact> = tricky.map(Exact).to_vec();
        let text = serde_json::to_string(&values).unwrap();
        let again: Vec<Exact> = serde_json::from_str(&text).unwrap();
        assert!(values.iter().zip(&again).all(|(a, b)| a.same(*b)), "{text}");
        assert!(serde_json::from_str::<Exact>("\"one\"").is_err());
    }
}
