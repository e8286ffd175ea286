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
//!    aims at the edge lengths there were, and meets all conditions as far as vertices may move ([`relax`]); everything
//!    else keeps its position to the bit. Conditions of a crossing are kept for good. Repeated until no pair is left or
//!    nothing gets better; the best state is taken.
//! 5. **Certificate.** All pairs are counted again, from nothing, by the exact predicates.
//!
//! **Pinched regions**, where the body lies inside itself, are told apart by a stated rule: `BodyObstacle`. There, and where
//! hardly any cloth fits between two parts, the body gives way ([`relief`]) where crossings are left otherwise; in the
//! end garments are brought out of it again where they can.
//!
//! **Once more.** Where few crossings are left, what was reached is resolved like a new drape, in the end with other gaps.
//!
//! **Easing.** Where the strain energy has risen, cloth gives back what it can without crossing anything ([`ease`]).
//!
//! **Folds of the drape.** What only a network folds into itself is laid out by [`resolve_along`] before all this ([`unfold`]), and
//! what of it is left in the end once more.
//!
//! **Bent limbs.** Where crossings are left, [`resolve_along`] takes the garments from the T-pose, where their order is plain,
//! step by step to the pose ([`follow`], [`way`]); in short steps cloth keeps the sides it was on before ([`sides`]). Where that
//! leaves some, it does so again with drapes that lie nearer to where they began ([`taken_back`]).

mod body;
mod certificate;
mod close_in;
mod contact;
mod count;
mod detect;
mod ease;
mod error;
mod folds;
mod follow;
mod garment;
mod near;
mod obstacle;
mod outfit;
mod over;
mod relax;
mod relief;
mod resolved;
mod settings;
mod sides;
mod stages;
mod strides;
mod taken_back;
#[cfg(test)]
mod tests;
mod unfold;
mod untangle;
mod way;

use std::time::{Duration, Instant};

pub use certificate::{
    Certificate, Crossed, GarmentCertificate, LayerCertificate, PinchedPairs, RemainingPair,
};
pub use count::certify;
pub use error::ResolveError;
pub use follow::{Reached, Waypoint, resolve_after, resolve_along};
pub use garment::{Layer, RestGarment};
pub use resolved::{GarmentWork, Resolved};
pub use settings::ResolveSettings;

use crate::query::Surface;
use crate::vec3;
use body::{Body, with_body, with_drawn};
use obstacle::BodyObstacle;
use outfit::Outfit;
use relief::Room;
use resolved::{certified, judged, settled};
use sides::Sides;
use untangle::Untangling;

/// Positions farther from the origin than this are refused [m]: the exact predicates would hold, but no distance would.
const FARTHEST: f64 = 1e3;

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
    resolved_further(body, layers, settings, Instant::now(), |_, found| Ok(found))
}

/// [`resolve`] for valid arguments, of which all began at `start`. Where something is left to do after the first attempt,
/// `further` may go on from there: it gets the body and what was reached.
fn resolved_further<E>(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    start: Instant,
    further: impl FnOnce(&Body<'_>, Resolved) -> Result<Resolved, E>,
) -> Result<Resolved, E> {
    let preparing = Instant::now();
    with_drawn(body, layers, |drawn| {
        let mut simple = simply_resolved(&drawn, layers, settings, preparing);
        if simple.certificate.is_clear() {
            simple.go_on(body, layers, settings, start);
            simple.compare_since(layers, start);
            return Ok(simple);
        }
        let relieving = Instant::now();
        with_body(drawn, layers.len(), |room| {
            let mut found = resolved(room, layers, settings, simple, (start, relieving));
            found.go_on(body, layers, settings, start);
            found.compare_since(layers, start);
            let mut found = further(room, found)?;
            found.ease(room, layers, settings, start, ease::TIMES);
            found.compare_since(layers, start);
            Ok(found)
        })
    })
}

/// [`resolve`] without what follows the first attempts; all of it began at `start`.
fn resolved_once(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    start: Instant,
) -> Resolved {
    let preparing = Instant::now();
    with_drawn(body, layers, |drawn| {
        let simple = simply_resolved(&drawn, layers, settings, preparing);
        if simple.certificate.is_clear() {
            return simple;
        }
        let relieving = Instant::now();
        with_body(drawn, layers.len(), |body| resolved(body, layers, settings, simple, (start, relieving)))
    })
}

/// [`resolve`] on a body that does not give way, in preparation since `preparing`: enough for most garments.
fn simply_resolved(
    drawn: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    preparing: Instant,
) -> Resolved {
    let body_time = preparing.elapsed();
    let now = Instant::now();
    // Wider limits are for what is left when the body has given way.
    let settings = ResolveSettings { loosened: 1.0, ..*settings };
    let mut resolved = judged(drawn, layers, untangled(drawn, layers, &settings));
    resolved.body_time = body_time;
    resolved.compare(layers, now.elapsed() - resolved.certificate_time);
    resolved
}

/// [`resolve`] on a body that gives way, prepared since `relieving`; `simple` is what was reached before it did, and stays where
/// it is better, or where all that began at `start` has had its time.
fn resolved(
    body: &Body<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    mut simple: Resolved,
    (start, relieving): (Instant, Instant),
) -> Resolved {
    simple.certificate.count_narrow(&body.drawn);
    if settings.is_late(start, layers.len()) {
        return simple;
    }
    let obstacle = body.obstacle();
    let body_time = simple.body_time + relieving.elapsed();
    let now = Instant::now();
    let found = untangled(obstacle, layers, settings);
    let mut found = settled(body, layers, found, settings, Room::AMPLE, start);
    let own: Duration = simple.garments.iter().map(|work| work.time).sum();
    let time = own + now.elapsed() - found.certificate_time;
    let certificate_time = simple.certificate_time + found.certificate_time;
    let rounds = |resolved: &Resolved| resolved.garments.first().map_or(0, |work| work.rounds);
    let all_rounds = rounds(&simple) + rounds(&found);
    found.prefer(simple.positions, simple.certificate);
    found.garments.iter_mut().for_each(|work| work.rounds = all_rounds);
    (found.body_time, found.certificate_time) = (body_time, certificate_time);
    found.compare(layers, time);
    found
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
    /// Pairs with the body where it is drawn and between garments, but for pinched ones.
    crossings: usize,
    /// Pairs with the body, where it gives way too.
    with_body: usize,
    /// Pairs of garments with themselves; on a way pinched ones too.
    own: usize,
}

fn untangled(body: &BodyObstacle<'_>, layers: &[Layer<'_>], settings: &ResolveSettings) -> Untangled {
    untangled_keeping(None, body, layers, settings)
}

/// [`untangled`] where the order of sheets is known from a step before.
fn untangled_keeping(
    sides: Option<&Sides>,
    body: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
) -> Untangled {
    let outfit = Outfit::new(layers);
    let mut untangling = Untangling::new(&outfit, body, settings, sides);
    let rounds = untangling.run();
    let positions = (0..outfit.len()).map(|g| outfit.part(&untangling.positions, g).to_vec()).collect();
    Untangled {
        positions,
        rounds,
        crossings: untangling.crossings(),
        with_body: untangling.body_crossings(),
        own: untangling.own_crossings(),
    }
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
