//! A value that may change during training: a number, or a ramp between two numbers.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, MapAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt;

/// How a ramp goes from one value to the other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RampShape {
    /// Straight line.
    #[default]
    Linear,
    /// Equal factors in equal times (both ends must be positive): the usual choice for learning rates.
    Geometric,
    /// Half a cosine wave: slow at both ends, as learning rates are often decayed.
    Cosine,
}

/// `weight = 1.0`, or `weight = { from = 1.0, to = 4.0, start = 0.5, end = 1.0 }`.
///
/// `start` and `end` are fractions of the span the value lives in: the whole run for a loss weight, the stage for
/// everything written inside a stage. Before `start` the value is `from`, after `end` it is `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    /// Value up to `start`.
    pub from: f64,
    /// Value from `end` on.
    pub to: f64,
    /// Fraction of the span at which the change begins.
    pub start: f64,
    /// Fraction of the span at which the change ends.
    pub end: f64,
    /// Shape of the change.
    pub shape: RampShape,
}

impl Ramp {
    /// A value that never changes.
    pub const fn constant(value: f64) -> Self {
        Self { from: value, to: value, start: 0.0, end: 1.0, shape: RampShape::Linear }
    }

    /// The value at `progress` (fraction of the span, 0–1).
    pub fn at(&self, progress: f64) -> f64 {
        let t = if self.end > self.start {
            ((progress - self.start) / (self.end - self.start)).clamp(0.0, 1.0)
        } else if progress < self.start {
            0.0
        } else {
            1.0
        };
        match self.shape {
            RampShape::Linear => self.from + (self.to - self.from) * t,
            RampShape::Geometric => self.from * (self.to / self.from).powf(t),
            RampShape::Cosine => self.from + (self.to - self.from) * (0.5 - 0.5 * (PI * t).cos()),
        }
    }

    /// What is wrong with the ramp, if anything.
    pub fn problem(&self) -> Option<&'static str> {
        if ![self.from, self.to, self.start, self.end].iter().all(|v| v.is_finite()) {
            Some("a value is not a finite number")
        } else if !(0.0..=1.0).contains(&self.start) || !(0.0..=1.0).contains(&self.end) {
            Some("`start` and `end` are fractions between 0 and 1")
        } else if self.end < self.start {
            Some("`end` comes before `start`")
        } else if self.shape == RampShape::Geometric && !(self.from > 0.0 && self.to > 0.0) {
            Some("a geometric ramp needs positive `from` and `to`")
        } else if self.shape == RampShape::Geometric && !(self.to / self.from).is_normal() {
            Some("`from` and `to` of a geometric ramp are too far apart")
        } else if !(self.to - self.from).is_finite() {
            Some("`from` and `to` are too far apart")
        } else {
            None
        }
    }
}

impl From<f64> for Ramp {
    fn from(value: f64) -> Self {
        Self::constant(value)
    }
}

/// The table form, kept apart so that serde derives its field checks.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RampTable {
    /// Value up to `start`.
    from: f64,
    /// Value from `end` on.
    to: f64,
    /// Fraction of the span at which the change begins.
    #[serde(default)]
    start: f64,
    /// Fraction of the span at which the change ends.
    #[serde(default = "one")]
    end: f64,
    /// Shape of the change.
    #[serde(default)]
    shape: RampShape,
}

impl JsonSchema for Ramp {
    fn schema_name() -> Cow<'static, str> {
        "Ramp".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let table = generator.subschema_for::<RampTable>();
        json_schema!({
            "description": "A number, or a ramp between two numbers over a part of the span it lives in: the whole run for \
                the weight of a loss, the stage for everything inside a stage.",
            "anyOf": [{ "type": "number" }, table],
        })
    }
}

impl fmt::Display for Ramp {
    /// `5`, or `0 → 1 (0–40 %)`.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.from == self.to {
            return write!(f, "{}", self.from);
        }
        let percent = |share: f64| (100.0 * share).round();
        write!(f, "{} → {} ({}–{} %", self.from, self.to, percent(self.start), percent(self.end))?;
        match self.shape {
            RampShape::Linear => write!(f, ")"),
            RampShape::Geometric => write!(f, ", geometric)"),
            RampShape::Cosine => write!(f, ", cosine)"),
        }
    }
}

fn one() -> f64 {
    1.0
}

impl Serialize for Ramp {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.from == self.to {
            return serializer.serialize_f64(self.from);
        }
        RampTable { from: self.from, to: self.to, start: self.start, end: self.end, shape: self.shape }
            .serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Ramp {
    // A visitor instead of `#[serde(untagged)]`, which would swallow the reason and the place of an error.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct RampVisitor;
        impl<'de> Visitor<'de> for RampVisitor {
            type Value = Ramp;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number or a ramp { from, to, start, end, shape }")
            }
            fn visit_f64<E: de::Error>(self, v: f64) -> Result<Ramp, E> {
                match Ramp::constant(v).problem() {
                    Some(problem) => Err(E::custom(problem)),
                    None => Ok(Ramp::constant(v)),
                }
            }
            fn visit_i64<E: de::Error>(self, v: i64) -> Result<Ramp, E> {
                Ok(Ramp::constant(v as f64))
            }
            fn visit_u64<E: de::Error>(self, v: u64) -> Result<Ramp, E> {
                Ok(Ramp::constant(v as f64))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Ramp, A::Error> {
                let t = RampTable::deserialize(MapAccessDeserializer::new(map))?;
                let ramp = Ramp { from: t.from, to: t.to, start: t.start, end: t.end, shape: t.shape };
                match ramp.problem() {
                    Some(problem) => Err(de::Error::custom(problem)),
                    None => Ok(ramp),
                }
            }
        }
        deserializer.deserialize_any(RampVisitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Serialize, Deserialize)]
    struct Holder {
        weight: Ramp,
    }

    #[test]
    fn number_and_table_read_and_write() {
        let h: Holder = toml::from_str("weight = 5").unwrap();
        assert_eq!(h.weight, Ramp::constant(5.0));
        let h: Holder = toml::from_str("weight = { from = 1.0, to = 4.0, start = 0.5 }").unwrap();
        assert_eq!((h.weight.at(0.2), h.weight.at(0.75), h.weight.at(1.0)), (1.0, 2.5, 4.0));
        let again: Holder = toml::from_str(&toml::to_string(&h).unwrap()).unwrap();
        assert_eq!(again.weight, h.weight);
    }

    #[test]
    fn geometric_ramp_has_equal_factors() {
        let r = Ramp { from: 1e-2, to: 1e-4, start: 0.0, end: 1.0, shape: RampShape::Geometric };
        assert!((r.at(0.5) - 1e-3).abs() < 1e-12);
    }

    #[test]
    fn cosine_ramp_starts_and_ends_flat() {
        let r = Ramp { from: 1.0, to: 0.0, start: 0.0, end: 1.0, shape: RampShape::Cosine };
        assert_eq!((r.at(0.0), r.at(1.0)), (1.0, 0.0));
        assert!((r.at(0.5) - 0.5).abs() < 1e-12 && r.at(0.1) > 0.97 && r.at(0.9) < 0.03);
    }

    #[test]
    fn a_wrong_ramp_says_why() {
        let e = toml::from_str::<Holder>("weight = { from = 1.0, to = 2.0, start = 0.9, end = 0.1 }");
        assert!(e.unwrap_err().to_string().contains("`end` comes before `start`"));
        let e = toml::from_str::<Holder>("weight = { from = 1.0, too = 2.0 }");
        assert!(e.unwrap_err().to_string().contains("too"));
        assert!(toml::from_str::<Holder>("weight = nan").unwrap_err().to_string().contains("finite"));
    }
}
