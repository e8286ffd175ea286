//! The steps of a continuation path: which ones are tried, and what is done at each.

use std::sync::OnceLock;

use super::attempt::{FEW, settled};
use super::body::{Body, with_body_after, with_drawn};
use super::budget::Budget;
use super::clearance::{Before, Clearance};
use super::contact_orientation::ContactOrientation;
use super::garment::{at, check};
use super::obstacle::BodyObstacle;
use super::outfit::Outfit;
use super::step_lengths::StepLengths;
use super::untangle::{Untangled, untangled, untangled_keeping};
use super::{ContactState, Layer, PathSample, ResolveError, ResolveSettings, Resolved};
use crate::transform::{into_frame, out_of_frame};
use crate::vec3::{add, scale, sub};

/// Shortest steps that may raise the number of intersections, since the last state without any, before the rest of the path is
/// taken in one step. Paths that end clear have one at most.
const FAILURES: usize = 3;
/// Steps that do not raise the number of intersections after which a longer one is tried.
const GOOD_STEPS: usize = 4;
/// Share of the post-process's changes that a long step keeps, so that old changes fade…
const KEPT: f64 = 0.95;
/// …and the share of the path from which on a step is long: shorter ones keep more.
const FADING: f64 = 1.0 / 16.0;
/// Most that the body's yield changes on a whole path (m): about as fast as limbs move.
const YIELD_PER_PATH: f64 = 0.5;

/// A path, and what its steps need.
pub(super) struct Path<'a, 'b> {
    pub layers: &'a [Layer<'a>],
    /// The body at 1.
    pub end: &'a Body<'b>,
    pub settings: &'a ResolveSettings,
    pub budget: &'a Budget,
    pub step_lengths: StepLengths,
}

/// A state on the path.
struct PathNode {
    state: ContactState,
    /// The body's yield there, per vertex (m); none if unknown.
    yielded: Option<Vec<f64>>,
    /// Computed when first needed.
    orientation: OnceLock<ContactOrientation>,
    /// That of the node before, if it was needed.
    orientation_before: Option<ContactOrientation>,
}

impl PathNode {
    fn new(
        sample: PathSample,
        StepResult { untangled, yielded }: StepResult,
        orientation_before: Option<ContactOrientation>,
    ) -> Self {
        let PathSample { draped, transforms, .. } = sample;
        let Untangled { positions, intersections, .. } = untangled;
        let state = ContactState { draped, positions, transforms, intersections };
        Self { state, yielded: Some(yielded), orientation: OnceLock::new(), orientation_before }
    }

    fn orientation(&self, layers: &[Layer<'_>]) -> &ContactOrientation {
        let positions = || self.state.positions.concat();
        self.orientation.get_or_init(|| {
            ContactOrientation::of(&Outfit::new(layers), &positions(), self.orientation_before.as_ref())
        })
    }
}

/// Garments untangled at a sample.
struct StepResult {
    untangled: Untangled,
    /// The body's yield, per vertex (m).
    yielded: Vec<f64>,
}

impl Path<'_, '_> {
    /// Resolves garments in the T-pose and takes them to 1; the result replaces `best` if it is better. A path does not mend
    /// intersections of the T-pose.
    pub fn improve<E: From<ResolveError>>(
        &self,
        best: &mut Resolved,
        t_pose: PathSample,
        sample_at: impl FnMut(f64) -> Result<PathSample, E>,
    ) -> Result<(), E> {
        if self.budget.is_nearly_spent() {
            return Ok(());
        }
        let (layers, settings) = (self.layers, self.settings);
        let first = at_sample(
            layers,
            &t_pose,
            &t_pose.draped,
            (self.step_lengths.clearance, None),
            |obstacle, start| untangled(obstacle, start, settings, self.budget),
        );
        let intersections = first.untangled.intersections;
        if intersections > 0 && intersections >= best.certificate.intersections() {
            return Ok(());
        }
        let most = best.certificate.intersections().max(FEW);
        let (followed, steps) = self.go(PathNode::new(t_pose, first, None), most, sample_at)?;
        best.steps += steps;
        let Some(found) = followed else { return Ok(()) };
        let mut along = settled(self.end, layers, found, settings, self.step_lengths.clearance, self.budget);
        along.go_on(self.end.drawn.surface, layers, settings, self.budget);
        best.prefer(layers, along.positions, along.certificate);
        Ok(())
    }

    /// Takes garments from `state`, at 0, to the sample at 1; also returns the number of steps tried. None if the time is used
    /// up, or no step allowed.
    pub fn continue_from<E: From<ResolveError>>(
        &self,
        state: ContactState,
        sample_at: impl FnMut(f64) -> Result<PathSample, E>,
    ) -> Result<(Option<Untangled>, usize), E> {
        let orientation = OnceLock::new();
        self.go(
            PathNode { state, yielded: None, orientation, orientation_before: None },
            usize::MAX,
            sample_at,
        )
    }

    /// As [`Self::continue_from`]; None, too, if more than `most` pairs intersect on the path.
    fn go<E: From<ResolveError>>(
        &self,
        mut node: PathNode,
        most: usize,
        mut sample_at: impl FnMut(f64) -> Result<PathSample, E>,
    ) -> Result<(Option<Untangled>, usize), E> {
        let StepLengths { longest, shortest, .. } = self.step_lengths;
        check(self.end.drawn.surface, &placed(self.layers, &node.state.draped)?)?;
        check(self.end.drawn.surface, &placed(self.layers, &node.state.positions)?)?;
        let (mut from, mut step, mut steps) = (0.0, longest, 0);
        // Successful steps in a row, and shortest steps that failed since the last state without intersections: the next step
        // mends most of what such a step leaves.
        let (mut well, mut failures) = (0, 0);
        while steps < self.settings.steps && !self.budget.is_spent() {
            let is_last =
                failures >= FAILURES || steps + 1 == self.settings.steps || self.budget.is_nearly_spent();
            let is_shortest = is_last || step <= shortest * (1.0 + 1e-9);
            let at = if is_last || step > 1.0 - from - 1e-9 { 1.0 } else { from + step };
            let sample = sample_at(at)?;
            steps += 1;
            let result = self.step_to(&node, &sample, at - from, is_shortest, is_last)?;
            let is_worse = result.untangled.intersections > node.state.intersections;
            if is_worse && !is_shortest {
                // Half of the step that was tried: the last one may have been shorter than `step`.
                (step, well) = (f64::max(0.5 * (at - from), shortest), 0);
            } else if result.untangled.intersections > most {
                break;
            } else if at == 1.0 {
                return Ok((Some(result.untangled), steps));
            } else {
                match is_worse {
                    false => well += 1,
                    true => (failures, well) = (failures + 1, 0),
                }
                if well >= GOOD_STEPS {
                    (step, well) = ((2.0 * step).min(longest), 0);
                }
                if result.untangled.intersections == 0 {
                    failures = 0;
                }
                from = at;
                node = PathNode::new(sample, result, node.orientation.into_inner());
            }
        }
        Ok((None, steps))
    }

    /// Untangles garments at `sample`, `step` of the path after `node`: without history, or with the contact orientation of
    /// `node`, or both in turn where the first leaves intersections, as the step lengths say.
    fn step_to(
        &self,
        node: &PathNode,
        sample: &PathSample,
        step: f64,
        is_shortest: bool,
        is_last: bool,
    ) -> Result<StepResult, ResolveError> {
        // A step that may be halved is not worth a second attempt.
        let loosened = if is_shortest { self.settings.loosened } else { 1.0 };
        let settings =
            ResolveSettings { is_shallow: !is_last, is_patient: is_shortest, loosened, ..*self.settings };
        let kept = KEPT.powf((step / FADING).min(1.0));
        let start = carried(&node.state, sample, kept);
        check(&sample.body, &placed(self.layers, &start)?)?;
        let StepLengths { keeping, always_keeps, clearance, .. } = self.step_lengths;
        let before = node.yielded.as_ref().map(|steps| Before { steps, most: YIELD_PER_PATH * step });
        let layers = self.layers;
        Ok(at_sample(layers, sample, &start, (clearance, before), |obstacle, start| {
            let first =
                (step > keeping || !always_keeps).then(|| untangled(obstacle, start, &settings, self.budget));
            match first {
                Some(found) if step > keeping || found.intersections == 0 => return found,
                _ => (),
            }
            let kept =
                untangled_keeping(Some(node.orientation(layers)), obstacle, start, &settings, self.budget);
            match first {
                Some(found) if found.defects() < kept.defects() => found,
                _ => kept,
            }
        }))
    }
}

/// Untangles the garments at `sample` by `untangle`, from `start`. The body yields about as `before`.
fn at_sample(
    layers: &[Layer<'_>],
    sample: &PathSample,
    start: &[Vec<[f64; 3]>],
    (clearance, before): (Clearance, Option<Before<'_>>),
    untangle: impl FnOnce(&BodyObstacle<'_>, &[Layer<'_>]) -> Untangled,
) -> StepResult {
    let start = at(layers, start);
    let places = [at(layers, &sample.draped), start.clone()].concat();
    let step_to = |body: &Body<'_>| {
        let untangled = untangle(body.obstacle(), &start);
        StepResult { untangled, yielded: body.steps() }
    };
    with_drawn(&sample.body, &places, |drawn| {
        with_body_after(clearance, before, drawn, layers.len(), step_to)
    })
}

/// The garments at other positions, if there are positions for all.
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

/// The drape at `sample` plus the share `kept` of the post-process's earlier changes, turned by skinning.
fn carried(state: &ContactState, sample: &PathSample, kept: f64) -> Vec<Vec<[f64; 3]>> {
    let mut transforms = state.transforms.iter().zip(&sample.transforms);
    let garments = sample.draped.iter().zip(&state.draped).zip(&state.positions);
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
