//! Results on stdout: JSON or tables.

use miette::{IntoDiagnostic, Report};
use serde::Serialize;

/// Prints `value` as JSON.
///
/// # Errors
/// When it has no JSON form.
pub(super) fn print_json(value: &impl Serialize) -> Result<(), Report> {
    println!("{}", serde_json::to_string_pretty(value).into_diagnostic()?);
    Ok(())
}

/// Prints `value`: as JSON where `json` asks for it, else as `text` shows it.
///
/// # Errors
/// As [`print_json`].
pub(super) fn print_report<T: Serialize>(
    json: bool,
    value: &T,
    text: impl FnOnce(&T) -> String,
) -> Result<(), Report> {
    if json {
        return print_json(value);
    }
    print!("{}", text(value));
    Ok(())
}
