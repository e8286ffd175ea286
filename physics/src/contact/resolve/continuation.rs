//! Continuation: garments go step by step from a pose in which their order is plain to one in which it is not.
//!
//! With bent limbs the drape alone does not say where cloth belongs: a knee has gone through a skirt, a sleeve through the side
//! of the chest, and the nearest exit is the wrong one. In the T-pose none of that has happened. On a path from there each step
//! is short: the resolved state moves on by skinning and by the change of the drape, intersections stay shallow, and the nearest
//! exit is right. A step that raises the number of intersections is halved.

use super::attempt::{FEW_PAIRS, resolved_further, settled};
use super::body::SoftBody;
use super::budget::Budget;
use super::clearance::YieldedBody;
use super::garment::check;
use super::obstacle::BodyObstacle;
use super::path::{Path, placed};
use super::path_sample::PathEnd;
use super::step_lengths::StepLengths;
use super::strain_relaxation::{TIMES, TIMES_IN_FRAME};
use super::task::Task;
use super::{ContactState, Layer, PathSample, ResolveError, ResolveSettings, Resolved};
use crate::query::Surface;
use crate::transform::Transform;

/// As [`super::resolve`]; if intersections of `layers` on `body` remain, the garments go along a path from the sample at 0, the
/// T-pose, to the sample at 1, on `body`. The difference between `layers` and the sample there is added along the path.
///
/// # Errors
/// Those of `sample_at` and of [`super::resolve`].
pub fn resolve_along<E: From<ResolveError>>(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    mut sample_at: impl FnMut(f64) -> Result<PathSample, E>,
) -> Result<Resolved, E> {
    let most = if settings.steps > 0 { FEW_PAIRS } else { usize::MAX };
    let along = |end: &SoftBody<'_>, mut best: Resolved, task: Task<'_>| {
        if !best.certificate.is_clear() && settings.steps > 0 && !task.budget.is_spent() {
            let mut checked_at = |share: f64| Ok::<_, E>(checked(sample_at(share)?, layers)?);
            let path_end = PathEnd::new(checked_at(1.0)?, layers);
            let mut sample_at = |share: f64| match share {
                1.0 => Ok::<_, E>(path_end.sample.clone()),
                _ => Ok(path_end.faded_in(share, checked_at(share)?)),
            };
            let path = Path { task, end, step_lengths: StepLengths::FROM_T_POSE };
            path.improve(&mut best, sample_at(0.0)?, &mut sample_at)?;
        }
        Ok::<_, E>(best)
    };
    resolved_further(body, layers, settings, most, along)
}

/// Resolves `layers` on `body`, the sample at 1, from `before`, the previous frame of a motion, at 0. The changes made there are
/// kept and fade, so that nothing pops. None if the time of `settings` is used up, or no step allowed.
///
/// # Errors
/// Those of `sample_at` and of [`super::resolve`].
pub fn resolve_after<E: From<ResolveError>>(
    before: ContactState,
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    mut sample_at: impl FnMut(f64) -> Result<PathSample, E>,
) -> Result<Option<Resolved>, E> {
    let budget = &Budget::new(settings, layers.len());
    settings.check()?;
    check(body, layers)?;
    check_transforms(&before.transforms, layers)?;
    let drawn = budget.preparing(|| BodyObstacle::near_layers(body, layers));
    let yielded = budget.preparing(|| YieldedBody::ample(&drawn, layers.len()));
    let end = &SoftBody::new(drawn, layers.len(), yielded.as_ref());
    let step_lengths =
        if before.intersections == 0 { StepLengths::OF_FRAME } else { StepLengths::OF_INTERSECTED_FRAME };
    let task = Task { layers, settings, budget };
    let path = Path { task, end, step_lengths };
    let (followed, steps) =
        path.continue_from(before, |share| Ok::<_, E>(checked(sample_at(share)?, layers)?))?;
    let Some(found) = followed else { return Ok(None) };
    let mut resolved = settled(end, found, step_lengths.clearance, task);
    resolved.go_on(body, task);
    resolved.relax_strain(&end.drawn, task, TIMES_IN_FRAME);
    resolved.compare_since(layers, budget);
    if resolved.certificate.excess_strain() > 0 {
        resolved.relax_strain(&end.drawn, task, TIMES - TIMES_IN_FRAME);
        resolved.compare_since(layers, budget);
    }
    resolved.steps = steps;
    Ok(Some(resolved))
}

/// The sample, if it fits the garments.
fn checked(sample: PathSample, layers: &[Layer<'_>]) -> Result<PathSample, ResolveError> {
    check(&sample.body, &placed(layers, &sample.draped)?)?;
    check_transforms(&sample.transforms, layers)?;
    Ok(sample)
}

fn check_transforms(transforms: &[Transform], layers: &[Layer<'_>]) -> Result<(), ResolveError> {
    let expected = layers.iter().map(|layer| layer.garment.vertex_count()).sum();
    let found = transforms.len();
    if expected == found { Ok(()) } else { Err(ResolveError::Transforms { expected, found }) }
}

#[cfg(test)]
mod tests;
