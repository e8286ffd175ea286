//! Garments taken along, step by step, from a pose in which their order is plain to one in which it is not.
//!
//! In a pose with bent limbs the drape alone does not tell where cloth belongs: a knee has gone through a skirt, a
//! sleeve through the side of the chest, and the nearest way out is the wrong one. In the T-pose nothing of that has
//! happened. On a path from there each step is short: what was resolved before is carried along by skinning and by what
//! the drape changes, crossings are shallow, and the nearest way out is right. Where a step leaves more crossings than
//! there were, a shorter one is tried.

use super::attempt::{FEW, resolved_further, settled};
use super::body::{Body, with_body, with_drawn};
use super::budget::Budget;
use super::garment::check;
use super::path::{Path, placed};
use super::stages::Stages;
use super::step_lengths::StepLengths;
use super::strain_relaxation::{TIMES, TIMES_IN_FRAME};
use super::{Layer, PathSample, Reached, ResolveError, ResolveSettings, Resolved};
use crate::query::Surface;
use crate::transform::Transform;
use std::time::Instant;

/// As [`super::resolve`], with a second way out: where crossings of `layers` on `body` cannot be mended, the garments are taken
/// along from the stage at 0, the T-pose, to the stage at 1, on `body`; what `layers` differ by from the drape there is added
/// along the path.
///
/// # Errors
/// Those of `stage_at` and of [`super::resolve`].
pub fn resolve_along<E: From<ResolveError>>(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    mut stage_at: impl FnMut(f64) -> Result<PathSample, E>,
) -> Result<Resolved, E> {
    let mut stages = Stages::to(layers);
    let mut checked_at = |share: f64| Ok::<_, E>(checked(stage_at(share)?, layers)?);
    let mut stage_at = |share: f64| stages.at(share, &mut checked_at);
    let most = if settings.steps > 0 { FEW } else { usize::MAX };
    let along = |end: &Body<'_>, mut best: Resolved, budget: &Budget| {
        if !best.certificate.is_clear() && settings.steps > 0 && !budget.is_spent() {
            let path = Path { layers, end, settings, budget, step_lengths: StepLengths::FROM_T_POSE };
            path.improve(&mut best, stage_at(0.0)?, &mut stage_at)?;
        }
        Ok::<_, E>(best)
    };
    resolved_further(body, layers, settings, most, along)
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
    mut stage_at: impl FnMut(f64) -> Result<PathSample, E>,
) -> Result<Option<Resolved>, E> {
    let budget = &Budget::new(settings, layers.len());
    settings.check()?;
    check(body, layers)?;
    check_transforms(&before.transforms, layers)?;
    let preparing = Instant::now();
    let carry_on = |body: &Body<'_>| {
        budget.count_body(preparing);
        let step_lengths =
            if before.crossings == 0 { StepLengths::OF_FRAME } else { StepLengths::OF_CROSSED_FRAME };
        let path = Path { layers, end: body, settings, budget, step_lengths };
        let (followed, steps) =
            path.continue_from(before, |share| Ok::<_, E>(checked(stage_at(share)?, layers)?))?;
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

/// A stage, if everything on it fits the garments.
fn checked(stage: PathSample, layers: &[Layer<'_>]) -> Result<PathSample, ResolveError> {
    check(&stage.body, &placed(layers, &stage.draped)?)?;
    check_transforms(&stage.transforms, layers)?;
    Ok(stage)
}

fn check_transforms(transforms: &[Transform], layers: &[Layer<'_>]) -> Result<(), ResolveError> {
    let expected = layers.iter().map(|layer| layer.garment.vertex_count()).sum();
    let found = transforms.len();
    if expected == found { Ok(()) } else { Err(ResolveError::Transforms { expected, found }) }
}

#[cfg(test)]
mod tests;
