//! What the values of flags must be, where the type alone does not say it.

use crate::system::paths::obstacle;
use clap::builder::{PathBufValueParser, TypedValueParser};
use clothcombo_physics::contact::resolve::ResolveSettings;
use std::path::PathBuf;
use std::time::Duration;

/// A whole number that is at least 1.
pub fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("it must be at least 1".into()),
        Ok(number) => Ok(number),
        Err(_) => Err("it is no whole number".into()),
    }
}

/// A time [s].
pub fn seconds(text: &str) -> Result<Duration, String> {
    match text.parse() {
        Ok(seconds) if seconds > 0.0 => {
            Duration::try_from_secs_f64(seconds).map_err(|_| "it is too long".into())
        }
        Ok(_) => Err("it must be greater than 0".into()),
        Err(_) => Err("it is no number".into()),
    }
}

/// A gap between garments [mm], in the bounds of the post-process.
pub fn gap_mm(text: &str) -> Result<f64, String> {
    const MOST: f64 = 1e3 * ResolveSettings::LARGEST_GAP;
    match text.parse() {
        Ok(gap) if gap > 0.0 && gap <= MOST => Ok(gap),
        Ok(_) => Err(format!("it must be greater than 0 and at most {MOST} mm")),
        Err(_) => Err("it is no number".into()),
    }
}

/// Time spent on one measurement, at most a day [s].
pub fn measuring_seconds(text: &str) -> Result<f64, String> {
    const DAY: f64 = 86_400.0;
    match text.parse() {
        Ok(seconds) if seconds > 0.0 && seconds <= DAY => Ok(seconds),
        Ok(_) => Err(format!("it must be greater than 0 and at most {DAY}")),
        Err(_) => Err("it is no number".into()),
    }
}

/// A finite number greater than 0.
pub fn positive(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| x.is_finite() && *x > 0.0).ok_or_else(|| "not a number above 0".into())
}

/// A finite number from 0 up.
pub fn not_negative(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|x: &f64| x.is_finite() && *x >= 0.0)
        .ok_or_else(|| "not a number from 0 up".into())
}

/// A PNG file that can be made: a picture is written at the end of the work, over what has its name. Its folder need not be
/// there.
pub fn picture_file() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(checked_picture)
}

fn checked_picture(path: PathBuf) -> Result<PathBuf, String> {
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        return Err(format!("pictures are PNG: for example {}", path.with_extension("png").display()));
    }
    if path.is_dir() {
        return Err("it is a folder".into());
    }
    match path.parent().and_then(obstacle) {
        Some(other) => Err(format!("{} is no folder", other.display())),
        None => Ok(path),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_bounds() {
        for text in ["nan", "inf", "-1", "1e30", "x", ""] {
            assert!(measuring_seconds(text).is_err(), "{text}");
        }
        assert_eq!(measuring_seconds("0.5"), Ok(0.5));
        for text in ["nan", "inf", "-1", "x"] {
            assert!(positive(text).is_err() && not_negative(text).is_err(), "{text}");
        }
        assert!(positive("0").is_err() && measuring_seconds("0").is_err());
        assert_eq!((not_negative("0"), positive("1e-3")), (Ok(0.0), Ok(1e-3)));
    }

    #[test]
    fn a_picture_is_a_png_in_a_folder_that_can_be_made() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("notes"), "x").unwrap();
        std::fs::create_dir(at("folder.png")).unwrap();
        for good in ["a.png", "a.PNG", "missing/a.png"] {
            assert_eq!(checked_picture(at(good)), Ok(at(good)));
        }
        assert_eq!(checked_picture("a.png".into()), Ok("a.png".into()));
        for (bad, word) in [
            ("thesis.tex", "thesis.png"),
            ("png", "PNG"),
            ("folder.png", "folder"),
            ("notes/a.png", "notes is no folder"),
            ("notes/deep/a.png", "notes is no folder"),
        ] {
            let message = checked_picture(at(bad)).unwrap_err();
            assert!(message.contains(word), "{message}");
        }
    }
}
