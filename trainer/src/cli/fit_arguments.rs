//! What is known about garment files: flags of `fit` and `drape`.

use clap::Args;
use clothcombo_data::asset::Category;
use clothcombo_data::fit::hints::{Arms, legs, offset, seam_width, turn};
use clothcombo_data::fit::{FitSettings, Keep, SourceBody, Unit, UpAxis};
use clothcombo_data::format::FileError;
use std::str::FromStr;
use std::sync::Arc;

/// Their group in the help.
pub const HINTS: &str = "Hints about garment files";

/// Hints about garment files; what is not given is found out.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = HINTS)]
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

/// A value that may be found out.
#[derive(Clone, Copy, Debug)]
struct Automatic<T>(Option<T>);

fn automatic<T: FromStr<Err = String>>(text: &str) -> Result<Automatic<T>, String> {
    match text {
        "auto" => Ok(Automatic(None)),
        other => other.parse().map(|value| Automatic(Some(value))).map_err(|e: String| format!("{e}, auto")),
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
    fn mistakes_name_the_flag_and_what_is_known() {
        for (arguments, part) in [
            (["--unit", "furlong"], "inch"),
            (["--keep", "inner"], "outer"),
            (["--offset", "1,2"], "three numbers"),
            (["--offset", "nan,0,0"], "three numbers"),
            (["--offset", "1e9,0,0"], "farther"),
            (["--turn", "900"], "360"),
            (["--arms", "up"], "t, a"),
            (["--legs", "wide"], "60"),
        ] {
            let message = parsed(&arguments).unwrap_err();
            assert!(message.contains(part) && message.contains(arguments[0]), "{message}");
        }
    }
}
