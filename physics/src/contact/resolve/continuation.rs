//! Continuation: garments go step by step from a pose in which their order is plain to one in which it is not.
//!
//! With bent limbs the drape alone does not say where cloth belongs: a knee has gone through a skirt, a sleeve through the side
//! of the chest, and the nearest exit is the wrong one. In the T-pose none of that has happened. On a path from there each step
//! is short: the resolved state moves on by skinning and by the change of the drape, intersections stay shallow, and the nearest
//! exit is right. A step that raises the number of intersections is halved.

use super::attempt::{FEW, resolved_further, settled};
use super::body::{Body, with_body, with_drawn};
use super::budget::Budget;
use super::garment::check;
use super::path::{Path, placed};
use super::path_samples::PathSamples;
use super::step_lengths::StepLengths;
use super::strain_relaxation::{TIMES, TIMES_IN_FRAME};
use super::{ContactState, Layer, PathSample, ResolveError, ResolveSettings, Resolved};
use crate::query::Surface;
use crate::transform::Transform;
use std::time::Instant;

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
    let mut samples = PathSamples::to(layers);
    let mut checked_at = |share: f64| Ok::<_, E>(checked(sample_at(share)?, layers)?);
    let mut sample_at = |share: f64| samples.at(share, &mut checked_at);
    let most = if settings.steps > 0 { FEW } else { usize::MAX };
    let along = |end: &Body<'_>, mut best: Resolved, budget: &Budget| {
        if !best.certificate.is_clear() && settings.steps > 0 && !budget.is_spent() {
            let path = Path { layers, end, settings, budget, step_lengths: StepLengths::FROM_T_POSE };
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
    let preparing = Instant::now();
    let carry_on = |body: &Body<'_>| {
        budget.count_body(preparing);
        let step_lengths =
            if before.intersections == 0 { StepLengths::OF_FRAME } else { StepLengths::OF_INTERSECTED_FRAME };
        let path = Path { layers, end: body, settings, budget, step_lengths };
        let (followed, steps) =
            path.continue_from(before, |share| Ok::<_, E>(checked(sample_at(share)?, layers)?))?;
        let Some(found) = followed else { return Ok(None) };
        let mut resolved = settled(body, layers, found, settings, step_lengths.clearance, budget);
        resolved.go_on(body.drawn.surface, layers, settings, budget);
        resolved.relax_strain(&body.drawn, layers, settings, budget, TIMES_IN_FRAME);
        resolved.compare_since(layers, budget);
        if resolved.certificate.excess_strain() > 0 {
            resolved.relax_strain(&body.drawn, layers, settings, budget, TIMES - TIMES_IN_FRAME);
            resolved.compare_since(layers, budget);
        }
        resolved.steps = steps;
        Ok(Some(resolved))
    };
    with_drawn(body, layers, |drawn| with_body(drawn, layers.len(), carry_on))
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
