//! What is known about garment files: flags of `fit` and `drape`, and keys of an outfits file.

use clap::Args;
use clothcombo_data::asset::Category;
use clothcombo_data::fit::{FitSettings, Keep, SourceBody, Unit, UpAxis};
use clothcombo_data::format::FileError;
use serde::Deserialize;
use std::str::FromStr;
use std::sync::Arc;

/// Borders farther apart (m) are no seam.
const WIDEST_SEAM: f64 = 0.1;
/// No garment is made with its legs farther apart (degrees, each).
const WIDEST_STANCE: f64 = 60.0;
/// No file's origin is farther from the body (m).
const FARTHEST_ORIGIN: f64 = 1e4;

/// Hints about garment files; what is not given is found out.
#[derive(Args, Clone, Debug)]
pub struct FitArguments {
    /// Unit of the file: m, dm, cm, mm, inch, foot or auto
    #[arg(long, default_value = "auto", value_parser = automatic::<Unit>)]
    unit: Automatic<Unit>,
    /// Axis of the file that points up: y, z, x, where files are upside down -y, -z, -x, or auto (the first three)
    #[arg(long, default_value = "auto", allow_hyphen_values = true, value_parser = automatic::<UpAxis>)]
    up: Automatic<UpAxis>,
    /// Arms of the garment: level (t), lowered (a), or auto
    #[arg(long, default_value = "auto", value_parser = automatic::<Arms>)]
    arms: Automatic<Arms>,
    /// How far each leg of the garment is turned outwards from the rest pose of the body; found out if not given
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true, value_parser = legs)]
    legs: Option<f64>,
    /// Category: dress, top, t_shirt, open_shirt, skirt or trousers; guessed from the shape if not given
    #[arg(long)]
    category: Option<Category>,
    /// Where the origin of the file lies on the body: metres from the pelvis to the left, up and forward
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = offset)]
    offset: Option<[f64; 3]>,
    /// Turn about the vertical, counter-clockwise seen from above, after the up axis is up
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true, value_parser = turn)]
    turn: Option<f64>,
    /// Surfaces that are the garment: all (cloth with thickness is refused), largest (the largest connected piece),
    /// outer (the outer sheet of cloth with thickness, without its rims)
    #[arg(long, value_name = "SURFACES", default_value = "all", value_parser = Keep::from_str)]
    keep: Keep,
    /// Joins borders that run along each other at most this far apart, for example 5mm or 0.005; those that coincide (within a
    /// twentieth of their edges) always are
    #[arg(long, value_name = "DISTANCE", value_parser = seam_width)]
    join_seams: Option<f64>,
    /// The body that the garment was made on, in the same coordinates: BODY.npz, BODY.npz:SHAPE or a mesh. The garment
    /// is placed through it, and nothing is searched for. Example: --from-body SMPL_NEUTRAL.npz:1.2,-0.5. With a mesh,
    /// --unit, --up and --turn are about both files; with an npz, they and --offset say how the garment's coordinates
    /// differ from the npz's
    #[arg(long, value_name = "BODY")]
    from_body: Option<String>,
}

impl FitArguments {
    /// The settings that say so.
    ///
    /// # Errors
    /// When the body of `--from-body` cannot be read, naming its file.
    pub fn settings(&self) -> Result<FitSettings, FileError> {
        Ok(FitSettings {
            unit: self.unit.0,
            up: self.up.0,
            arms_lowered: self.arms.0.map(|arms| arms == Arms::A),
            legs_degrees: self.legs,
            category: self.category,
            offset: self.offset,
            turn_degrees: self.turn,
            keep: self.keep,
            join_seams: self.join_seams,
            from_body: self.from_body.as_deref().map(SourceBody::load).transpose()?.map(Arc::new),
        })
    }
}

/// The same for one garment of an outfits file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GarmentEntry {
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
}

impl GarmentEntry {
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
        let arms = hint("arms", &self.arms, Arms::from_str)?;
        let numbers = self.offset.map(|o| o.map(|x| x.to_string()).join(","));
        let [turned, apart] = [self.turn, self.legs].map(|hint| hint.map(|degrees| degrees.to_string()));
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
            legs_degrees: hint("legs", &apart, legs)?.or(all.legs_degrees),
            category: hint("category", &self.category, Category::from_str)?.or(all.category),
            offset: hint("offset", &numbers, offset)?.or(all.offset),
            turn_degrees: hint("turn", &turned, turn)?.or(all.turn_degrees),
            keep: hint("keep", &self.keep, Keep::from_str)?.unwrap_or(all.keep),
            join_seams: hint("join_seams", &self.join_seams, seam_width)?.or(all.join_seams),
        })
    }
}

/// A value that may be found out.
#[derive(Clone, Copy, Debug)]
struct Automatic<T>(Option<T>);

fn automatic<T: FromStr<Err = String>>(text: &str) -> Result<Automatic<T>, String> {
    match text {
        "auto" => Ok(Automatic(None)),
        other => other.parse().map(|value| Automatic(Some(value))).map_err(|e: String| format!("{e}, auto")),
    }
}

/// How the arms of a garment are held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Arms {
    T,
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

fn offset(text: &str) -> Result<[f64; 3], String> {
    let wrong = || format!("'{text}' is not three numbers in metres such as 0,0.95,0");
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse::<f64>()).collect();
    let numbers: [f64; 3] = numbers.map_err(|_| wrong())?.try_into().map_err(|_| wrong())?;
    // Neither is what is no number.
    match numbers.iter().all(|x| x.abs() <= FARTHEST_ORIGIN) {
        true => Ok(numbers),
        false => Err(format!("'{text}' is farther from the body than {FARTHEST_ORIGIN} m")),
    }
}

fn turn(text: &str) -> Result<f64, String> {
    let degrees = text.parse::<f64>().ok().filter(|degrees| degrees.abs() <= 360.0);
    degrees.ok_or_else(|| format!("'{text}' is no angle from -360 to 360 degrees"))
}

fn legs(text: &str) -> Result<f64, String> {
    let degrees = text.parse::<f64>().ok().filter(|degrees| degrees.abs() <= WIDEST_STANCE);
    degrees.ok_or_else(|| format!("'{text}' is no angle from -{WIDEST_STANCE} to {WIDEST_STANCE} degrees"))
}

/// A length in metres, or with a unit.
fn seam_width(text: &str) -> Result<f64, String> {
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
    use clap::Parser;

    #[derive(Parser)]
    struct Program {
        #[command(flatten)]
        fit: FitArguments,
    }

    fn parsed(arguments: &[&str]) -> Result<FitSettings, String> {
        let all = ["program"].iter().chain(arguments);
        let program = Program::try_parse_from(all).map_err(|e| e.to_string())?;
        program.fit.settings().map_err(|e| e.to_string())
    }

    #[test]
    fn no_flag_is_no_hint() {
        assert_eq!(parsed(&[]), Ok(FitSettings::default()));
        assert_eq!(parsed(&["--unit", "auto", "--up", "auto", "--arms", "auto"]), Ok(FitSettings::default()));
    }

    #[test]
    fn flags_say_what_they_mean() {
        let settings = parsed(&[
            "--unit",
            "cm",
            "--up",
            "-z",
            "--arms",
            "a",
            "--legs",
            "7.5",
            "--category",
            "top",
            "--offset",
            "-0.1,0.95,0",
            "--turn",
            "-90",
            "--keep",
            "outer",
            "--join-seams",
            "5mm",
        ]);
        let expected = FitSettings {
            unit: Some(Unit::Cm),
            up: Some(UpAxis::MinusZ),
            arms_lowered: Some(true),
            legs_degrees: Some(7.5),
            category: Some(Category::Top),
            offset: Some([-0.1, 0.95, 0.0]),
            turn_degrees: Some(-90.0),
            keep: Keep::Outer,
            join_seams: Some(0.005),
            from_body: None,
        };
        assert_eq!(settings, Ok(expected));
    }

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
    fn mistakes_name_the_flag_and_what_is_known() {
        for (arguments, part) in [
            (["--unit", "furlong"], "inch"),
            (["--keep", "inner"], "outer"),
            (["--offset", "1,2"], "three numbers"),
            (["--offset", "nan,0,0"], "farther"),
            (["--turn", "900"], "360"),
            (["--arms", "up"], "t, a"),
            (["--legs", "wide"], "60"),
        ] {
            let message = parsed(&arguments).unwrap_err();
            assert!(message.contains(part) && message.contains(arguments[0]), "{message}");
        }
    }

    #[test]
    fn an_entry_comes_before_the_flags() {
        let all = FitSettings { unit: Some(Unit::M), up: Some(UpAxis::Z), ..FitSettings::default() };
        let entry: GarmentEntry =
            toml::from_str("file = \"tee.obj\"\nunit = \"cm\"\nkeep = \"outer\"\noffset = [0.0, 1.0, 0.0]")
                .unwrap();
        let settings = entry.settings(&all, str::to_owned).unwrap();
        assert_eq!(
            (settings.unit, settings.up, settings.keep),
            (Some(Unit::Cm), Some(UpAxis::Z), Keep::Outer)
        );
        assert_eq!(settings.offset, Some([0.0, 1.0, 0.0]));
        let wrong: GarmentEntry = toml::from_str("file = \"tee.obj\"\nup = \"north\"").unwrap();
        assert!(wrong.settings(&all, str::to_owned).unwrap_err().starts_with("up: 'north'"));
        assert!(toml::from_str::<GarmentEntry>("file = \"tee.obj\"\nsize = 4").is_err());
        let missing: GarmentEntry = toml::from_str("file = \"tee.obj\"\nfrom_body = \"none.npz:1\"").unwrap();
        let message = missing.settings(&all, |path| format!("folder/{path}")).unwrap_err();
        assert!(message.starts_with("from_body: folder/none.npz"), "{message}");
    }
}
