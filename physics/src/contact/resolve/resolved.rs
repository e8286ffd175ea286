//! What the post-process reached, and how it is judged.

use std::time::{Duration, Instant};

use super::body::Body;
use super::certificate::Certificate;
use super::close_in::ClosingIn;
use super::count::{certificate, certified_around};
use super::near::MARGIN;
use super::obstacle::BodyObstacle;
use super::relief::Room;
use super::unfold::Folds;
use super::{Layer, ResolveSettings, Untangled, at, resolved_once};
use crate::query::Surface;
use crate::vec3;

/// Most attempts that begin where another one ended…
const FURTHER_ATTEMPTS: usize = 3;
/// …and most pairs that may be left there: more would only be torn further.
const FEW: usize = 32;
/// Pairs of garments with themselves that may be left where nothing else crosses.
const FEW_OF_ITSELF: usize = 8;
/// How the last few crossings are tried once more: gap and rings, as shares of those asked for. A smaller gap is for many sheets in
/// one crease, a larger one goes round what holds a few of them.
const LAST: [(f64, usize); 2] = [(0.3, 1), (3.0, 2)];

/// Garments that were resolved.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Resolved {
    /// New positions of every garment, `[V, 3]` [m], in the order given.
    pub positions: Vec<Vec<[f64; 3]>>,
    /// What is left.
    pub certificate: Certificate,
    /// What was done, per garment.
    pub garments: Vec<GarmentWork>,
    /// Steps that were tried: from the T-pose, by [`super::resolve_along`] (0 where the drape could be mended as it was), or from the
    /// frame before, by [`super::resolve_after`].
    pub steps: usize,
    /// Time to prepare the body.
    pub body_time: Duration,
    /// Time for the certificate.
    pub certificate_time: Duration,
}

/// What was done to one garment.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct GarmentWork {
    /// Rounds of detection and relaxation.
    pub rounds: usize,
    /// Vertices that moved.
    pub moved: usize,
    /// The largest move [m].
    pub largest_move: f64,
    /// Its share, by vertices, of the wall time for all garments together.
    pub time: Duration,
}

impl Resolved {
    /// Where few crossings are left on `body`, or none but those of garments with themselves, attempts that begin where the one before
    /// ended: cloth that is nearly sorted out is the better shape to return to and to measure lengths from than the drape it came
    /// from. None where limits are strict (`settings.loosened`). `start`: when all of it began.
    pub(super) fn go_on(
        &mut self,
        body: &Surface<f64>,
        layers: &[Layer<'_>],
        settings: &ResolveSettings,
        start: Instant,
    ) {
        let mut now = self.positions.clone();
        let attempts = if settings.loosened > 1.0 { FURTHER_ATTEMPTS } else { 0 };
        for _ in 0..attempts {
            let left = self.certificate.between();
            let is_smooth = !settings.self_contact || self.certificate.self_triangle_pairs <= FEW_OF_ITSELF;
            if left == 0 && is_smooth || left > FEW || settings.is_late(start, layers.len()) {
                break;
            }
            let found = resolved_once(body, &at(layers, &now), settings, start);
            self.add_work(&found);
            let is_stuck = found.positions == now;
            now.clone_from(&found.positions);
            self.prefer(found.positions, found.certificate);
            if is_stuck {
                break;
            }
        }
    }

    /// Where few crossings are left in the end, tries to mend them with other gaps. None where limits are strict. Returns whether that
    /// was better. `start`: when all of it began.
    pub(super) fn mend_last(
        &mut self,
        body: &Surface<f64>,
        layers: &[Layer<'_>],
        settings: &ResolveSettings,
        start: Instant,
    ) -> bool {
        let mut is_better = false;
        let attempts = if settings.loosened > 1.0 { &LAST[..] } else { &[] };
        for (gap, rings) in attempts {
            let left = self.certificate.between();
            if left == 0 || left > FEW || settings.is_late(start, layers.len()) {
                break;
            }
            let settings =
                ResolveSettings { gap: gap * settings.gap, rings: rings * settings.rings, ..*settings };
            let found = resolved_once(body, &at(layers, &self.positions), &settings, start);
            self.add_work(&found);
            is_better |= self.prefer(found.positions, found.certificate);
        }
        is_better
    }

    /// Where nothing crosses but garments themselves, lays out what of them is folded, beside where they are `skinned`, and begins
    /// once more from there. Returns whether that was better. `start`: when all of it began.
    pub(super) fn lay_out(
        &mut self,
        body: &Surface<f64>,
        layers: &[Layer<'_>],
        skinned: &[Vec<[f64; 3]>],
        settings: &ResolveSettings,
        start: Instant,
    ) -> bool {
        let is_smooth = self.certificate.self_triangle_pairs <= FEW_OF_ITSELF;
        if is_smooth || !self.certificate.is_clear() || settings.is_late(start, layers.len()) {
            return false;
        }
        let now = at(layers, &self.positions);
        let folds = Folds::of(body, &now, skinned);
        if folds.is_empty() {
            return false;
        }
        let laid_out = folds.laid_out(&now, skinned);
        let mut found = resolved_once(body, &at(layers, &laid_out), settings, start);
        found.go_on(body, layers, settings, start);
        self.add_work(&found);
        self.prefer(found.positions, found.certificate)
    }

    /// The better of two results for the same drape: the one with fewer [`Certificate::flaws`], of equal ones the one with fewer
    /// pairs that are narrow, then `self`. It counts the work of both.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        self.or_by(other, |c| (c.flaws(), c.between()))
    }

    /// [`or`](Self::or) where the one of lower `rank` is the better one.
    pub(super) fn or_by<K: Ord>(mut self, mut other: Self, rank: impl Fn(&Certificate) -> K) -> Self {
        if rank(&other.certificate) < rank(&self.certificate) {
            std::mem::swap(&mut self, &mut other);
        }
        self.add_work(&other);
        self.steps += other.steps;
        for (work, further) in self.garments.iter_mut().zip(&other.garments) {
            work.time += further.time;
        }
        self
    }

    /// Counts the rounds of another attempt, and its time for the body and for certificates.
    pub(super) fn add_work(&mut self, attempt: &Self) {
        for (work, further) in self.garments.iter_mut().zip(&attempt.garments) {
            work.rounds += further.rounds;
        }
        self.body_time += attempt.body_time;
        self.certificate_time += attempt.certificate_time;
    }

    /// Takes another state of the garments if it is better; whether it is.
    pub(super) fn prefer(&mut self, positions: Vec<Vec<[f64; 3]>>, certificate: Certificate) -> bool {
        let is_better = certificate.defects() < self.certificate.defects();
        if is_better {
            (self.positions, self.certificate) = (positions, certificate);
        }
        is_better
    }

    /// [`compare`](Self::compare) for work that began at `start`, without the time for the body and for certificates.
    pub(super) fn compare_since(&mut self, layers: &[Layer<'_>], start: Instant) {
        self.compare(layers, start.elapsed().saturating_sub(self.body_time + self.certificate_time));
    }

    /// Tells moves and strain from `layers`, and that all of it took `time`.
    pub(super) fn compare(&mut self, layers: &[Layer<'_>], time: Duration) {
        let count: usize = self.positions.iter().map(Vec::len).sum();
        for ((work, layer), positions) in self.garments.iter_mut().zip(layers).zip(&self.positions) {
            let moves = layer.positions.iter().zip(positions).map(|(p, q)| vec3::norm(vec3::sub(*q, *p)));
            work.moved = moves.clone().filter(|m| *m > 0.0).count();
            work.largest_move = moves.fold(0.0, f64::max);
            work.time = time.mul_f64(positions.len() as f64 / count.max(1) as f64);
        }
        self.certificate.compare_strain(layers);
    }
}

/// What untangling left, brought back to the body as it is drawn where it can be, with its certificate. All of it began at
/// `start`.
pub(super) fn settled(
    body: &Body<'_>,
    layers: &[Layer<'_>],
    found: Untangled,
    settings: &ResolveSettings,
    room: Room,
    start: Instant,
) -> Resolved {
    let mut resolved = judged(&body.drawn, layers, found);
    ClosingIn { body, layers, room, start }.improve(&mut resolved, settings);
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

/// The certificate of garments that went from `layers`, near which the body is `drawn`, to `positions`.
pub(super) fn certified(
    drawn: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    positions: &[Vec<[f64; 3]>],
) -> Certificate {
    let now = at(layers, positions);
    match is_near(layers, positions) {
        true => certificate(drawn, &now),
        false => certified_around(drawn.surface, &now),
    }
}

/// Whether nothing moved so far from `layers` that it could meet more of the body than what is near those.
pub(super) fn is_near(layers: &[Layer<'_>], positions: &[Vec<[f64; 3]>]) -> bool {
    let is_near = |(p, q): (&[f64; 3], &[f64; 3])| vec3::norm(vec3::sub(*q, *p)) <= MARGIN;
    layers.iter().zip(positions).all(|(layer, moved)| layer.positions.iter().zip(moved).all(is_near))
}
