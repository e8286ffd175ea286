//! What a user says about a garment file, read from text.

use super::{FitSettings, Keep, SourceBody, Unit, UpAxis};
use crate::asset::{Category, GarmentMaterial};
use clothcombo_physics::vec3::is_finite;
use serde::Deserialize;
use std::fmt::Display;
use std::str::FromStr;
use std::sync::Arc;

/// Borders farther apart (m) are no seam.
const WIDEST_SEAM: f64 = 0.1;
/// No garment is made with its legs farther apart (degrees, each).
const WIDEST_STANCE: f64 = 60.0;
/// Once around (degrees).
const FULL_TURN: f64 = 360.0;
/// No file's origin is farther from the body (m).
const FARTHEST_ORIGIN: f64 = 1e4;

/// What is known about one garment: keys of an outfits file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GarmentHints {
    /// File or name.
    pub file: String,
    unit: Option<String>,
    up: Option<String>,
    arms: Option<String>,
    legs: Option<f64>,
    category: Option<String>,
    offset: Option<[f64; 3]>,
    turn: Option<f64>,
    keep: Option<String>,
    join_seams: Option<String>,
    from_body: Option<String>,
    /// What the garment is made of.
    #[serde(default)]
    pub material: GarmentMaterial,
}

impl GarmentHints {
    /// `all` with what is said here in its place; `beside` finds a file that is named here.
    ///
    /// # Errors
    /// Naming the key.
    pub fn settings(
        &self,
        all: &FitSettings,
        beside: impl Fn(&str) -> String,
    ) -> Result<FitSettings, String> {
        fn hint<T>(
            key: &str,
            text: &Option<String>,
            parse: impl Fn(&str) -> Result<T, String>,
        ) -> Result<Option<T>, String> {
            text.as_deref().map(parse).transpose().map_err(|e| format!("{key}: {e}"))
        }
        fn degrees(key: &str, given: Option<f64>, most: f64) -> Result<Option<f64>, String> {
            given.map(|g| angle(g, most, g)).transpose().map_err(|e| format!("{key}: {e}"))
        }
        let arms = hint("arms", &self.arms, Arms::from_str)?;
        let offset = self.offset.map(|numbers| within_reach(numbers, format_args!("{numbers:?}")));
        let source = |text: &str| {
            let found = match text.rsplit_once(':') {
                Some((path, shape)) if beside(text) == text => format!("{}:{shape}", beside(path)),
                _ => beside(text),
            };
            SourceBody::load(&found).map(Arc::new).map_err(|e| e.to_string())
        };
        Ok(FitSettings {
            from_body: hint("from_body", &self.from_body, source)?.or_else(|| all.from_body.clone()),
            unit: hint("unit", &self.unit, Unit::from_str)?.or(all.unit),
            up: hint("up", &self.up, UpAxis::from_str)?.or(all.up),
            arms_lowered: arms.map(|arms| arms == Arms::A).or(all.arms_lowered),
            legs_degrees: degrees("legs", self.legs, WIDEST_STANCE)?.or(all.legs_degrees),
            category: hint("category", &self.category, Category::from_str)?.or(all.category),
            offset: offset.transpose().map_err(|e| format!("offset: {e}"))?.or(all.offset),
            turn_degrees: degrees("turn", self.turn, FULL_TURN)?.or(all.turn_degrees),
            keep: hint("keep", &self.keep, Keep::from_str)?.unwrap_or(all.keep),
            join_seams: hint("join_seams", &self.join_seams, seam_width)?.or(all.join_seams),
        })
    }
}

/// How the arms of a garment are held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arms {
    /// Level.
    T,
    /// Lowered.
    A,
}

impl FromStr for Arms {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "t" => Ok(Self::T),
            "a" => Ok(Self::A),
            _ => Err(format!("'{text}' is no pose of the arms; known are t, a")),
        }
    }
}

/// Three numbers (m).
///
/// # Errors
/// When they are not, or are out of reach.
pub fn offset(text: &str) -> Result<[f64; 3], String> {
    let wrong = || no_offset(text);
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse::<f64>()).collect();
    let numbers: [f64; 3] = numbers.map_err(|_| wrong())?.try_into().map_err(|_| wrong())?;
    within_reach(numbers, text)
}

fn no_offset(text: impl Display) -> String {
    format!("'{text}' is not three numbers in metres such as 0,0.95,0")
}

/// `numbers` (m), called `text`.
fn within_reach(numbers: [f64; 3], text: impl Display) -> Result<[f64; 3], String> {
    if !is_finite(numbers) {
        return Err(no_offset(text));
    }
    match numbers.iter().all(|x| x.abs() <= FARTHEST_ORIGIN) {
        true => Ok(numbers),
        false => Err(format!("'{text}' is farther from the body than {FARTHEST_ORIGIN} m")),
    }
}

/// An angle about the vertical (degrees).
///
/// # Errors
/// When it is none.
pub fn turn(text: &str) -> Result<f64, String> {
    angle(text.parse().unwrap_or(f64::NAN), FULL_TURN, text)
}

/// The angle of a leg (degrees).
///
/// # Errors
/// When no leg is turned so far.
pub fn legs(text: &str) -> Result<f64, String> {
    angle(text.parse().unwrap_or(f64::NAN), WIDEST_STANCE, text)
}

/// `degrees`, called `text`, of at most so many to each side.
fn angle(degrees: f64, most: f64, text: impl Display) -> Result<f64, String> {
    match degrees.abs() <= most {
        true => Ok(degrees),
        false => Err(format!("'{text}' is no angle from -{most} to {most} degrees")),
    }
}

/// A length in metres, or with a unit; in metres.
///
/// # Errors
/// When it is none, or no seam is so wide.
pub fn seam_width(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let wrong = || format!("'{text}' is no distance such as 5mm, 0.5cm or 0.005 (metres)");
    let digits = text.find(|c: char| c.is_ascii_alphabetic() && !"eE".contains(c)).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let unit = match unit {
        "" => Unit::M,
        unit => unit.parse::<Unit>().map_err(|e| format!("{}: {e}", wrong()))?,
    };
    let metres = unit.metres() * number.trim().parse::<f64>().map_err(|_| wrong())?;
    match metres > 0.0 && metres <= WIDEST_SEAM {
        true => Ok(metres),
        false => Err(format!("'{text}' is not above 0 and at most {} mm", 1e3 * WIDEST_SEAM)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_have_units() {
        for (text, metres) in
            [("5mm", 0.005), ("0.5 cm", 0.005), ("0.005", 0.005), ("5e-3", 0.005), ("1inch", 0.0254)]
        {
            assert!((seam_width(text).unwrap() - metres).abs() < 1e-15, "{text}");
        }
        for text in ["", "mm", "5 feet", "-1mm", "0", "nan", "inf", "2", "1e400"] {
            assert!(seam_width(text).is_err(), "{text}");
        }
    }

    #[test]
    fn an_entry_comes_before_the_flags() {
        let all = FitSettings { unit: Some(Unit::M), up: Some(UpAxis::Z), ..FitSettings::default() };
        let entry: GarmentHints =
            toml::from_str("file = \"tee.obj\"\nunit = \"cm\"\nkeep = \"outer\"\noffset = [0.0, 1.0, 0.0]")
                .unwrap();
        let settings = entry.settings(&all, str::to_owned).unwrap();
        assert_eq!(
            (settings.unit, settings.up, settings.keep),
            (Some(Unit::Cm), Some(UpAxis::Z), Keep::Outer)
        );
        assert_eq!(settings.offset, Some([0.0, 1.0, 0.0]));
        let wrong: GarmentHints = toml::from_str("file = \"tee.obj\"\nup = \"north\"").unwrap();
        assert!(wrong.settings(&all, str::to_owned).unwrap_err().starts_with("up: 'north'"));
        assert!(toml::from_str::<GarmentHints>("file = \"tee.obj\"\nsize = 4").is_err());
        for (key, wrong) in
            [("offset", "offset = [0.0, 2e4, 0.0]"), ("legs", "legs = 70.0"), ("turn", "turn = nan")]
        {
            let entry: GarmentHints = toml::from_str(&format!("file = \"tee.obj\"\n{wrong}")).unwrap();
            let message = entry.settings(&all, str::to_owned).unwrap_err();
            assert!(message.starts_with(&format!("{key}: '")), "{message}");
        }
        let missing: GarmentHints = toml::from_str("file = \"tee.obj\"\nfrom_body = \"none.npz:1\"").unwrap();
        let message = missing.settings(&all, |path| format!("folder/{path}")).unwrap_err();
        assert!(message.starts_with("from_body: folder/none.npz"), "{message}");
    }
}
