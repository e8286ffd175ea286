//! Flags of every verb that takes garments out of the body and of each other.

use super::values::{gap_mm, seconds};
use clap::Args;
use clothcombo_physics::contact::resolve::ResolveSettings;
use std::time::Duration;

/// What the post-process is to do.
#[derive(Args)]
pub struct PostProcessArguments {
    /// Gap that a garment gets where the post-process has to move it (mm); up to three times as much where that does not end all
    /// intersections, three tenths of it between parts of the body that leave no clearance for more
    #[arg(long = "gap", alias = "gap-mm", default_value_t = 1.0, value_name = "MM", value_parser = gap_mm)]
    pub gap_mm: f64,
    /// Time per garment after which the post-process begins nothing new and returns the best it has (s); default: none
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub time_limit: Option<Duration>,
}

impl PostProcessArguments {
    /// The settings that say so.
    pub fn settings(&self) -> ResolveSettings {
        ResolveSettings { gap: 1e-3 * self.gap_mm, time: self.time_limit, ..ResolveSettings::default() }
    }
}

/// What to do about `pairs` that are left, and whether a budget ended the post-process.
pub fn left_over(pairs: usize, is_stopped: bool) -> Option<String> {
    let (stopped, longer) = match (is_stopped, pairs) {
        (false, 0) => return None,
        (true, 0) => return Some("stopped after its budget; no pairs left".to_owned()),
        (false, _) => ("", ""),
        (true, _) => ("stopped after its budget, ", "a longer --time-limit if there is one, "),
    };
    Some(format!(
        "{stopped}{pairs} pairs left, listed in report.json; hint: {longer}another order of the garments, fewer of them, or a pose \
         in which the body overlaps itself less"
    ))
}
