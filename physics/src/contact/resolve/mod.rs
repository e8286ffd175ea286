//! The post-process: takes draped garments out of the body and out of each other, and proves what it reached.
//!
//! All garments of an outfit are resolved together, so that an inner one gives way to an outer one.
//!
//! 1. **Vertices.** The closest point of the body (of the union of its parts, [`crate::query::UnionDistance`]) leaves a vertex a
//!    half-space. Along its own direction away from the body it sees the sheets of inner garments, and has to stay over the
//!    outermost ([`over`]); past a hem there is none.
//! 2. **Triangles.** Vertices outside are not enough where cloth is coarser than the body. Every pair of triangles that crosses,
//!    found exactly ([`detect`]), asks the part of one over the other to lie above it; linear heights make that sufficient. Which
//!    one is above is told by the directions away from the body: the outer garment, or, where two sheets look at each other
//!    (a sleeve and the side of the chest), each on its own part's side, whichever garments they belong to.
//! 3. **Folds.** Sheets of one garment that cross and have no such order are parted by what most of their vertices say
//!    ([`folds`]), crumples are smoothed.
//! 4. **Relaxation.** Vertices on the wrong side and their neighbourhood move by a displacement from the input that is smooth,
//!    keeps edge lengths, and meets all conditions as far as no edge is stretched more than allowed ([`relax`]); everything
//!    else keeps its position to the bit. Conditions of a crossing are kept for good. Repeated until no pair is left or
//!    nothing gets better; the best state is taken.
//! 5. **Certificate.** All pairs are counted again, from nothing, by the exact predicates.
//!
//! **Pinched regions**, where the body lies inside itself, are told apart by a stated rule: `BodyObstacle`. There, and where
//! hardly any cloth fits between two parts, the body gives way ([`relief`]) where crossings are left otherwise; in the
//! end garments are brought out of it again where they can.
//!
//! **Once more.** Where few crossings are left, what was reached is resolved like a new drape.
//!
//! **Easing.** Where the strain energy has risen, cloth gives back what it can without crossing anything ([`ease`]).
//!
//! **Bent limbs.** Where crossings are left, [`resolve_along`] takes the garments from the T-pose, where their order is plain,
//! step by step to the pose ([`follow`]).

mod body;
mod certificate;
mod contact;
mod detect;
mod ease;
mod error;
mod folds;
mod follow;
mod garment;
mod layer_obstacle;
mod near;
mod obstacle;
mod outfit;
mod over;
mod relax;
mod relief;
mod settings;
#[cfg(test)]
mod tests;
mod untangle;

use std::time::{Duration, Instant};

pub use certificate::{Certificate, Crossed, GarmentCertificate, PinchedPairs, RemainingPair, certify};
pub use error::ResolveError;
pub use follow::{Reached, Waypoint, resolve_after, resolve_along};
pub use garment::{Layer, RestGarment};
pub use settings::ResolveSettings;

use crate::query::Surface;
use crate::vec3;
use body::{Body, with_body, with_drawn};
use certificate::certificate;
use near::MARGIN;
use obstacle::BodyObstacle;
use outfit::Outfit;
use untangle::Untangling;

/// Positions farther from the origin than this are refused [m]: the exact predicates would hold, but no distance would.
const FARTHEST: f64 = 1e3;

/// Most attempts that begin where another one ended…
const FURTHER_ATTEMPTS: usize = 3;
/// …and most pairs that may be left there: more would only be torn further.
const FEW: usize = 32;

/// Garments that were resolved.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Resolved {
    /// New positions of every garment, `[V, 3]` [m], in the order given.
    pub positions: Vec<Vec<[f64; 3]>>,
    /// What is left.
    pub certificate: Certificate,
    /// What was done, per garment.
    pub garments: Vec<GarmentWork>,
    /// Steps that were tried: from the T-pose, by [`resolve_along`] (0 where the drape could be mended as it was), or from the
    /// frame before, by [`resolve_after`].
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
    /// Where cloth lies in room that the body only made for it, tries to do without: the body gives way no more than where it
    /// lies inside itself. Taken if fewer pairs are left.
    fn close_in(&mut self, body: &Body<'_>, layers: &[Layer<'_>], settings: &ResolveSettings) {
        if self.certificate.narrow_triangle_pairs == 0 {
            return;
        }
        let settings = ResolveSettings { is_shallow: true, loosened: 1.0, ..*settings };
        let now = at(layers, &self.positions);
        let closer = body.with_least_room(|obstacle| untangled(obstacle, &now, &settings));
        let certificate = certified(&body.drawn, layers, &closer.positions);
        self.prefer(closer.positions, certificate);
    }

    /// Where few crossings are left on `body`, attempts that begin where the one before ended: cloth that is nearly sorted out is
    /// the better shape to return to and to measure lengths from than the drape it came from. None where limits are strict
    /// (`settings.loosened`). `start`: when all of it began.
    fn go_on(
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
            if left == 0 || left > FEW || settings.is_late(start, layers.len()) {
                break;
            }
            let found = resolved_once(body, &at(layers, &now), settings);
            self.add_work(&found);
            let is_stuck = found.positions == now;
            now.clone_from(&found.positions);
            self.prefer(found.positions, found.certificate);
            if is_stuck {
                break;
            }
        }
    }

    /// The better of two results for the same drape: the one with fewer crossings, `self` of equal ones. It counts the work
    /// of both.
    #[must_use]
    pub fn or(mut self, mut other: Self) -> Self {
        let rank = |c: &Certificate| (c.crossings(), c.between());
        if rank(&other.certificate) < rank(&self.certificate) {
            std::mem::swap(&mut self, &mut other);
        }
        self.add_work(&other);
        for (work, further) in self.garments.iter_mut().zip(&other.garments) {
            work.time += further.time;
        }
        self
    }

    /// Counts the rounds of another attempt, and its time for the body and for certificates.
    fn add_work(&mut self, attempt: &Self) {
        for (work, further) in self.garments.iter_mut().zip(&attempt.garments) {
            work.rounds += further.rounds;
        }
        self.body_time += attempt.body_time;
        self.certificate_time += attempt.certificate_time;
    }

    /// Takes another state of the garments if it is better.
    fn prefer(&mut self, positions: Vec<Vec<[f64; 3]>>, certificate: Certificate) {
        if certificate.defects() < self.certificate.defects() {
            (self.positions, self.certificate) = (positions, certificate);
        }
    }

    /// [`compare`](Self::compare) for work that began at `start`, without the time for the body and for certificates.
    fn compare_since(&mut self, layers: &[Layer<'_>], start: Instant) {
        self.compare(layers, start.elapsed().saturating_sub(self.body_time + self.certificate_time));
    }

    /// Tells moves and strain from `layers`, and that all of it took `time`.
    fn compare(&mut self, layers: &[Layer<'_>], time: Duration) {
        let count: usize = self.positions.iter().map(Vec::len).sum();
        for ((work, layer), positions) in self.garments.iter_mut().zip(layers).zip(&self.positions) {
            let moves = layer.positions.iter().zip(positions).map(|(p, q)| vec3::norm(vec3::sub(*q, *p)));
            work.moved = moves.clone().filter(|m| *m > 0.0).count();
            work.largest_move = moves.fold(0.0, f64::max);
            work.time = time.mul_f64(positions.len() as f64 / count.max(1) as f64);
        }
        self.certificate.compare_strain(layers.iter().map(|l| l.garment.strain_energy(l.positions)).sum());
    }
}

/// Takes `layers`, innermost first, out of `body` and out of each other. Deterministic for any number of threads (without a
/// time limit in the settings); a clean input comes back to the bit.
///
/// # Errors
/// When a setting is out of range, positions do not fit their garment or are not finite, or the body has no surface.
/// Crossings that cannot be mended are no error: the certificate lists them.
pub fn resolve(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
) -> Result<Resolved, ResolveError> {
    settings.check()?;
    check(body, layers)?;
    resolved_further(body, layers, settings, |_, found, _| Ok(found))
}

/// [`resolve`] for valid arguments. Where something is left to do after the first attempts, `further` may go on from there: it
/// gets the body, what was reached, and when all began.
fn resolved_further<E>(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    further: impl FnOnce(&Body<'_>, Resolved, Instant) -> Result<Resolved, E>,
) -> Result<Resolved, E> {
    let start = Instant::now();
    with_drawn(body, layers, |drawn| {
        let simple = simply_resolved(&drawn, layers, settings, start);
        if simple.certificate.is_clear() {
            return Ok(simple);
        }
        let relieving = Instant::now();
        with_body(drawn, layers.len(), |room| {
            let mut found = resolved(room, layers, settings, simple, relieving);
            found.go_on(body, layers, settings, start);
            found.compare_since(layers, start);
            let mut found = further(room, found, start)?;
            found.ease(room, layers, settings, start);
            found.compare_since(layers, start);
            Ok(found)
        })
    })
}

/// [`resolve`] without what follows the first attempts.
fn resolved_once(body: &Surface<f64>, layers: &[Layer<'_>], settings: &ResolveSettings) -> Resolved {
    let start = Instant::now();
    with_drawn(body, layers, |drawn| {
        let simple = simply_resolved(&drawn, layers, settings, start);
        if simple.certificate.is_clear() {
            return simple;
        }
        let relieving = Instant::now();
        with_body(drawn, layers.len(), |body| resolved(body, layers, settings, simple, relieving))
    })
}

/// [`resolve`] on a body that does not give way, whose preparation began at `start`: enough for most garments.
fn simply_resolved(
    drawn: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    start: Instant,
) -> Resolved {
    let body_time = start.elapsed();
    let now = Instant::now();
    // Wider limits are for what is left when the body has given way.
    let settings = ResolveSettings { loosened: 1.0, ..*settings };
    let mut resolved = judged(drawn, layers, untangled(drawn, layers, &settings));
    resolved.body_time = body_time;
    resolved.compare(layers, now.elapsed() - resolved.certificate_time);
    resolved
}

/// [`resolve`] on a body that gives way, prepared since `start`; `simple` is what was reached before it did, and stays where it
/// is better.
fn resolved(
    body: &Body<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    simple: Resolved,
    start: Instant,
) -> Resolved {
    let obstacle = body.obstacle();
    let body_time = simple.body_time + start.elapsed();
    let now = Instant::now();
    let mut found = settled(body, layers, untangled(obstacle, layers, settings), settings);
    let own: Duration = simple.garments.iter().map(|work| work.time).sum();
    let time = own + now.elapsed() - found.certificate_time;
    let certificate_time = simple.certificate_time + found.certificate_time;
    let rounds = |resolved: &Resolved| resolved.garments.first().map_or(0, |work| work.rounds);
    let all_rounds = rounds(&simple) + rounds(&found);
    let mut certificate = simple.certificate;
    certificate.count_narrow(&body.drawn);
    found.prefer(simple.positions, certificate);
    found.garments.iter_mut().for_each(|work| work.rounds = all_rounds);
    (found.body_time, found.certificate_time) = (body_time, certificate_time);
    found.compare(layers, time);
    found
}

/// What untangling left, brought back to the body as it is drawn where it can be, with its certificate.
fn settled(body: &Body<'_>, layers: &[Layer<'_>], found: Untangled, settings: &ResolveSettings) -> Resolved {
    let mut resolved = judged(&body.drawn, layers, found);
    resolved.close_in(body, layers, settings);
    resolved
}

/// What untangling left, with its certificate.
fn judged(drawn: &BodyObstacle<'_>, layers: &[Layer<'_>], found: Untangled) -> Resolved {
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
fn certified(drawn: &BodyObstacle<'_>, layers: &[Layer<'_>], positions: &[Vec<[f64; 3]>]) -> Certificate {
    let now = at(layers, positions);
    match is_near(layers, positions) {
        true => certificate(drawn, &now),
        false => with_drawn(drawn.surface, &now, |around| {
            let mut found = certificate(&around, &now);
            found.count_narrow(drawn);
            found
        }),
    }
}

/// Whether nothing moved so far from `layers` that it could meet more of the body than what is near those.
fn is_near(layers: &[Layer<'_>], positions: &[Vec<[f64; 3]>]) -> bool {
    let is_near = |(p, q): (&[f64; 3], &[f64; 3])| vec3::norm(vec3::sub(*q, *p)) <= MARGIN;
    layers.iter().zip(positions).all(|(layer, moved)| layer.positions.iter().zip(moved).all(is_near))
}

/// The same garments elsewhere.
fn at<'a>(layers: &[Layer<'a>], positions: &'a [Vec<[f64; 3]>]) -> Vec<Layer<'a>> {
    layers.iter().zip(positions).map(|(l, positions)| Layer { garment: l.garment, positions }).collect()
}

/// What untangling left.
#[derive(Clone, Default)]
struct Untangled {
    positions: Vec<Vec<[f64; 3]>>,
    rounds: usize,
    /// Pairs with the body and between garments.
    crossings: usize,
}

fn untangled(body: &BodyObstacle<'_>, layers: &[Layer<'_>], settings: &ResolveSettings) -> Untangled {
    let outfit = Outfit::new(layers);
    let mut untangling = Untangling::new(&outfit, body, settings);
    let rounds = untangling.run();
    let positions = (0..outfit.len()).map(|g| outfit.part(&untangling.positions, g).to_vec()).collect();
    Untangled { positions, rounds, crossings: untangling.crossings() }
}

/// Positions and faces of every garment.
fn triangles<'a>(layers: &[Layer<'a>]) -> Vec<(&'a [[f64; 3]], &'a [[u32; 3]])> {
    layers.iter().map(|l| (l.positions, l.garment.faces.as_slice())).collect()
}

/// Whether the input can be worked on.
fn check(body: &Surface<f64>, layers: &[Layer<'_>]) -> Result<(), ResolveError> {
    let is_near = |p: &[f64; 3]| vec3::is_finite(*p) && p.iter().all(|x| x.abs() <= FARTHEST);
    let is_whole = |f: &[u32; 3]| f.iter().all(|&v| body.positions.get(v as usize).is_some_and(is_near));
    if !body.faces.iter().any(is_whole) {
        return Err(ResolveError::EmptyBody);
    }
    for (garment, layer) in layers.iter().enumerate() {
        let (expected, found) = (layer.garment.vertex_count(), layer.positions.len());
        if expected != found {
            return Err(ResolveError::Count { garment, expected, found });
        }
        if let Some(vertex) = layer.positions.iter().position(|p| !is_near(p)) {
            return Err(ResolveError::Position { garment, vertex, position: layer.positions[vertex] });
        }
    }
    Ok(())
}
