//! What one garment is made of, where that is not what all others are made of.

use clothcombo_physics::energy::{EnergySettings, Material};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Constants of a garment's cloth that take the place of those of a model's configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GarmentMaterial {
    /// Thickness (m). Positions are those of the middle of the cloth: it is kept half of it off the body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness: Option<f64>,
    /// Density (kg/m³): what a square metre weighs over its thickness.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// First Lamé constant λ (Pa).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lambda: Option<f64>,
    /// Second Lamé constant μ (Pa).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mu: Option<f64>,
    /// Bending stiffness of a hinge (J/rad²).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bending_stiffness: Option<f64>,
}

/// Names of the constants with their units, and the most that each can be in cloth: what is more is likely to be in another
/// unit. 2 cm are a quilt; 10 t/m³ are heavier than a mesh of steel; 10 GPa are stiffer than nylon; a hinge of 1 J/rad² is that of
/// a millimetre of hard plastic (E h³/12).
const CONSTANTS: [(&str, &str, f64); 5] = [
    ("thickness", "m", 0.02),
    ("density", "kg/m³", 1e4),
    ("lambda", "Pa", 1e10),
    ("mu", "Pa", 1e10),
    ("bending_stiffness", "J/rad²", 1.0),
];

impl GarmentMaterial {
    /// In the order of [`CONSTANTS`].
    fn values(&self) -> [Option<f64>; 5] {
        [self.thickness, self.density, self.lambda, self.mu, self.bending_stiffness]
    }

    fn of_values([thickness, density, lambda, mu, bending_stiffness]: [Option<f64>; 5]) -> Self {
        Self { thickness, density, lambda, mu, bending_stiffness }
    }

    /// Whether it says nothing.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// `base` with what is said here in its place.
    #[must_use]
    pub fn over(&self, base: &Material) -> Material {
        Material {
            thickness: self.thickness.unwrap_or(base.thickness),
            density: self.density.unwrap_or(base.density),
            lambda: self.lambda.unwrap_or(base.lambda),
            mu: self.mu.unwrap_or(base.mu),
            bending_stiffness: self.bending_stiffness.unwrap_or(base.bending_stiffness),
        }
    }

    /// The same with what only `other` says.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        let (own, others) = (self.values(), other.values());
        Self::of_values(std::array::from_fn(|i| own[i].or(others[i])))
    }

    /// Whether cloth can be made of it.
    ///
    /// # Errors
    /// The first constant that is out of range, with what it should be.
    pub fn check(&self) -> Result<(), String> {
        let settings = EnergySettings { material: self.over(&Material::default()), ..Default::default() };
        settings.check().map_err(|e| e.to_string())?;
        let is_too_much = |(value, (_, _, most)): &(Option<f64>, _)| value.is_some_and(|value| value > *most);
        match self.values().into_iter().zip(CONSTANTS).find(is_too_much) {
            Some((value, (name, unit, most))) => Err(format!(
                "material.{name} is {}, more than any cloth's ({most} {unit}); hint: it is in {unit}",
                value.unwrap_or_default()
            )),
            None => Ok(()),
        }
    }
}

impl FromStr for GarmentMaterial {
    type Err = String;

    /// Of `thickness=0.002,density=300`.
    fn from_str(text: &str) -> Result<Self, String> {
        let known = CONSTANTS.map(|(name, unit, _)| format!("{name} ({unit})")).join(", ");
        let mut values = [None; 5];
        for part in text.split(',') {
            let (key, value) = part
                .split_once('=')
                .ok_or_else(|| format!("'{part}' is not of the form key=value; keys: {known}"))?;
            let key = key.trim();
            let value: f64 = value.trim().parse().map_err(|_| format!("{key}: '{value}' is no number"))?;
            let place = CONSTANTS
                .iter()
                .position(|(name, ..)| *name == key)
                .ok_or_else(|| format!("'{key}' is no constant of a material; known: {known}"))?;
            if values[place].replace(value).is_some() {
                return Err(format!("{key} is given twice"));
            }
        }
        let material = Self::of_values(values);
        material.check()?;
        Ok(material)
    }
}

impl fmt::Display for GarmentMaterial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let constants = CONSTANTS.iter().zip(self.values());
        let given = constants.filter_map(|((name, ..), value)| value.map(|value| format!("{name}={value}")));
        f.write_str(&given.collect::<Vec<_>>().join(","))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_given_stays_as_it_is() {
        let material: GarmentMaterial = "thickness=0.003, density=120".parse().unwrap();
        let base = Material { mu: 1.0, ..Material::default() };
        let made = material.over(&base);
        assert_eq!(made, Material { thickness: 0.003, density: 120.0, ..base });
        assert_eq!(material.to_string().parse(), Ok(material));
        assert!(!material.is_empty() && GarmentMaterial::default().is_empty());
        let of_folder: GarmentMaterial = "thickness=0.001,mu=7".parse().unwrap();
        assert_eq!(material.or(of_folder).to_string(), "thickness=0.003,density=120,mu=7");
    }

    #[test]
    fn mistakes_are_named() {
        for (text, part) in [
            ("thickness", "key=value"),
            ("colour=1", "bending_stiffness"),
            ("mu=soft", "'soft' is no number"),
            ("mu=1,mu=2", "twice"),
            ("thickness=0", "greater than 0"),
            ("density=-1", "not negative"),
            ("lambda=nan", "finite"),
            ("thickness=3", "it is in m"),
            ("bending_stiffness=1e300", "more than any cloth's (1 J/rad²)"),
            ("density=0.2,mu=1e12", "material.mu"),
        ] {
            let message = text.parse::<GarmentMaterial>().unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }
}
