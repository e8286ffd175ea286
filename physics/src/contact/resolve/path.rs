//! A path that garments are taken, step by step: which steps are tried, and what is done at each.

use std::sync::OnceLock;

use super::attempt::{FEW, settled};
use super::body::{Body, with_body_after, with_drawn};
use super::budget::Budget;
use super::clearance::{Before, Clearance};
use super::garment::{at, check};
use super::obstacle::BodyObstacle;
use super::outfit::Outfit;
use super::sides::Sides;
use super::step_lengths::StepLengths;
use super::untangle::{Untangled, untangled, untangled_keeping};
use super::{Layer, PathSample, Reached, ResolveError, ResolveSettings, Resolved};
use crate::transform::{into_frame, out_of_frame};
use crate::vec3::{add, scale, sub};

/// The rest of the path is one step where, since nothing crossed, so many steps as short as may be left more crossings all the
/// same: on paths that end clear it is one at most.
const FAILURES: usize = 3;
/// Steps without further crossings after which a longer one is tried.
const GOOD_STEPS: usize = 4;
/// How much of what the post-process changed is kept in a long step, so that old changes fade…
const KEPT: f64 = 0.95;
/// …and the share of the path from which on a step is long: shorter ones keep more.
const FADING: f64 = 1.0 / 16.0;
/// How much more the body may give way, or less, on a whole path (m): about as fast as limbs move.
const GIVING_WAY: f64 = 0.5;

/// Where garments are to be taken.
pub(super) struct Path<'a, 'b> {
    pub layers: &'a [Layer<'a>],
    /// The body at 1.
    pub end: &'a Body<'b>,
    pub settings: &'a ResolveSettings,
    pub budget: &'a Budget,
    pub step_lengths: StepLengths,
}

/// Somewhere on the path.
struct Place {
    reached: Reached,
    /// How far the body gave way there, per vertex (m); none where that is not known.
    gave_way: Option<Vec<f64>>,
    /// Told when they are first asked for.
    sides: OnceLock<Sides>,
    /// Those of the place before, if they were asked for.
    sides_before: Option<Sides>,
}

impl Place {
    fn new(stage: PathSample, Arrived { untangled, gave_way }: Arrived, sides_before: Option<Sides>) -> Self {
        let PathSample { draped, transforms, .. } = stage;
        let Untangled { positions, crossings, .. } = untangled;
        let reached = Reached { draped, positions, transforms, crossings };
        Self { reached, gave_way: Some(gave_way), sides: OnceLock::new(), sides_before }
    }

    fn sides(&self, layers: &[Layer<'_>]) -> &Sides {
        let positions = || self.reached.positions.concat();
        self.sides.get_or_init(|| Sides::of(&Outfit::new(layers), &positions(), self.sides_before.as_ref()))
    }
}

/// What is at a stage when all was done there.
struct Arrived {
    untangled: Untangled,
    /// How far the body gave way, per vertex (m).
    gave_way: Vec<f64>,
}

impl Path<'_, '_> {
    /// Resolves garments in the T-pose and takes them to 1; what comes of it is taken if it is better than the `best` so far.
    /// Crossings that are there in the T-pose already are not mended on a path.
    pub fn improve<E: From<ResolveError>>(
        &self,
        best: &mut Resolved,
        t_pose: PathSample,
        stage_at: impl FnMut(f64) -> Result<PathSample, E>,
    ) -> Result<(), E> {
        if self.budget.is_nearly_spent() {
            return Ok(());
        }
        let (layers, settings) = (self.layers, self.settings);
        let first = on_stage(
            layers,
            &t_pose,
            &t_pose.draped,
            (self.step_lengths.clearance, None),
            |obstacle, start| untangled(obstacle, start, settings, self.budget),
        );
        let crossings = first.untangled.crossings;
        if crossings > 0 && crossings >= best.certificate.crossings() {
            return Ok(());
        }
        let most = best.certificate.crossings().max(FEW);
        let (followed, steps) = self.go(Place::new(t_pose, first, None), most, stage_at)?;
        best.steps += steps;
        let Some(found) = followed else { return Ok(()) };
        let mut along = settled(self.end, layers, found, settings, self.step_lengths.clearance, self.budget);
        along.go_on(self.end.drawn.surface, layers, settings, self.budget);
        best.prefer(layers, along.positions, along.certificate);
        Ok(())
    }

    /// Takes garments from where they are `reached`, at 0, to the stage at 1; also how many steps were tried. None where the time
    /// is used up, or no step allowed.
    pub fn continue_from<E: From<ResolveError>>(
        &self,
        reached: Reached,
        stage_at: impl FnMut(f64) -> Result<PathSample, E>,
    ) -> Result<(Option<Untangled>, usize), E> {
        let sides = OnceLock::new();
        self.go(Place { reached, gave_way: None, sides, sides_before: None }, usize::MAX, stage_at)
    }

    /// None, too, where more than `most` pairs intersect on the path.
    fn go<E: From<ResolveError>>(
        &self,
        mut place: Place,
        most: usize,
        mut stage_at: impl FnMut(f64) -> Result<PathSample, E>,
    ) -> Result<(Option<Untangled>, usize), E> {
        let StepLengths { longest, shortest, .. } = self.step_lengths;
        check(self.end.drawn.surface, &placed(self.layers, &place.reached.draped)?)?;
        check(self.end.drawn.surface, &placed(self.layers, &place.reached.positions)?)?;
        let (mut from, mut step, mut steps) = (0.0, longest, 0);
        // How many steps in a row went well, and how many of the shortest did not since nothing crossed: most crossings
        // that such a step leaves are mended in the next.
        let (mut well, mut failures) = (0, 0);
        while steps < self.settings.steps && !self.budget.is_spent() {
            let is_last =
                failures >= FAILURES || steps + 1 == self.settings.steps || self.budget.is_nearly_spent();
            let is_shortest = is_last || step <= shortest * (1.0 + 1e-9);
            let at = if is_last || step > 1.0 - from - 1e-9 { 1.0 } else { from + step };
            let stage = stage_at(at)?;
            steps += 1;
            let arrived = self.arrive(&place, &stage, at - from, is_shortest, is_last)?;
            let is_worse = arrived.untangled.crossings > place.reached.crossings;
            if is_worse && !is_shortest {
                // Of the step that was tried: the last one may be shorter than it might have been.
                (step, well) = (f64::max(0.5 * (at - from), shortest), 0);
            } else if arrived.untangled.crossings > most {
                break;
            } else if at == 1.0 {
                return Ok((Some(arrived.untangled), steps));
            } else {
                match is_worse {
                    false => well += 1,
                    true => (failures, well) = (failures + 1, 0),
                }
                if well >= GOOD_STEPS {
                    (step, well) = ((2.0 * step).min(longest), 0);
                }
                if arrived.untangled.crossings == 0 {
                    failures = 0;
                }
                from = at;
                place = Place::new(stage, arrived, place.sides.into_inner());
            }
        }
        Ok((None, steps))
    }

    /// Untangles garments at `stage`, `step` of the path after `place`: as at the start of a path, and, where that leaves
    /// crossings, with the sides that they had before, each as far as the step lengths allow.
    fn arrive(
        &self,
        place: &Place,
        stage: &PathSample,
        step: f64,
        is_shortest: bool,
        is_last: bool,
    ) -> Result<Arrived, ResolveError> {
        // What may be halved is not worth a second attempt.
        let loosened = if is_shortest { self.settings.loosened } else { 1.0 };
        let settings =
            ResolveSettings { is_shallow: !is_last, is_patient: is_shortest, loosened, ..*self.settings };
        let kept = KEPT.powf((step / FADING).min(1.0));
        let start = carried(&place.reached, stage, kept);
        check(&stage.body, &placed(self.layers, &start)?)?;
        let StepLengths { keeping, keeps_first, clearance, .. } = self.step_lengths;
        let before = place.gave_way.as_ref().map(|steps| Before { steps, most: GIVING_WAY * step });
        let layers = self.layers;
        Ok(on_stage(layers, stage, &start, (clearance, before), |obstacle, start| {
            let first =
                (step > keeping || !keeps_first).then(|| untangled(obstacle, start, &settings, self.budget));
            match first {
                Some(found) if step > keeping || found.crossings == 0 => return found,
                _ => (),
            }
            let kept = untangled_keeping(Some(place.sides(layers)), obstacle, start, &settings, self.budget);
            match first {
                Some(found) if found.defects() < kept.defects() => found,
                _ => kept,
            }
        }))
    }
}

/// Untangles the garments at `stage` by `untangle`, from `start`. The body gives way about as `before`.
fn on_stage(
    layers: &[Layer<'_>],
    stage: &PathSample,
    start: &[Vec<[f64; 3]>],
    (clearance, before): (Clearance, Option<Before<'_>>),
    untangle: impl FnOnce(&BodyObstacle<'_>, &[Layer<'_>]) -> Untangled,
) -> Arrived {
    let start = at(layers, start);
    let places = [at(layers, &stage.draped), start.clone()].concat();
    let arrive = |body: &Body<'_>| {
        let untangled = untangle(body.obstacle(), &start);
        Arrived { untangled, gave_way: body.steps() }
    };
    with_drawn(&stage.body, &places, |drawn| with_body_after(clearance, before, drawn, layers.len(), arrive))
}

/// The garments elsewhere, if that is all of them.
pub(super) fn placed<'a>(
    layers: &[Layer<'a>],
    positions: &'a [Vec<[f64; 3]>],
) -> Result<Vec<Layer<'a>>, ResolveError> {
    let garment = positions.len().min(layers.len());
    match layers.get(garment) {
        Some(missing) => {
            Err(ResolveError::Count { garment, expected: missing.garment.vertex_count(), found: 0 })
        }
        None => Ok(at(layers, positions)),
    }
}

/// The drape at `stage` with what the post-process had changed before, turned as skinning turns it.
fn carried(reached: &Reached, stage: &PathSample, kept: f64) -> Vec<Vec<[f64; 3]>> {
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
