//! Attempts: the first one, those on a body that yields, and those that start from the result of another one.

use super::body::SoftBody;
use super::budget::Budget;
use super::clearance::{Clearance, YieldedBody};
use super::count::certified;
use super::fast_pass::{FEW_SELF_PAIRS, fast_pass};
use super::garment::{at, check};
use super::obstacle::BodyObstacle;
use super::task::Task;
use super::untangle::{Untangled, untangled};
use super::withdrawal::ClearanceWithdrawal;
use super::{Layer, ResolveError, ResolveSettings, Resolved, strain_relaxation};
use crate::query::Surface;

/// Continued attempts: gap and rings as multiples of the settings. A smaller gap is for many sheets in one crease, a larger one
/// goes round what holds a few of them.
const AGAIN: [(f64, usize); 3] = [(1.0, 1), (0.3, 1), (3.0, 2)];
/// Most pairs that may be left for them: more would only be stretched further.
pub(super) const FEW_PAIRS: usize = 32;

/// The fast pass and, if it does not clear the outfit, the first attempts. If those do not either, `further` goes on from the
/// body and the result so far. Before that the body yields only if at most `most` pairs are left.
pub(super) fn resolved_further<E: From<ResolveError>>(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    most: usize,
    further: impl FnOnce(&SoftBody<'_>, Resolved, Task<'_>) -> Result<Resolved, E>,
) -> Result<Resolved, E> {
    let budget = &Budget::new(settings, layers.len());
    settings.check()?;
    check(body, layers)?;
    let task = Task { layers, settings, budget };
    let drawn = budget.preparing(|| BodyObstacle::near_layers(body, layers));
    if let Some(found) = fast_pass(&drawn, task) {
        return Ok(found);
    }
    budget.shorten_for(body);
    let mut found = simply_resolved(&drawn, task);
    if found.certificate.is_clear() {
        found.go_on(body, task);
        found.relax_strain(&drawn, task, strain_relaxation::TIMES);
    } else {
        let yielded = budget.preparing(|| YieldedBody::ample(&drawn, layers.len()));
        let yielding = SoftBody::new(drawn, layers.len(), yielded.as_ref());
        found.certificate.count_narrow(&yielding.drawn);
        if found.certificate.between() <= most {
            found.yield_to_cloth(&yielding, task);
        }
        found.go_on(body, task);
        found = further(&yielding, found, task)?;
        found.relax_strain(&yielding.drawn, task, strain_relaxation::TIMES);
    }
    found.compare_since(layers, budget);
    Ok(found)
}

/// [`super::resolve`] without what follows the first attempts.
fn resolved_once(body: &Surface<f64>, task: Task<'_>) -> Resolved {
    let Task { layers, budget, .. } = task;
    let drawn = budget.preparing(|| BodyObstacle::near_layers(body, layers));
    let mut found = simply_resolved(&drawn, task);
    if !found.certificate.is_clear() {
        let yielded = budget.preparing(|| YieldedBody::ample(&drawn, layers.len()));
        let yielding = SoftBody::new(drawn, layers.len(), yielded.as_ref());
        found.certificate.count_narrow(&yielding.drawn);
        found.yield_to_cloth(&yielding, task);
    }
    found
}

/// [`super::resolve`] on a body that does not yield: enough for most garments.
fn simply_resolved(drawn: &BodyObstacle<'_>, task: Task<'_>) -> Resolved {
    // Wider limits are for what is left when the body has yielded.
    let settings = &ResolveSettings { loosened: 1.0, ..*task.settings };
    judged(drawn, untangled(drawn, Task { settings, ..task }, None), task)
}

impl Resolved {
    /// [`super::resolve`] on a `body` that yields, taken if it is better. Nothing if the budget is spent.
    fn yield_to_cloth(&mut self, body: &SoftBody<'_>, task: Task<'_>) {
        if !task.budget.is_spent() {
            let found = untangled(body.obstacle(), task, None);
            let found = settled(body, found, Clearance::AMPLE, task);
            self.prefer(task.layers, found.positions, found.certificate);
        }
    }

    /// If few intersections are left on `body`, or only self-intersections, attempts that start from the result of the one
    /// before, or from the best one: nearly untangled cloth is a better reference for shape and lengths than the drape. None if
    /// limits are strict (`settings.loosened`).
    pub(super) fn go_on(&mut self, body: &Surface<f64>, task: Task<'_>) {
        let Task { layers, settings, budget } = task;
        let attempts = if settings.loosened > 1.0 { &AGAIN[..] } else { &[] };
        let mut now = self.positions.clone();
        for again in attempts {
            let left = self.certificate.between();
            let is_smooth = !settings.self_contact || self.certificate.self_triangle_pairs <= FEW_SELF_PAIRS;
            if left == 0 && is_smooth || left > FEW_PAIRS || budget.is_spent() {
                break;
            }
            // Self-intersections become fewer without other gaps or rings.
            let (gap, rings) = if left > 0 { *again } else { (1.0, 1) };
            let settings =
                &ResolveSettings { gap: gap * settings.gap, rings: rings * settings.rings, ..*settings };
            let found = resolved_once(body, Task { layers: &at(layers, &now), settings, budget });
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
    body: &SoftBody<'_>,
    found: Untangled,
    clearance: Clearance,
    task: Task<'_>,
) -> Resolved {
    let mut resolved = judged(&body.drawn, found, task);
    ClearanceWithdrawal { body, task, clearance }.improve(&mut resolved);
    resolved
}

/// The result of untangling, with its certificate.
fn judged(drawn: &BodyObstacle<'_>, found: Untangled, task: Task<'_>) -> Resolved {
    let positions = found.positions;
    let certificate = task.budget.certifying(|| certified(drawn, task.layers, &positions));
    Resolved { positions, certificate, ..Resolved::default() }
}
