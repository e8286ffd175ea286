//! The steps of a continuation path: which ones are tried, and what is done at each.

use std::sync::OnceLock;

use super::attempt::{FEW_PAIRS, settled};
use super::body::SoftBody;
use super::clearance::{Before, YieldedBody};
use super::contact_orientation::ContactOrientation;
use super::garment::{at, check};
use super::obstacle::BodyObstacle;
use super::packed_cloth::PackedCloth;
use super::step_lengths::StepLengths;
use super::task::Task;
use super::untangle::{Untangled, untangled};
use super::{ContactState, Layer, PathSample, ResolveError, ResolveSettings, Resolved};
use crate::transform::{into_frame, out_of_frame};
use crate::vec3::{add, scale, sub};

/// Shortest steps that may raise the number of intersections, since the last state without any, before the rest of the path is
/// taken in one step. Paths that end clear have one at most.
const FAILURES: usize = 3;
/// Steps that do not raise the number of intersections after which a longer one is tried.
const GOOD_STEPS: usize = 4;
/// Share of the post-process's changes that a long step keeps, so that old changes fade…
const KEPT_CHANGES: f64 = 0.95;
/// …and the share of the path from which on a step is long: shorter ones keep more.
const FADING: f64 = 1.0 / 16.0;
/// Most that the body's yield changes on a whole path (m): about as fast as limbs move.
const YIELD_PER_PATH: f64 = 0.5;

/// A path, and what its steps need.
pub(super) struct Path<'a, 'b> {
    pub task: Task<'a>,
    /// The body at 1.
    pub end: &'a SoftBody<'b>,
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
            ContactOrientation::of(&PackedCloth::new(layers), &positions(), self.orientation_before.as_ref())
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
        let Task { layers, budget, .. } = self.task;
        if budget.is_nearly_spent() {
            return Ok(());
        }
        let first = self.at_sample(&t_pose, &t_pose.draped, None, |obstacle, layers| {
            untangled(obstacle, Task { layers, ..self.task }, None)
        });
        let intersections = first.untangled.intersections;
        if intersections > 0 && intersections >= best.certificate.intersections() {
            return Ok(());
        }
        let most = best.certificate.intersections().max(FEW_PAIRS);
        let (followed, steps) = self.go(PathNode::new(t_pose, first, None), most, sample_at)?;
        best.steps += steps;
        let Some(found) = followed else { return Ok(()) };
        let mut along = settled(self.end, found, self.step_lengths.clearance, self.task);
        along.go_on(self.end.drawn.surface, self.task);
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
        let Task { layers, settings, budget } = self.task;
        check(self.end.drawn.surface, &placed(layers, &node.state.draped)?)?;
        check(self.end.drawn.surface, &placed(layers, &node.state.positions)?)?;
        let (mut from, mut step, mut steps) = (0.0, longest, 0);
        // Successful steps in a row, and shortest steps that failed since the last state without intersections: the next step
        // mends most of what such a step leaves.
        let (mut well, mut failures) = (0, 0);
        while steps < settings.steps && !budget.is_spent() {
            let is_last = failures >= FAILURES || steps + 1 == settings.steps || budget.is_nearly_spent();
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
        let Task { layers, settings, .. } = self.task;
        // A step that may be halved is not worth a second attempt.
        let loosened = if is_shortest { settings.loosened } else { 1.0 };
        let settings =
            &ResolveSettings { is_shallow: !is_last, is_patient: is_shortest, loosened, ..*settings };
        let kept = KEPT_CHANGES.powf((step / FADING).min(1.0));
        let start = carried(&node.state, sample, kept);
        check(&sample.body, &placed(layers, &start)?)?;
        let StepLengths { keeping, always_keeps, .. } = self.step_lengths;
        let before = node.yielded.as_ref().map(|steps| Before { steps, most: YIELD_PER_PATH * step });
        Ok(self.at_sample(sample, &start, before, |obstacle, start| {
            let task = Task { layers: start, settings, ..self.task };
            let first = (step > keeping || !always_keeps).then(|| untangled(obstacle, task, None));
            match first {
                Some(found) if step > keeping || found.intersections == 0 => return found,
                _ => (),
            }
            let kept = untangled(obstacle, task, Some(node.orientation(layers)));
            match first {
                Some(found) if found.defects() < kept.defects() => found,
                _ => kept,
            }
        }))
    }

    /// Untangles the garments at `sample` by `untangle`, from `start`. The body yields about as `before`.
    fn at_sample(
        &self,
        sample: &PathSample,
        start: &[Vec<[f64; 3]>],
        before: Option<Before<'_>>,
        untangle: impl FnOnce(&BodyObstacle<'_>, &[Layer<'_>]) -> Untangled,
    ) -> StepResult {
        let layers = self.task.layers;
        let start = at(layers, start);
        let places = [at(layers, &sample.draped), start.clone()].concat();
        let drawn = BodyObstacle::near_layers(&sample.body, &places);
        let yielded = YieldedBody::of(&drawn, layers.len(), self.step_lengths.clearance, before);
        let body = SoftBody::new(drawn, layers.len(), yielded.as_ref());
        StepResult { untangled: untangle(body.obstacle(), &start), yielded: body.steps() }
    }
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
