//! Attempts: the first one, those on a body that yields, and those that start from the result of another one.

use std::time::Instant;

use super::body::{Body, with_body, with_drawn};
use super::budget::Budget;
use super::clearance::Clearance;
use super::count::certified;
use super::garment::{at, check};
use super::obstacle::BodyObstacle;
use super::untangle::{Untangled, untangled};
use super::withdrawal::ClearanceWithdrawal;
use super::{Layer, ResolveError, ResolveSettings, Resolved, passed_near, strain_relaxation};
use crate::query::Surface;

/// Continued attempts: gap and rings as multiples of the settings. A smaller gap is for many sheets in one crease, a larger one
/// goes round what holds a few of them.
const AGAIN: [(f64, usize); 3] = [(1.0, 1), (0.3, 1), (3.0, 2)];
/// Most pairs that may be left for them: more would only be stretched further.
pub(super) const FEW: usize = 32;
/// Self-intersecting pairs that may be left where nothing else intersects.
pub(super) const FEW_OF_ITSELF: usize = 8;

/// The fast pass and, if it does not clear the outfit, the first attempts. If those do not either, `further` goes on from the
/// body and the result so far. Before that the body yields only if at most `most` pairs are left.
pub(super) fn resolved_further<E: From<ResolveError>>(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    most: usize,
    further: impl FnOnce(&Body<'_>, Resolved, &Budget) -> Result<Resolved, E>,
) -> Result<Resolved, E> {
    let budget = &Budget::new(settings, layers.len());
    settings.check()?;
    check(body, layers)?;
    let preparing = Instant::now();
    with_drawn(body, layers, |drawn| {
        budget.count_body(preparing);
        if let Some(found) = passed_near(&drawn, layers, settings, budget) {
            return Ok(found);
        }
        budget.shorten_for(body);
        let mut found = simply_resolved(&drawn, layers, settings, budget);
        if found.certificate.is_clear() {
            found.go_on(body, layers, settings, budget);
            found.relax_strain(&drawn, layers, settings, budget, strain_relaxation::TIMES);
        } else {
            let yielding_since = Instant::now();
            found = with_body(drawn, layers.len(), |yielding| {
                budget.count_body(yielding_since);
                found.certificate.count_narrow(&yielding.drawn);
                if found.certificate.between() <= most {
                    found.yield_to_cloth(yielding, layers, settings, budget);
                }
                found.go_on(body, layers, settings, budget);
                let mut found = further(yielding, found, budget)?;
                found.relax_strain(&yielding.drawn, layers, settings, budget, strain_relaxation::TIMES);
                Ok::<_, E>(found)
            })?;
        }
        found.compare_since(layers, budget);
        Ok(found)
    })
}

/// [`super::resolve`] without what follows the first attempts.
fn resolved_once(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    budget: &Budget,
) -> Resolved {
    let preparing = Instant::now();
    with_drawn(body, layers, |drawn| {
        budget.count_body(preparing);
        let mut found = simply_resolved(&drawn, layers, settings, budget);
        if !found.certificate.is_clear() {
            let yielding_since = Instant::now();
            with_body(drawn, layers.len(), |yielding| {
                budget.count_body(yielding_since);
                found.certificate.count_narrow(&yielding.drawn);
                found.yield_to_cloth(yielding, layers, settings, budget);
            });
        }
        found
    })
}

/// [`super::resolve`] on a body that does not yield: enough for most garments.
fn simply_resolved(
    drawn: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    budget: &Budget,
) -> Resolved {
    // Wider limits are for what is left when the body has yielded.
    let settings = ResolveSettings { loosened: 1.0, ..*settings };
    judged(drawn, layers, untangled(drawn, layers, &settings, budget), budget)
}

impl Resolved {
    /// [`super::resolve`] on a `body` that yields, taken if it is better. Nothing if the `budget` is spent.
    fn yield_to_cloth(
        &mut self,
        body: &Body<'_>,
        layers: &[Layer<'_>],
        settings: &ResolveSettings,
        budget: &Budget,
    ) {
        if !budget.is_spent() {
            let found = untangled(body.obstacle(), layers, settings, budget);
            let found = settled(body, layers, found, settings, Clearance::AMPLE, budget);
            self.prefer(layers, found.positions, found.certificate);
        }
    }

    /// If few intersections are left on `body`, or only self-intersections, attempts that start from the result of the one
    /// before, or from the best one: nearly untangled cloth is a better reference for shape and lengths than the drape. None if
    /// limits are strict (`settings.loosened`).
    pub(super) fn go_on(
        &mut self,
        body: &Surface<f64>,
        layers: &[Layer<'_>],
        settings: &ResolveSettings,
        budget: &Budget,
    ) {
        let attempts = if settings.loosened > 1.0 { &AGAIN[..] } else { &[] };
        let mut now = self.positions.clone();
        for again in attempts {
            let left = self.certificate.between();
            let is_smooth = !settings.self_contact || self.certificate.self_triangle_pairs <= FEW_OF_ITSELF;
            if left == 0 && is_smooth || left > FEW || budget.is_spent() {
                break;
            }
            // Self-intersections become fewer without other gaps or rings.
            let (gap, rings) = if left > 0 { *again } else { (1.0, 1) };
            let settings =
                ResolveSettings { gap: gap * settings.gap, rings: rings * settings.rings, ..*settings };
            let found = resolved_once(body, &at(layers, &now), &settings, budget);
            now.clone_from(&found.positions);
            self.prefer(layers, found.positions, found.certificate);
            if left > 0 {
                now.clone_from(&self.positions);
            }
        }
    }
}

/// The result of untangling, out of the body's clearance where that works, with its certificate.
pub(super) fn settled(
    body: &Body<'_>,
    layers: &[Layer<'_>],
    found: Untangled,
    settings: &ResolveSettings,
    clearance: Clearance,
    budget: &Budget,
) -> Resolved {
    let mut resolved = judged(&body.drawn, layers, found, budget);
    ClearanceWithdrawal { body, layers, clearance, budget }.improve(&mut resolved, settings);
    resolved
}

/// The result of untangling, with its certificate.
pub(super) fn judged(
    drawn: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    found: Untangled,
    budget: &Budget,
) -> Resolved {
    let start = Instant::now();
    let certificate = certified(drawn, layers, &found.positions);
    budget.count_certificate(start);
    Resolved { positions: found.positions, certificate, ..Resolved::default() }
}
