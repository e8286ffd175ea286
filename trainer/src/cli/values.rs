//! What the values of flags must be, where the type alone does not say it.

use crate::config::MOST_GENERATED_GARMENTS;
use crate::inference::MOST_SHAPE;
use crate::system::files::check_writable;
use crate::system::paths::obstacle;
use clap::builder::{PathBufValueParser, TypedValueParser};
use clothcombo_physics::contact::resolve::ResolveSettings;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A whole number that is at least 1.
pub fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("it must be at least 1".into()),
        Ok(number) => Ok(number),
        Err(_) => Err("it is no whole number".into()),
    }
}

/// Number of garments or of vertices: at most as many as the garments that a configuration may ask for.
pub fn count(text: &str) -> Result<usize, String> {
    match at_least_one(text)? {
        count if count > MOST_GENERATED_GARMENTS => {
            Err(format!("it must be at most {MOST_GENERATED_GARMENTS}"))
        }
        count => Ok(count),
    }
}

/// A number for which `is_valid` holds; `expected` says so in words.
fn number(text: &str, is_valid: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if is_valid(number) => Ok(number),
        Ok(_) => Err(format!("it must be {expected}")),
        Err(_) => Err("it is no number".into()),
    }
}

/// A time (s).
pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = number(text, |seconds| seconds > 0.0, "greater than 0")?;
    Duration::try_from_secs_f64(seconds).map_err(|_| "it is too long".into())
}

/// A gap between garments (mm), in the bounds of the post-process.
pub fn gap_mm(text: &str) -> Result<f64, String> {
    const MOST_GAP_MM: f64 = 1e3 * ResolveSettings::LARGEST_GAP;
    number(
        text,
        |gap| gap > 0.0 && gap <= MOST_GAP_MM,
        &format!("greater than 0 and at most {MOST_GAP_MM} mm"),
    )
}

/// Time spent on one measurement, at most a day (s).
pub fn measuring_seconds(text: &str) -> Result<f64, String> {
    const DAY: f64 = 86_400.0;
    number(text, |seconds| seconds > 0.0 && seconds <= DAY, &format!("greater than 0 and at most {DAY}"))
}

/// A finite number greater than 0.
pub fn positive(text: &str) -> Result<f64, String> {
    number(text, |x| x.is_finite() && x > 0.0, "a finite number above 0")
}

/// A finite number from 0 up.
pub fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |x| x.is_finite() && x >= 0.0, "a finite number from 0 up")
}

/// A shape parameter of a body.
pub fn shape_parameter(text: &str) -> Result<f64, String> {
    number(text, |x| x.abs() <= MOST_SHAPE, &format!("a finite number from -{MOST_SHAPE} to {MOST_SHAPE}"))
}

/// A PNG file that can be made: a picture is written at the end of the work, over what has its name. Its folder need not be
/// there.
pub fn picture_file() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(checked_picture)
}

/// A folder that is there or can be made.
pub fn folder_to_make() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| makeable(&path).map(|()| path))
}

/// A file that is there or can be made.
pub fn file_to_make() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(checked_file)
}

fn checked_file(path: PathBuf) -> Result<PathBuf, String> {
    if path.is_dir() {
        return Err("it is a folder, not a file".into());
    }
    makeable(path.parent().unwrap_or(Path::new(""))).map(|()| path)
}

/// Whether files can be made in a folder, which need not be there.
fn makeable(folder: &Path) -> Result<(), String> {
    match obstacle(folder) {
        Some(file) => Err(format!("{} is a file, not a folder", file.display())),
        None => check_writable(folder).map_err(|e| format!("nothing can be written there: {e}")),
    }
}

fn checked_picture(path: PathBuf) -> Result<PathBuf, String> {
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        return Err(format!("pictures are PNG: for example {}", path.with_extension("png").display()));
    }
    checked_file(path)
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
            ("notes/a.png", "notes is a file, not a folder"),
            ("notes/deep/a.png", "notes is a file, not a folder"),
        ] {
            let message = checked_picture(at(bad)).unwrap_err();
            assert!(message.contains(word), "{message}");
        }
    }
}
