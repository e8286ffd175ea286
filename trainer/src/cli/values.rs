//! What the values of flags must be, where the type alone does not say it.

use clothcombo_physics::contact::resolve::ResolveSettings;
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
