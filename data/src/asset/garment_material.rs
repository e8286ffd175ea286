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

/// Thicker than this (m), a sheet without volume says little about it, and it is likely to be in another unit.
const THICKEST: f64 = 0.02;

impl GarmentMaterial {
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
        Self {
            thickness: self.thickness.or(other.thickness),
            density: self.density.or(other.density),
            lambda: self.lambda.or(other.lambda),
            mu: self.mu.or(other.mu),
            bending_stiffness: self.bending_stiffness.or(other.bending_stiffness),
        }
    }

    /// Whether cloth can be made of it.
    ///
    /// # Errors
    /// The first constant that is out of range, with what it should be.
    pub fn check(&self) -> Result<(), String> {
        let settings = EnergySettings { material: self.over(&Material::default()), ..Default::default() };
        settings.check().map_err(|e| e.to_string())?;
        match self.thickness {
            Some(thickness) if thickness > THICKEST => {
                Err(format!("material.thickness is {thickness}, thicker than {THICKEST} m; hint: in metres"))
            }
            _ => Ok(()),
        }
    }
}

impl FromStr for GarmentMaterial {
    type Err = String;

    /// Of `thickness=0.002,density=300`.
    fn from_str(text: &str) -> Result<Self, String> {
        let known = "thickness (m), density (kg/m³), lambda (Pa), mu (Pa), bending_stiffness (J/rad²)";
        let mut material = Self::default();
        for part in text.split(',') {
            let (key, value) = part
                .split_once('=')
                .ok_or_else(|| format!("'{part}' is not of the form key=value; keys: {known}"))?;
            let value: f64 = value.trim().parse().map_err(|_| format!("{key}: '{value}' is no number"))?;
            let slot = match key.trim() {
                "thickness" => &mut material.thickness,
                "density" => &mut material.density,
                "lambda" => &mut material.lambda,
                "mu" => &mut material.mu,
                "bending_stiffness" => &mut material.bending_stiffness,
                other => return Err(format!("'{other}' is no constant of a material; known: {known}")),
            };
            if slot.replace(value).is_some() {
                return Err(format!("{key} is given twice"));
            }
        }
        material.check()?;
        Ok(material)
    }
}

impl fmt::Display for GarmentMaterial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let constants = [
            ("thickness", self.thickness),
            ("density", self.density),
            ("lambda", self.lambda),
            ("mu", self.mu),
            ("bending_stiffness", self.bending_stiffness),
        ];
        let given = constants.iter().filter_map(|(key, value)| value.map(|value| format!("{key}={value}")));
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
            ("thickness=3", "in metres"),
        ] {
            let message = text.parse::<GarmentMaterial>().unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }
}
