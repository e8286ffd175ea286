//! Attempts: the first one, those on a body that gives way, and those that begin where another one ended.

use std::time::{Duration, Instant};

use super::body::{Body, with_body, with_drawn};
use super::budget::Budget;
use super::close_in::ClosingIn;
use super::count::certified;
use super::garment::at;
use super::obstacle::BodyObstacle;
use super::relief::Room;
use super::unfold::Folds;
use super::untangle::{Untangled, untangled};
use super::{GarmentWork, Layer, ResolveSettings, Resolved, ease};
use crate::query::Surface;

/// Most attempts that begin where another one ended…
const FURTHER_ATTEMPTS: usize = 3;
/// …and most pairs that may be left there: more would only be torn further.
pub(super) const FEW: usize = 32;
/// Most pairs for which the body gives way before a path is tried: more are hardly ever cleared by that.
const MOST_TO_YIELD: usize = 64;
/// Pairs of garments with themselves that may be left where nothing else crosses.
pub(super) const FEW_OF_ITSELF: usize = 8;
/// How the last few crossings are tried once more: gap and rings, as shares of those asked for. A smaller gap is for
/// many sheets in one crease, a larger one goes round what holds a few of them.
const LAST: [(f64, usize); 2] = [(0.3, 1), (3.0, 2)];

/// [`super::resolve`] for valid arguments. Where something is left to do after the first attempt, `further` may go on from there: it
/// gets the body and what was reached. The body only gives way before that where few enough pairs are left.
pub(super) fn resolved_further<E>(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    budget: &Budget,
    further: impl FnOnce(&Body<'_>, Resolved) -> Result<Resolved, E>,
) -> Result<Resolved, E> {
    let preparing = Instant::now();
    with_drawn(body, layers, |drawn| {
        let body_time = preparing.elapsed();
        let most = if settings.steps > 0 { MOST_TO_YIELD } else { usize::MAX };
        resolved_near(drawn, layers, settings, (budget, body_time), most, further)
    })
}

/// [`resolved_further`] with a body that is prepared near `layers`, which took `body_time`; it gives way where at most so many pairs
/// (`most`) are left.
pub(super) fn resolved_near<E>(
    drawn: BodyObstacle<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    (budget, body_time): (&Budget, Duration),
    most: usize,
    further: impl FnOnce(&Body<'_>, Resolved) -> Result<Resolved, E>,
) -> Result<Resolved, E> {
    let body = drawn.surface;
    let mut simple = simply_resolved(&drawn, layers, settings, (budget, body_time));
    if simple.certificate.is_clear() {
        simple.go_on(body, layers, settings, budget);
        simple.ease(&drawn, layers, settings, budget, ease::TIMES);
        simple.compare_since(layers, budget);
        return Ok(simple);
    }
    let relieving = Instant::now();
    with_body(drawn, layers.len(), |room| {
        let mut found = match simple.certificate.between() <= most {
            true => resolved(room, layers, settings, simple, (budget, relieving)),
            false => {
                simple.certificate.count_narrow(&room.drawn);
                simple
            }
        };
        found.go_on(body, layers, settings, budget);
        if found.certificate.is_clear() {
            found.ease(&room.drawn, layers, settings, budget, ease::TIMES);
        }
        found.compare_since(layers, budget);
        let mut found = further(room, found)?;
        found.ease(&room.drawn, layers, settings, budget, ease::TIMES);
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
        let simple = simply_resolved(&drawn, layers, settings, (budget, preparing.elapsed()));
        if simple.certificate.is_clear() {
            return simple;
        }
        let relieving = Instant::now();
        with_body(drawn, layers.len(), |body| resolved(body, layers, settings, simple, (budget, relieving)))
    })
}

/// [`super::resolve`] on a body that does not give way, prepared in `body_time`: enough for most garments.
fn simply_resolved(
    drawn: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    (budget, body_time): (&Budget, Duration),
) -> Resolved {
    let now = Instant::now();
    // Wider limits are for what is left when the body has given way.
    let settings = ResolveSettings { loosened: 1.0, ..*settings };
    let mut resolved = judged(drawn, layers, untangled(drawn, layers, &settings, budget));
    resolved.body_time = body_time;
    resolved.compare(layers, now.elapsed() - resolved.certificate_time);
    resolved
}

/// [`super::resolve`] on a body that gives way, prepared since `relieving`; `simple` is what was reached before it did, and stays where
/// it is better, or where the `budget` is spent.
fn resolved(
    body: &Body<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    mut simple: Resolved,
    (budget, relieving): (&Budget, Instant),
) -> Resolved {
    simple.certificate.count_narrow(&body.drawn);
    if budget.is_spent() {
        return simple;
    }
    let obstacle = body.obstacle();
    let body_time = simple.body_time + relieving.elapsed();
    let now = Instant::now();
    let found = untangled(obstacle, layers, settings, budget);
    let mut found = settled(body, layers, found, settings, Room::AMPLE, budget);
    let own: Duration = simple.garments.iter().map(|work| work.time).sum();
    let time = own + now.elapsed() - found.certificate_time;
    let certificate_time = simple.certificate_time + found.certificate_time;
    let rounds = |resolved: &Resolved| resolved.garments.first().map_or(0, |work| work.rounds);
    let all_rounds = rounds(&simple) + rounds(&found);
    found.prefer(layers, simple.positions, simple.certificate);
    found.garments.iter_mut().for_each(|work| work.rounds = all_rounds);
    (found.body_time, found.certificate_time) = (body_time, certificate_time);
    found.compare(layers, time);
    found
}

impl Resolved {
    /// Where few crossings are left on `body`, or none but those of garments with themselves, attempts that begin where
    /// the one before ended: cloth that is nearly sorted out is the better shape to return to and to measure lengths
    /// from than the drape it came from. None where limits are strict (`settings.loosened`).
    pub(super) fn go_on(
        &mut self,
        body: &Surface<f64>,
        layers: &[Layer<'_>],
        settings: &ResolveSettings,
        budget: &Budget,
    ) {
        let mut now = self.positions.clone();
        let attempts = if settings.loosened > 1.0 { FURTHER_ATTEMPTS } else { 0 };
        for _ in 0..attempts {
            let left = self.certificate.between();
            let is_smooth = !settings.self_contact || self.certificate.self_triangle_pairs <= FEW_OF_ITSELF;
            if left == 0 && is_smooth || left > FEW || budget.is_spent() {
                break;
            }
            let found = resolved_once(body, &at(layers, &now), settings, budget);
            self.add_work(&found);
            let is_stuck = found.positions == now;
            now.clone_from(&found.positions);
            self.prefer(layers, found.positions, found.certificate);
            if is_stuck {
                break;
            }
        }
    }

    /// Where few crossings are left in the end, tries to mend them with other gaps. None where limits are strict.
    /// Returns whether that was better.
    pub(super) fn mend_last(
        &mut self,
        body: &Surface<f64>,
        layers: &[Layer<'_>],
        settings: &ResolveSettings,
        budget: &Budget,
    ) -> bool {
        let mut is_better = false;
        let attempts = if settings.loosened > 1.0 { &LAST[..] } else { &[] };
        for (gap, rings) in attempts {
            let left = self.certificate.between();
            if left == 0 || left > FEW || budget.is_spent() {
                break;
            }
            let settings =
                ResolveSettings { gap: gap * settings.gap, rings: rings * settings.rings, ..*settings };
            let found = resolved_once(body, &at(layers, &self.positions), &settings, budget);
            self.add_work(&found);
            is_better |= self.prefer(layers, found.positions, found.certificate);
        }
        is_better
    }

    /// Where nothing crosses but garments themselves, lays out what of them is folded, beside where they are `skinned`,
    /// and begins once more from there. Returns whether that was better.
    pub(super) fn lay_out(
        &mut self,
        body: &Surface<f64>,
        layers: &[Layer<'_>],
        skinned: &[Vec<[f64; 3]>],
        settings: &ResolveSettings,
        budget: &Budget,
    ) -> bool {
        let is_smooth = self.certificate.self_triangle_pairs <= FEW_OF_ITSELF;
        if is_smooth || !self.certificate.is_clear() || budget.is_spent() {
            return false;
        }
        let now = at(layers, &self.positions);
        let folds = Folds::of(body, &now, skinned);
        if folds.is_empty() {
            return false;
        }
        let laid_out = folds.laid_out(&now, skinned);
        let mut found = resolved_once(body, &at(layers, &laid_out), settings, budget);
        found.go_on(body, layers, settings, budget);
        self.add_work(&found);
        self.prefer(layers, found.positions, found.certificate)
    }
}

/// What untangling left, brought back to the body as it is drawn where it can be, with its certificate.
pub(super) fn settled(
    body: &Body<'_>,
    layers: &[Layer<'_>],
    found: Untangled,
    settings: &ResolveSettings,
    room: Room,
    budget: &Budget,
) -> Resolved {
    let mut resolved = judged(&body.drawn, layers, found);
    ClosingIn { body, layers, room, budget }.improve(&mut resolved, settings);
    resolved
}

/// What untangling left, with its certificate.
pub(super) fn judged(drawn: &BodyObstacle<'_>, layers: &[Layer<'_>], found: Untangled) -> Resolved {
    let start = Instant::now();
    let certificate = certified(drawn, layers, &found.positions);
    let work = GarmentWork { rounds: found.rounds, ..GarmentWork::default() };
    Resolved {
        positions: found.positions,
        certificate,
        garments: vec![work; layers.len()],
        certificate_time: start.elapsed(),
        ..Resolved::default()
    }
}
