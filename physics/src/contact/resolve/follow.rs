//! Garments taken along, step by step, from a pose in which their order is plain to one in which it is not.
//!
//! In a pose with bent limbs the drape alone does not tell where cloth belongs: a knee has gone through a skirt, a sleeve through
//! the side of the chest, and the nearest way out is the wrong one. In the T-pose nothing of that has happened. On a way from there
//! each step is short: what was resolved before is carried along by skinning and by what the drape changes, crossings are
//! shallow, and the nearest way out is right. Where a step leaves more crossings than there were, a shorter one is
//! tried.

use std::sync::Arc;
use std::time::Instant;

use super::body::{Body, with_body, with_drawn};
use super::obstacle::BodyObstacle;
use super::taken_back::{shares, taken_back};
use super::{
    Layer, ResolveError, ResolveSettings, Resolved, Untangled, at, check, is_near, resolved_further, settled,
    untangled,
};
use crate::query::Surface;
use crate::transform::{Transform, into_frame, out_of_frame};
use crate::vec3::{add, scale, sub};

/// The longest step from the T-pose, as a share of the way; the way between frames may be one.
const LONGEST: f64 = 1.0 / 4.0;
/// The shortest one: it is taken even where it leaves more crossings than there were.
const SHORTEST: f64 = 1.0 / 128.0;
/// The shortest one with drapes that are taken back: where those help they do so at once.
const SHORTEST_TAKEN_BACK: f64 = 1.0 / 16.0;
/// The shortest one from a frame that was not clear.
const SHORTEST_OF_CROSSED: f64 = 1.0 / 4.0;
/// After as many of the shortest that left more crossings, the rest of the way is one step.
const MOST_FAILURES: usize = 3;
/// A rise of the strain energy, as a share, that is only accepted where the way leaves crossings.
const TORN: f64 = 1.0;
/// Steps without further crossings after which a longer one is tried.
const GOOD_STEPS: usize = 2;
/// How much of what the post-process changed is kept from step to step, so that old changes fade.
const KEPT: f64 = 0.95;

/// What is somewhere along the way.
#[derive(Clone)]
pub struct Waypoint {
    /// The body.
    pub body: Arc<Surface<f64>>,
    /// The drape on it, `[V, 3]` per garment [m].
    pub draped: Vec<Vec<[f64; 3]>>,
    /// What that began from: the garments as skinning alone puts them.
    pub skinned: Vec<Vec<[f64; 3]>>,
    /// Skinning transforms of all vertices, garment after garment, from one and the same state.
    pub transforms: Vec<Transform>,
}

/// Garments that are resolved, as far as they could be: where a way starts.
pub struct Reached {
    /// Their drape before that, `[V, 3]` each [m].
    pub draped: Vec<Vec<[f64; 3]>>,
    /// Where they are now.
    pub positions: Vec<Vec<[f64; 3]>>,
    /// Skinning transforms, as in [`Waypoint`].
    pub transforms: Vec<Transform>,
    /// Pairs with the body and between garments that are left in `positions`, but for narrow and pinched ones.
    pub crossings: usize,
}

impl Reached {
    fn new(stage: Waypoint, found: Untangled) -> Self {
        let Waypoint { draped, transforms, .. } = stage;
        Self { draped, positions: found.positions, transforms, crossings: found.crossings }
    }
}

/// As [`super::resolve`], with a second way out: where crossings of `layers` on `body` cannot be mended, the garments are taken
/// along from the stage at 0, the T-pose, to the stage at 1, which is `body` with `layers`; where that leaves crossings, once more
/// with drapes that are taken back towards the skinned garments around them. What leaves the fewest is returned.
///
/// # Errors
/// Those of `stage_at` and of [`super::resolve`].
pub fn resolve_along<E: From<ResolveError>>(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    mut stage_at: impl FnMut(f64) -> Result<Waypoint, E>,
) -> Result<Resolved, E> {
    settings.check()?;
    check(body, layers)?;
    resolved_further(body, layers, settings, |room, mut best, start| {
        let is_torn = best.certificate.strain_added.is_some_and(|added| added > TORN);
        if best.certificate.is_clear() && !is_torn || settings.steps == 0 {
            return Ok(best);
        }
        let way = Way { layers, end: room, settings, start, longest: LONGEST, shortest: SHORTEST };
        let t_pose = stage_at(0.0)?;
        way.improve(&mut best, body, t_pose.clone(), &mut stage_at)?;
        // Where most of what crosses is pinched it is the body, not the drape, that leaves no way out.
        if best.certificate.between() > best.certificate.pinched.count() {
            let shares = shares(&best.certificate, layers, &t_pose.draped);
            let nearer = taken_back(t_pose.clone(), &shares);
            if nearer.draped != t_pose.draped {
                let way = Way { shortest: SHORTEST_TAKEN_BACK, ..way };
                let nearer_at = |at: f64| stage_at(at).map(|stage| taken_back(stage, &shares));
                way.improve(&mut best, body, nearer, nearer_at)?;
            }
        }
        Ok(best)
    })
}

/// Resolves `layers` on `body`, the stage at 1, by carrying on from `before`, the frame of a motion before it, at 0. What
/// was done there is kept, fading, so that nothing pops. None where the time of `settings` is used up, or no step allowed.
///
/// # Errors
/// Those of `stage_at` and of [`super::resolve`].
pub fn resolve_after<E: From<ResolveError>>(
    before: Reached,
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    stage_at: impl FnMut(f64) -> Result<Waypoint, E>,
) -> Result<Option<Resolved>, E> {
    let start = Instant::now();
    settings.check()?;
    check(body, layers)?;
    let carry_on = |body: &Body<'_>| {
        let body_time = start.elapsed();
        let shortest = if before.crossings == 0 { SHORTEST } else { SHORTEST_OF_CROSSED };
        let way = Way { layers, end: body, settings, start, longest: 1.0, shortest };
        let (followed, steps) = way.follow(before, stage_at)?;
        let Some(found) = followed else { return Ok(None) };
        let mut resolved = settled(body, layers, found, settings);
        resolved.body_time = body_time;
        resolved.go_on(body.drawn.surface, layers, settings, start);
        resolved.compare_since(layers, start);
        resolved.steps = steps;
        Ok(Some(resolved))
    };
    with_drawn(body, layers, |drawn| with_body(drawn, layers.len(), carry_on))
}

/// Where garments are to be taken.
struct Way<'a, 'b> {
    layers: &'a [Layer<'a>],
    /// The body at 1.
    end: &'a Body<'b>,
    settings: &'a ResolveSettings,
    /// When it began.
    start: Instant,
    /// Longest and shortest step, as shares of the way.
    longest: f64,
    shortest: f64,
}

impl Way<'_, '_> {
    /// Resolves garments in the T-pose and takes them to 1; what comes of it is taken if it is better than the `best` so far.
    /// Crossings that are there in the T-pose already are not mended on a way.
    fn improve<E: From<ResolveError>>(
        &self,
        best: &mut Resolved,
        body: &Surface<f64>,
        t_pose: Waypoint,
        stage_at: impl FnMut(f64) -> Result<Waypoint, E>,
    ) -> Result<(), E> {
        let (layers, settings) = (self.layers, self.settings);
        check(&t_pose.body, &placed(layers, &t_pose.draped)?)?;
        let first = on_stage(layers, &t_pose, settings, std::slice::from_ref(&t_pose.draped));
        if first.crossings > 0 && first.crossings >= best.certificate.crossings() {
            return Ok(());
        }
        let (followed, steps) = self.follow(Reached::new(t_pose, first), stage_at)?;
        best.steps += steps;
        let Some(found) = followed else { return Ok(()) };
        let mut along = settled(self.end, layers, found, settings);
        along.go_on(body, layers, settings, self.start);
        best.add_work(&along);
        match along.certificate.is_clear() {
            true => (best.positions, best.certificate) = (along.positions, along.certificate),
            false => best.prefer(along.positions, along.certificate),
        }
        Ok(())
    }

    /// Takes garments from where they are `reached`, at 0, to the stage at 1; also how many steps were tried. None where the time
    /// is used up, or no step allowed.
    fn follow<E: From<ResolveError>>(
        &self,
        mut reached: Reached,
        mut stage_at: impl FnMut(f64) -> Result<Waypoint, E>,
    ) -> Result<(Option<Untangled>, usize), E> {
        check(self.end.drawn.surface, &placed(self.layers, &reached.draped)?)?;
        check(self.end.drawn.surface, &placed(self.layers, &reached.positions)?)?;
        let (mut from, mut step, mut steps) = (0.0, self.longest, 0);
        // How many steps in a row went well, and how many of the shortest did not.
        let (mut well, mut failures) = (0, 0);
        while steps < self.settings.steps && !self.is_late() {
            let is_last = failures >= MOST_FAILURES || steps + 1 == self.settings.steps;
            let is_shortest = is_last || step <= self.shortest * (1.0 + 1e-9);
            let at = if is_last || step > 1.0 - from - 1e-9 { 1.0 } else { from + step };
            let stage = stage_at(at)?;
            check(&stage.body, &placed(self.layers, &stage.draped)?)?;
            steps += 1;
            // What may be halved is not worth a second attempt.
            let loosened = if is_shortest { self.settings.loosened } else { 1.0 };
            let settings = ResolveSettings { is_shallow: !is_last, loosened, ..*self.settings };
            let kept: &[f64] = if is_shortest { &[KEPT, 1.0] } else { &[KEPT] };
            let starts: Vec<_> = kept.iter().map(|kept| carried(&reached, &stage, *kept)).collect();
            for start in &starts {
                check(&stage.body, &placed(self.layers, start)?)?;
            }
            let untangled = match at == 1.0 && starts.iter().all(|start| is_near(self.layers, start)) {
                true => least_crossed(self.end.obstacle(), self.layers, &settings, &starts),
                false => on_stage(self.layers, &stage, &settings, &starts),
            };
            let is_worse = untangled.crossings > reached.crossings;
            if is_worse && !is_shortest {
                (step, well) = (0.5 * step, 0);
            } else if at == 1.0 {
                return Ok((Some(untangled), steps));
            } else {
                match is_worse {
                    false => well += 1,
                    true => (failures, well) = (failures + 1, 0),
                }
                if well >= GOOD_STEPS {
                    (step, well) = ((2.0 * step).min(self.longest), 0);
                }
                from = at;
                reached = Reached::new(stage, untangled);
            }
        }
        Ok((None, steps))
    }

    fn is_late(&self) -> bool {
        self.settings.is_late(self.start, self.layers.len())
    }
}

/// Untangles the garments at `stage` from the best of `starts`.
fn on_stage(
    layers: &[Layer<'_>],
    stage: &Waypoint,
    settings: &ResolveSettings,
    starts: &[Vec<Vec<[f64; 3]>>],
) -> Untangled {
    let mut places = at(layers, &stage.draped);
    places.extend(starts.iter().flat_map(|start| at(layers, start)));
    let untangle = |body: &Body<'_>| least_crossed(body.obstacle(), layers, settings, starts);
    with_drawn(&stage.body, &places, |drawn| with_body(drawn, layers.len(), untangle))
}

/// Untangles the garments at each of `starts` until one has no crossing; the best.
fn least_crossed(
    obstacle: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    starts: &[Vec<Vec<[f64; 3]>>],
) -> Untangled {
    let mut best: Option<Untangled> = None;
    for start in starts {
        let now = untangled(obstacle, &at(layers, start), settings);
        if best.as_ref().is_none_or(|best| now.crossings < best.crossings) {
            best = Some(now);
        }
        if best.as_ref().is_some_and(|best| best.crossings == 0) {
            break;
        }
    }
    best.unwrap_or_default()
}

/// The garments elsewhere, if that is all of them.
fn placed<'a>(layers: &[Layer<'a>], positions: &'a [Vec<[f64; 3]>]) -> Result<Vec<Layer<'a>>, ResolveError> {
    let garment = positions.len().min(layers.len());
    match layers.get(garment) {
        Some(missing) => {
            Err(ResolveError::Count { garment, expected: missing.garment.vertex_count(), found: 0 })
        }
        None => Ok(at(layers, positions)),
    }
}

/// The drape at `stage` with what the post-process had changed before, turned as skinning turns it.
fn carried(reached: &Reached, stage: &Waypoint, kept: f64) -> Vec<Vec<[f64; 3]>> {
    let mut transforms = reached.transforms.iter().zip(&stage.transforms);
    let garments = stage.draped.iter().zip(&reached.draped).zip(&reached.positions);
    garments
        .map(|((draped, before), resolved)| {
            let vertices = draped.iter().zip(before).zip(resolved).zip(&mut transforms);
            vertices
                .map(|(((p, before), resolved), (from, to))| {
                    let change = into_frame(from, sub(*resolved, *before));
                    add(*p, out_of_frame(to, scale(change, kept)))
                })
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests;
