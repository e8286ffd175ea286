//! Garments taken along, step by step, from a pose in which their order is plain to one in which it is not.
//!
//! In a pose with bent limbs the drape alone does not tell where cloth belongs: a knee has gone through a skirt, a
//! sleeve through the side of the chest, and the nearest way out is the wrong one. In the T-pose nothing of that has
//! happened. On a way from there each step is short: what was resolved before is carried along by skinning and by what
//! the drape changes, crossings are shallow, and the nearest way out is right. Where a step leaves more crossings than
//! there were, a shorter one is tried.

use super::attempt::{resolved_further, settled};
use super::body::{Body, with_body, with_drawn};
use super::budget::Budget;
use super::ease::{TIMES, TIMES_IN_FRAME};
use super::garment::{at, check};
use super::stages::Stages;
use super::strides::Strides;
use super::taken_back::{shares, taken_back};
use super::unfold::Folds;
use super::way::{Way, placed};
use super::{Layer, PathSample, Reached, ResolveError, ResolveSettings, Resolved, Stage, fast_pass};
use crate::query::Surface;
use crate::transform::Transform;

/// A rise of the strain energy, as a share, that is only accepted where the way leaves crossings.
const STRAINED: f64 = 0.25;

/// As [`super::resolve`], with a second way out, and for garments of which it is known where they are `skinned` alone,
/// `[V, 3]` each (m): what only the drape folds is laid out first. Where crossings of `layers` on `body` cannot be mended, the
/// garments are taken along from the stage at 0, the T-pose, to the stage at 1, on `body`; what `layers` differ by from the
/// drape there is added along the way. Where that leaves crossings, they are taken once more with drapes that are taken back
/// towards the skinned garments around them. Where crossings are left then and anything was laid out, all of it is tried with
/// the drape as it is as well. What leaves the fewest is taken; a few crossings that are left in it are tried with other gaps,
/// and folds that are left are laid out once more.
///
/// # Errors
/// Those of `stage_at` and of [`super::resolve`].
pub fn resolve_along<E: From<ResolveError>>(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    skinned: &[Vec<[f64; 3]>],
    settings: &ResolveSettings,
    mut stage_at: impl FnMut(f64) -> Result<PathSample, E>,
) -> Result<Resolved, E> {
    let budget = &Budget::new(settings, layers.len());
    settings.check()?;
    check(body, layers)?;
    check(body, &placed(layers, skinned)?)?;
    if let Some(found) = fast_pass(body, layers, settings)? {
        return Ok(found);
    }
    let fast_time = budget.elapsed();
    budget.shorten_for(body);
    let mut stages = Stages::to(layers);
    let mut checked_at = |share: f64| Ok::<_, E>(checked(stage_at(share)?, layers)?);
    let mut along = |layers: &[Layer<'_>], folds: &mut Option<Folds>| {
        taken_along(body, layers, folds, settings, budget, &mut |share| stages.at(share, &mut checked_at))
    };
    // Strict limits leave a drape as it is, as far as it can be left.
    let may_lay_out = settings.loosened > 1.0 && settings.self_contact;
    let mut folds = may_lay_out.then(|| Folds::of(body, layers, skinned));
    let mut resolved = match &folds {
        None => along(layers, &mut folds)?,
        Some(found) => {
            let positions = found.laid_out(layers, skinned);
            along(&at(layers, &positions), &mut folds)?
        }
    };
    let is_laid_out = folds.is_some_and(|folds| !folds.is_empty());
    if is_laid_out && !resolved.certificate.is_clear() && !budget.is_spent() {
        resolved = resolved.or(along(layers, &mut None)?);
    }
    let is_mended = resolved.mend_last(body, layers, settings, budget);
    // What a drape as it came has of its folds, and what was folded on the way.
    let is_laid_out = may_lay_out && resolved.lay_out(body, layers, skinned, settings, budget) || is_laid_out;
    if (is_mended || is_laid_out) && resolved.is_strained(layers) {
        // So far strain was measured from what was laid out, and not since the last attempts.
        with_drawn(body, layers, |drawn| {
            with_body(drawn, layers.len(), |room| {
                resolved.ease(&room.drawn, layers, settings, budget, TIMES)
            });
        });
    }
    resolved.compare_since(layers, budget);
    resolved.fast_time = fast_time;
    if resolved.steps > 0 {
        resolved.stage = Stage::Path;
    }
    Ok(resolved)
}

/// [`resolve_along`] for `layers` as they are. On the way `folds`, if there are any, are laid out, and those that the drape has
/// in the T-pose, which are added to them: what is laid out in one pose has to be in the next.
fn taken_along<E: From<ResolveError>>(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    folds: &mut Option<Folds>,
    settings: &ResolveSettings,
    budget: &Budget,
    stage_at: &mut impl FnMut(f64) -> Result<PathSample, E>,
) -> Result<Resolved, E> {
    resolved_further(body, layers, settings, budget, |room, mut best| {
        let is_strained = best.certificate.strain_added.is_some_and(|added| added > STRAINED);
        if best.certificate.is_clear() && !is_strained || settings.steps == 0 || budget.is_spent() {
            return Ok(best);
        }
        let way = Way { layers, end: room, settings, budget, strides: Strides::FROM_T_POSE };
        let t_pose = stage_at(0.0)?;
        if let Some(folds) = folds {
            folds.add(&Folds::of(&t_pose.body, &at(layers, &t_pose.draped), &t_pose.skinned));
        }
        let folds = &*folds;
        let laid_out = |stage: PathSample| match folds {
            Some(folds) => folds.laid_out_at(stage, layers),
            None => stage,
        };
        let t_pose = laid_out(t_pose);
        let mut stage_at = |share: f64| stage_at(share).map(laid_out);
        way.improve(&mut best, t_pose.clone(), &mut stage_at)?;
        // Where most of what crosses is pinched it is the body, not the drape, that leaves no way out.
        if best.certificate.between() > best.certificate.pinched.count() && !budget.is_spent() {
            let shares = shares(&best.certificate, layers, &t_pose.draped);
            let nearer = taken_back(t_pose.clone(), &shares);
            if nearer.draped != t_pose.draped {
                let way = Way { strides: Strides::TAKEN_BACK, ..way };
                let nearer_at = |at: f64| stage_at(at).map(|stage| taken_back(stage, &shares));
                way.improve(&mut best, nearer, nearer_at)?;
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
    mut stage_at: impl FnMut(f64) -> Result<PathSample, E>,
) -> Result<Option<Resolved>, E> {
    let budget = &Budget::new(settings, layers.len());
    settings.check()?;
    check(body, layers)?;
    check_transforms(&before.transforms, layers)?;
    let carry_on = |body: &Body<'_>| {
        let body_time = budget.elapsed();
        let strides = if before.crossings == 0 { Strides::OF_FRAME } else { Strides::OF_CROSSED_FRAME };
        let way = Way { layers, end: body, settings, budget, strides };
        let (followed, steps) = way.follow(before, |share| Ok::<_, E>(checked(stage_at(share)?, layers)?))?;
        let Some(found) = followed else { return Ok(None) };
        let mut resolved = settled(body, layers, found, settings, strides.room, budget);
        resolved.body_time = body_time;
        resolved.go_on(body.drawn.surface, layers, settings, budget);
        resolved.ease(&body.drawn, layers, settings, budget, TIMES_IN_FRAME);
        resolved.compare_since(layers, budget);
        if resolved.certificate.tears() > 0 {
            resolved.ease(&body.drawn, layers, settings, budget, TIMES - TIMES_IN_FRAME);
            resolved.compare_since(layers, budget);
        }
        resolved.steps = steps;
        Ok(Some(resolved))
    };
    with_drawn(body, layers, |drawn| with_body(drawn, layers.len(), carry_on))
}

/// A stage, if everything on it fits the garments.
fn checked(stage: PathSample, layers: &[Layer<'_>]) -> Result<PathSample, ResolveError> {
    for positions in [&stage.draped, &stage.skinned] {
        check(&stage.body, &placed(layers, positions)?)?;
    }
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
