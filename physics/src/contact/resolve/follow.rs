//! Garments taken along, step by step, from a pose in which their order is plain to one in which it is not.
//!
//! In a pose with bent limbs the drape alone does not tell where cloth belongs: a knee has gone through a skirt, a sleeve through
//! the side of the chest, and the nearest way out is the wrong one. In the T-pose nothing of that has happened. On a way from there
//! each step is short: what was resolved before is carried along by skinning and by what the drape changes, crossings are
//! shallow, and the nearest way out is right. Where a step leaves crossings, a shorter one is tried.

use std::time::Instant;

use super::certificate::certificate;
use super::near::near_cloth;
use super::obstacle::{BodyObstacle, GaveWay};
use super::relief::{Relief, Room};
use super::{
    GarmentWork, Layer, ResolveError, ResolveSettings, Resolved, Untangled, at, check, resolve, triangles,
    untangled,
};
use crate::query::Surface;
use crate::transform::{Transform, into_frame, out_of_frame};
use crate::vec3::{add, scale, sub};

/// The longest step, as a share of the way.
const LONGEST: f64 = 1.0 / 8.0;
/// The shortest one: it is taken even where it leaves crossings.
const SHORTEST: f64 = 1.0 / 128.0;
/// Steps after which the way is given up…
const MOST_STEPS: usize = 64;
/// …or as many of the shortest that left crossings.
const MOST_FAILURES: usize = 6;
/// Steps without crossings after which a longer one is tried.
const GOOD_STEPS: usize = 2;
/// How much of what the post-process changed is kept from step to step, so that old changes fade.
const KEPT: f64 = 0.95;

/// What is somewhere along the way.
pub struct Waypoint {
    /// The body.
    pub body: Surface<f64>,
    /// The drape on it, `[V, 3]` per garment [m].
    pub draped: Vec<Vec<[f64; 3]>>,
    /// Skinning transforms of all vertices, garment after garment, from one and the same state.
    pub transforms: Vec<Transform>,
}

/// Garments that are resolved: where a way starts.
pub struct Reached {
    /// Their drape before that, `[V, 3]` each [m].
    pub draped: Vec<Vec<[f64; 3]>>,
    /// Where they are now.
    pub positions: Vec<Vec<[f64; 3]>>,
    /// Skinning transforms, as in [`Waypoint`].
    pub transforms: Vec<Transform>,
}

impl Reached {
    fn new(stage: Waypoint, positions: Vec<Vec<[f64; 3]>>) -> Self {
        Self { draped: stage.draped, positions, transforms: stage.transforms }
    }
}

/// As [`resolve`], with a second way out: where crossings of `layers` on `body` cannot be mended, the garments are taken along
/// from the stage at 0, the T-pose, to the stage at 1, which is `body` with `layers`. What leaves fewer crossings is returned.
///
/// # Errors
/// Those of `stage_at` and of [`resolve`].
pub fn resolve_along<E: From<ResolveError>>(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    mut stage_at: impl FnMut(f64) -> Result<Waypoint, E>,
) -> Result<Resolved, E> {
    let start = Instant::now();
    let direct = resolve(body, layers, settings)?;
    if direct.certificate.is_clear() {
        return Ok(direct);
    }
    let limit = settings.time.map(|limit| limit * layers.len() as u32);
    let is_late = || limit.is_some_and(|limit| start.elapsed() > limit);
    let stage = stage_at(0.0)?;
    let first = on_stage(layers, &stage, settings, std::iter::once(stage.draped.clone()))?;
    let reached = Reached::new(stage, first.positions);
    let (followed, steps) = follow(layers, reached, LONGEST, settings, stage_at, &is_late)?;
    let mut best = direct;
    if let Some(Untangled { positions, rounds, .. }) = followed {
        let found = finished(body, layers, positions, rounds, settings)?;
        if found.certificate.between() < best.certificate.between() {
            best = Resolved { body_time: best.body_time, ..found };
        }
    }
    best.compare(layers, start.elapsed());
    best.steps = steps;
    Ok(best)
}

/// Resolves `layers` on `body`, the stage at 1, by carrying on from `before`, the frame of a motion before it, at 0. What
/// was done there is kept, fading, so that nothing pops. None where that leaves crossings, but for narrow ones.
///
/// # Errors
/// Those of `stage_at` and of [`resolve`].
pub fn resolve_after<E: From<ResolveError>>(
    before: Reached,
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    stage_at: impl FnMut(f64) -> Result<Waypoint, E>,
) -> Result<Option<Resolved>, E> {
    let start = Instant::now();
    settings.check()?;
    let limit = settings.time.map(|limit| limit * layers.len() as u32);
    let is_late = || limit.is_some_and(|limit| start.elapsed() > limit);
    let (followed, steps) = follow(layers, before, 1.0, settings, stage_at, &is_late)?;
    let Some(Untangled { positions, rounds, .. }) = followed else { return Ok(None) };
    let mut resolved = finished(body, layers, positions, rounds, settings)?;
    if resolved.certificate.between() > resolved.certificate.narrow_triangle_pairs {
        return Ok(None);
    }
    resolved.compare(layers, start.elapsed());
    resolved.steps = steps;
    Ok(Some(resolved))
}

/// Garments at the end of a way, with their certificate.
fn finished(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    positions: Vec<Vec<[f64; 3]>>,
    rounds: usize,
    settings: &ResolveSettings,
) -> Result<Resolved, ResolveError> {
    let start = Instant::now();
    let now = at(layers, &positions);
    check(body, &now)?;
    let near = near_cloth(&body.positions, &triangles(&now));
    let relief = Relief::of(body, &near, layers.len(), Room::Ample);
    let judge = BodyObstacle::new(body, &near, relief.as_ref().map(GaveWay::NotYet));
    let certificate = certificate(&judge, &now);
    let certificate_time = start.elapsed();
    let garments = vec![GarmentWork { rounds, ..GarmentWork::default() }; layers.len()];
    let mut resolved = Resolved { positions, certificate, garments, certificate_time, ..Resolved::default() };
    resolved.close_in((body, &near), &judge, layers, settings);
    Ok(resolved)
}

/// Takes garments from where they are `reached`, at 0, to the stage at 1, by steps of at most `longest`; also how many steps were
/// tried. None where the way was given up.
fn follow<E: From<ResolveError>>(
    layers: &[Layer<'_>],
    mut reached: Reached,
    longest: f64,
    settings: &ResolveSettings,
    mut stage_at: impl FnMut(f64) -> Result<Waypoint, E>,
    is_late: &dyn Fn() -> bool,
) -> Result<(Option<Untangled>, usize), E> {
    let (mut from, mut step, mut steps) = (0.0, longest, 0);
    // How many steps in a row went well, and how many of the shortest did not.
    let (mut well, mut failures) = (0, 0);
    while steps < MOST_STEPS && failures < MOST_FAILURES && !is_late() {
        let is_shortest = step <= SHORTEST * (1.0 + 1e-9);
        let at = if step > 1.0 - from - 1e-9 { 1.0 } else { from + step };
        let stage = stage_at(at)?;
        steps += 1;
        // What may be halved is not worth a second attempt.
        let loosened = if is_shortest { settings.loosened } else { 1.0 };
        let settings = ResolveSettings { is_shallow: true, loosened, ..*settings };
        let kept: &[f64] = if is_shortest { &[KEPT, 1.0] } else { &[KEPT] };
        let starts = kept.iter().map(|kept| carried(&reached, &stage, *kept));
        let untangled = on_stage(layers, &stage, &settings, starts)?;
        if untangled.crossings > 0 && !is_shortest {
            (step, well) = (0.5 * step, 0);
        } else if at == 1.0 {
            return Ok((Some(untangled), steps));
        } else {
            match untangled.crossings {
                0 => well += 1,
                _ => failures += 1,
            }
            if well >= GOOD_STEPS {
                (step, well) = ((2.0 * step).min(longest), 0);
            }
            from = at;
            reached = Reached::new(stage, untangled.positions);
        }
    }
    Ok((None, steps))
}

/// Untangles the garments at each of `starts` until one has no crossing; the best.
fn on_stage(
    layers: &[Layer<'_>],
    stage: &Waypoint,
    settings: &ResolveSettings,
    starts: impl Iterator<Item = Vec<Vec<[f64; 3]>>>,
) -> Result<Untangled, ResolveError> {
    let draped = at(layers, &stage.draped);
    check(&stage.body, &draped)?;
    let near = near_cloth(&stage.body.positions, &triangles(&draped));
    let relief = Relief::of(&stage.body, &near, layers.len(), Room::Ample);
    let obstacle = match &relief {
        Some(relief) => relief.obstacle(&near),
        None => BodyObstacle::new(&stage.body, &near, None),
    };
    let mut best: Option<Untangled> = None;
    for start in starts {
        let now = untangled(&obstacle, &at(layers, &start), settings);
        if best.as_ref().is_none_or(|best| now.crossings < best.crossings) {
            best = Some(now);
        }
        if best.as_ref().is_some_and(|best| best.crossings == 0) {
            break;
        }
    }
    Ok(best.unwrap_or_default())
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
mod tests {
    use super::super::RestGarment;
    use super::*;
    use crate::contact::TriangleTree;
    use crate::mesh::TriMesh;
    use crate::mesh::shapes;

    const IDENTITY: Transform = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

    /// A knee that rises through a sheet that does not know of it: half a metre long at `size` 0.5, in the plane y = 0.
    fn rising(size: f64) -> (TriMesh, impl Fn(f64) -> Result<Waypoint, ResolveError>) {
        let grid = shapes::irregular_grid(size, size, 24, 24, 0.25, 4);
        let sheet = shapes::mapped(&grid, |[x, y, _]| [y - 0.5 * size, 0.0, x - 0.5 * size]);
        let (ball, draped) = (shapes::icosphere(0.08, 3), sheet.positions().to_vec());
        let stage_at = move |share: f64| {
            let knee = shapes::mapped(&ball, |p| add(p, [0.0, 0.18 * share - 0.1, 0.0]));
            Ok(Waypoint {
                body: Surface::from_mesh(&knee),
                draped: vec![draped.clone()],
                transforms: vec![IDENTITY; draped.len()],
            })
        };
        (sheet, stage_at)
    }

    fn end<E>(stage_at: &impl Fn(f64) -> Result<Waypoint, E>) -> Waypoint {
        stage_at(1.0).unwrap_or_else(|_| unreachable!("made without errors"))
    }

    #[test]
    fn a_rising_knee_takes_the_sheet_along() {
        let (sheet, stage_at) = rising(0.6);
        let garment = RestGarment::new(&sheet);
        let stage = end(&stage_at);
        let layers = [Layer { garment: &garment, positions: &stage.draped[0] }];
        let settings = ResolveSettings::default();
        let start = || {
            let stage = stage_at(0.0).unwrap();
            let positions = stage.draped.clone();
            Reached::new(stage, positions)
        };
        let (followed, steps) = follow(&layers, start(), LONGEST, &settings, &stage_at, &|| false).unwrap();
        let followed = followed.unwrap();
        assert!(steps >= 8, "{steps}");
        let resolved = resolve_after(start(), &stage.body, &layers, &settings, &stage_at).unwrap().unwrap();
        assert!(resolved.certificate.is_clear() && resolved.steps >= 1);
        let over = &followed.positions[0];
        // The knee's top is at 0.16: nearer to the lower side of the ball, the sheet lies over its top all the same.
        let highest = over.iter().map(|p| p[1]).fold(0.0, f64::max);
        assert!(highest > 0.155, "{highest}");
        let tree = TriangleTree::new(over, sheet.faces());
        assert!(tree.pairs_with(&TriangleTree::new(&stage.body.positions, &stage.body.faces)).is_empty());
    }

    #[test]
    fn what_can_be_mended_at_once_is_not_followed_and_what_is_late_is_given_up() {
        let (sheet, stage_at) = rising(0.6);
        let garment = RestGarment::new(&sheet);
        let settings = ResolveSettings::default();
        let shallow = stage_at(0.3).unwrap();
        let layers = [Layer { garment: &garment, positions: &shallow.draped[0] }];
        let resolved = resolve_along(&shallow.body, &layers, &settings, &stage_at).unwrap();
        assert!(resolved.certificate.is_clear() && resolved.steps == 0);
        let start = Reached::new(stage_at(0.0).unwrap(), shallow.draped.clone());
        let late = follow(&layers, start, LONGEST, &settings, &stage_at, &|| true).unwrap();
        assert!(late.0.is_none());
    }

    #[test]
    fn errors_of_a_stage_come_back() {
        let (sheet, stage_at) = rising(0.3);
        let garment = RestGarment::new(&sheet);
        let layers = [Layer { garment: &garment, positions: sheet.positions() }];
        let start = Reached::new(stage_at(0.0).unwrap(), vec![sheet.positions().to_vec()]);
        let broken = |_: f64| Err::<Waypoint, _>(ResolveError::EmptyBody);
        let settings = ResolveSettings::default();
        assert!(follow(&layers, start, LONGEST, &settings, broken, &|| false).is_err());
    }

    #[test]
    fn changes_turn_with_the_skinning_and_fade() {
        let quarter = [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let stage = |drape: [f64; 3], transform| Waypoint {
            body: Surface::from_mesh(&shapes::tetrahedron()),
            draped: vec![vec![drape]],
            transforms: vec![transform],
        };
        let reached = Reached::new(stage([1.0, 0.0, 0.0], IDENTITY), vec![vec![[1.2, 0.0, 0.4]]]);
        let next = stage([0.0, 1.0, 0.0], quarter);
        let found = carried(&reached, &next, 0.5)[0][0];
        for (a, b) in found.iter().zip([0.0, 1.1, 0.2]) {
            assert!((a - b).abs() < 1e-12, "{found:?}");
        }
    }
}
