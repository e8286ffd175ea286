//! How far apart, how wide, how often.

use std::time::Duration;

use super::ResolveError;

/// Settings of [`super::resolve`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResolveSettings {
    /// Distance from the body that a vertex gets when it has to move (m), a tenth more in each round up to three times as much;
    /// the same over an inner garment, half of it where triangles intersect; three tenths between parts of the body that are too
    /// near to each other for more. Default 1 mm.
    pub gap: f64,
    /// Rings of neighbours around a violation that move along. Default 5.
    pub rings: usize,
    /// Most rounds of detection and relaxation in an attempt. Default 24.
    pub rounds: usize,
    /// Farthest that any vertex may be moved (m). Default 6 cm: what asks for more (an order that is not feasible, a part of the
    /// body inside another one) would stretch the garment beyond use, and is left and listed.
    pub farthest: f64,
    /// Longest that an edge should get, as a share of its length in the input. Default 1.15: cloth gives a little, and a place
    /// that asks for more is left and listed. Contacts come last in a round, so that single edges get longer.
    pub stretch: f64,
    /// How many times wider both limits are in a second attempt, where intersections are left; its result is only taken if it
    /// ends with none. Where few are left in the end, all is tried again from there and both limits are measured anew. Default 6;
    /// 1 for strict limits: no attempt begins where another one ended, and added strain is not relaxed.
    pub loosened: f64,
    /// Most steps on a path: of [`super::resolve_along`] from the T-pose, of [`super::resolve_after`] from the frame before.
    /// Default 128; 0: no path.
    pub steps: usize,
    /// Whether nothing lies deeper than half a limb, so that the nearest way out is the right one: true for a small step.
    /// Default no.
    pub is_shallow: bool,
    /// Whether a few rounds without progress are borne with: false where a shorter step is tried next. Default yes.
    pub is_patient: bool,
    /// Whether self-intersections are mended where possible. Default yes.
    pub self_contact: bool,
    /// Most rounds of detection and relaxation of an outfit, over all attempts and all steps of a path together; a quarter of
    /// them on a body of which more than 1,000 pairs of triangles intersect each other. Where they are used up, the best state
    /// so far is taken. Default 1,200: about half a minute for 4,000 vertices on one core.
    pub total_rounds: usize,
    /// Wall time, times the number of garments, with the same effect, which makes the result depend on the machine. Default
    /// none.
    pub time: Option<Duration>,
}

impl Default for ResolveSettings {
    fn default() -> Self {
        Self {
            gap: 1e-3,
            rings: 5,
            rounds: 24,
            farthest: 0.06,
            stretch: 1.15,
            loosened: 6.0,
            steps: 128,
            is_shallow: false,
            is_patient: true,
            self_contact: true,
            total_rounds: 1200,
            time: None,
        }
    }
}

impl ResolveSettings {
    /// A vertex has to move where it is nearer than this (m), a quarter of the gap: whatever was resolved once stays as it is.
    pub(super) fn least_gap(&self) -> f64 {
        0.25 * self.gap
    }

    /// The largest `gap` (m).
    pub const LARGEST_GAP: f64 = 0.05;

    /// Checks every value.
    ///
    /// # Errors
    /// [`ResolveError::Setting`] names the first that is out of range.
    pub fn check(&self) -> Result<(), ResolveError> {
        let fail = |setting, value, expected| Err(ResolveError::Setting { setting, value, expected });
        let in_range = |value: f64, most: f64| value > 0.0 && value <= most;
        for (setting, value, is_valid, expected) in [
            ("gap", self.gap, in_range(self.gap, Self::LARGEST_GAP), "greater than 0 and at most 0.05 m"),
            ("farthest", self.farthest, in_range(self.farthest, 10.0), "greater than 0 and at most 10 m"),
            ("stretch", self.stretch, (1.0..=100.0).contains(&self.stretch), "between 1 and 100"),
            ("loosened", self.loosened, (1.0..=100.0).contains(&self.loosened), "between 1 and 100"),
        ] {
            if !is_valid {
                return fail(setting, value, expected);
            }
        }
        for (setting, value, most) in [("rings", self.rings, 1000), ("rounds", self.rounds, 10_000)] {
            if !(1..=most).contains(&value) {
                return fail(setting, value as f64, "at least 1 and at most 1000 rings or 10000 rounds");
            }
        }
        Ok(())
    }
}
