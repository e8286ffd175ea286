//! The steps of a way: how long they are, and what is done at each.

use std::sync::OnceLock;
use std::time::Instant;

use super::body::{Body, with_body_after, with_drawn};
use super::follow::{Reached, Waypoint};
use super::obstacle::BodyObstacle;
use super::outfit::Outfit;
use super::relief::{Before, Room};
use super::resolved::settled;
use super::sides::Sides;
use super::{
    Layer, ResolveError, ResolveSettings, Resolved, Untangled, at, check, untangled, untangled_keeping,
};
use crate::query::Surface;
use crate::transform::{into_frame, out_of_frame};
use crate::vec3::{add, scale, sub};

/// Where so many of the steps that are allowed, one in 16, were as short as may be and left more crossings all the same, the rest of
/// the way is one step.
const FAILURES: usize = 16;
/// Steps without further crossings after which a longer one is tried.
const GOOD_STEPS: usize = 4;
/// How much of what the post-process changed is kept in a long step, so that old changes fade…
const KEPT: f64 = 0.95;
/// …and the share of the way from which on a step is long: shorter ones keep more.
const FADING: f64 = 1.0 / 16.0;
/// How much more the body may give way, or less, on a whole way [m]: about as fast as limbs move.
const GIVING_WAY: f64 = 0.5;
/// Crossings of garments with themselves may become more by this share, and by so many, in a short step.
const OWN: (f64, usize) = (0.125, 4);

/// How long steps are, as shares of the way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strides {
    /// The longest one.
    pub longest: f64,
    /// The shortest one: it is taken even where it leaves more crossings than there were.
    pub shortest: f64,
    /// The longest one in which cloth may keep its sides: little passes by in it.
    pub keeping: f64,
    /// The shortest one in which it need not, where nothing crosses before.
    pub free: f64,
    /// Where the body gives way, from step to step by little more or less.
    pub room: Room,
}

impl Strides {
    /// From the T-pose to a pose.
    pub const FROM_T_POSE: Self = Self {
        longest: 1.0 / 4.0,
        shortest: 1.0 / 512.0,
        keeping: 1.0 / 32.0,
        free: 1.0 / 32.0,
        room: Room::DEEP,
    };
    /// The same with drapes that are taken back: where those help they do so at once.
    pub const TAKEN_BACK: Self = Self { shortest: 1.0 / 16.0, ..Self::FROM_T_POSE };
    /// From one frame of a motion to the next.
    pub const OF_FRAME: Self =
        Self { longest: 1.0, shortest: 1.0 / 128.0, keeping: 1.0, free: 0.0, room: Room::AMPLE };
    /// The same from a frame that was not clear.
    pub const OF_CROSSED_FRAME: Self = Self { shortest: 1.0 / 4.0, ..Self::OF_FRAME };
}

/// Where garments are to be taken.
pub(super) struct Way<'a, 'b> {
    pub layers: &'a [Layer<'a>],
    /// The body at 1.
    pub end: &'a Body<'b>,
    pub settings: &'a ResolveSettings,
    /// When it began.
    pub start: Instant,
    pub strides: Strides,
}

/// Somewhere on the way.
struct Place {
    reached: Reached,
    /// How far the body gave way there, per vertex [m]; none where that is not known.
    gave_way: Option<Vec<f64>>,
    /// Crossings of garments with themselves; none where they were not counted.
    own: Option<usize>,
    /// Told when they are first asked for.
    sides: OnceLock<Sides>,
}

impl Place {
    fn new(stage: Waypoint, Arrived { untangled, gave_way }: Arrived) -> Self {
        let Waypoint { draped, transforms, .. } = stage;
        let Untangled { positions, crossings, own, .. } = untangled;
        let reached = Reached { draped, positions, transforms, crossings };
        Self { reached, gave_way: Some(gave_way), own: Some(own), sides: OnceLock::new() }
    }

    fn sides(&self, layers: &[Layer<'_>]) -> &Sides {
        self.sides.get_or_init(|| Sides::of(&Outfit::new(layers), &self.reached.positions.concat()))
    }

    /// Whether fewer crosses here than `now`; garments with themselves only count in a step that is `short`.
    fn crosses_less_than(&self, now: &Untangled, is_short: bool) -> bool {
        let is_crumpled = |own: usize| now.own > own + OWN.1 && now.own as f64 > (1.0 + OWN.0) * own as f64;
        now.crossings > self.reached.crossings || is_short && self.own.is_some_and(is_crumpled)
    }
}

/// What is at a stage when all was done there.
struct Arrived {
    untangled: Untangled,
    /// How far the body gave way, per vertex [m].
    gave_way: Vec<f64>,
}

impl Way<'_, '_> {
    /// Resolves garments in the T-pose and takes them to 1; what comes of it is taken if it is better than the `best` so far.
    /// Crossings that are there in the T-pose already are not mended on a way.
    pub fn improve<E: From<ResolveError>>(
        &self,
        best: &mut Resolved,
        body: &Surface<f64>,
        t_pose: Waypoint,
        stage_at: impl FnMut(f64) -> Result<Waypoint, E>,
    ) -> Result<(), E> {
        let (layers, settings) = (self.layers, self.settings);
        check(&t_pose.body, &placed(layers, &t_pose.draped)?)?;
        let start = std::slice::from_ref(&t_pose.draped);
        let first = on_stage(
            layers,
            &t_pose,
            start,
            (self.strides.room, None),
            |_| true,
            |obstacle, start| untangled(obstacle, start, settings),
        );
        let crossings = first.untangled.crossings;
        if crossings > 0 && crossings >= best.certificate.crossings() {
            return Ok(());
        }
        let (followed, steps) = self.go(Place::new(t_pose, first), stage_at)?;
        best.steps += steps;
        let Some(found) = followed else { return Ok(()) };
        let mut along = settled(self.end, layers, found, settings, self.strides.room);
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
    pub fn follow<E: From<ResolveError>>(
        &self,
        reached: Reached,
        stage_at: impl FnMut(f64) -> Result<Waypoint, E>,
    ) -> Result<(Option<Untangled>, usize), E> {
        self.go(Place { reached, gave_way: None, own: None, sides: OnceLock::new() }, stage_at)
    }

    fn go<E: From<ResolveError>>(
        &self,
        mut place: Place,
        mut stage_at: impl FnMut(f64) -> Result<Waypoint, E>,
    ) -> Result<(Option<Untangled>, usize), E> {
        let Strides { longest, shortest, keeping, .. } = self.strides;
        check(self.end.drawn.surface, &placed(self.layers, &place.reached.draped)?)?;
        check(self.end.drawn.surface, &placed(self.layers, &place.reached.positions)?)?;
        let (mut from, mut step, mut steps) = (0.0, longest, 0);
        // How many steps in a row went well, and how many of the shortest did not.
        let (mut well, mut failures) = (0, 0);
        let most_failures = (self.settings.steps / FAILURES).max(1);
        while steps < self.settings.steps && !self.is_late() {
            let is_last = failures >= most_failures || steps + 1 == self.settings.steps;
            let is_shortest = is_last || step <= shortest * (1.0 + 1e-9);
            let at = if is_last || step > 1.0 - from - 1e-9 { 1.0 } else { from + step };
            let stage = stage_at(at)?;
            check(&stage.body, &placed(self.layers, &stage.draped)?)?;
            steps += 1;
            let arrived = self.arrive(&place, &stage, at - from, is_shortest, is_last)?;
            let is_worse = place.crosses_less_than(&arrived.untangled, at - from <= keeping);
            if is_worse && !is_shortest {
                (step, well) = (0.5 * step, 0);
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
                from = at;
                place = Place::new(stage, arrived);
            }
        }
        Ok((None, steps))
    }

    /// Untangles garments at `stage`, `step` of the way after `place`: as at the start of a way, and, where that leaves crossings,
    /// with the sides that they had before, each as far as the strides allow.
    fn arrive(
        &self,
        place: &Place,
        stage: &Waypoint,
        step: f64,
        is_shortest: bool,
        is_last: bool,
    ) -> Result<Arrived, ResolveError> {
        // What may be halved is not worth a second attempt.
        let loosened = if is_shortest { self.settings.loosened } else { 1.0 };
        let settings = ResolveSettings { is_shallow: !is_last, loosened, ..*self.settings };
        let fading = KEPT.powf((step / FADING).min(1.0));
        let kept: &[f64] = if is_shortest { &[fading, 1.0] } else { &[fading] };
        let starts: Vec<_> = kept.iter().map(|kept| carried(&place.reached, stage, *kept)).collect();
        for start in &starts {
            check(&stage.body, &placed(self.layers, start)?)?;
        }
        let Strides { keeping, free, .. } = self.strides;
        let is_free = step >= free || step > keeping || place.reached.crossings > 0;
        let before = place.gave_way.as_ref().map(|steps| Before { steps, most: GIVING_WAY * step });
        let gives_way = (self.strides.room, before);
        let is_enough =
            |found: &Untangled| found.crossings == 0 && !place.crosses_less_than(found, step <= keeping);
        Ok(on_stage(self.layers, stage, &starts, gives_way, is_enough, |obstacle, start| {
            let free = is_free.then(|| untangled(obstacle, start, &settings));
            if step > keeping || free.as_ref().is_some_and(|free| free.crossings == 0) {
                return free.unwrap_or_default();
            }
            let kept = untangled_keeping(Some(place.sides(self.layers)), obstacle, start, &settings);
            match free {
                Some(free) if free.crossings <= kept.crossings => free,
                _ => kept,
            }
        }))
    }

    fn is_late(&self) -> bool {
        self.settings.is_late(self.start, self.layers.len())
    }
}

/// Untangles the garments at `stage` by `untangle`, from each of `starts` until it `is_enough`; the best. The body gives way about
/// as `before`.
fn on_stage(
    layers: &[Layer<'_>],
    stage: &Waypoint,
    starts: &[Vec<Vec<[f64; 3]>>],
    (room, before): (Room, Option<Before<'_>>),
    is_enough: impl Fn(&Untangled) -> bool,
    mut untangle: impl FnMut(&BodyObstacle<'_>, &[Layer<'_>]) -> Untangled,
) -> Arrived {
    let mut places = at(layers, &stage.draped);
    places.extend(starts.iter().flat_map(|start| at(layers, start)));
    let arrive = |body: &Body<'_>| {
        let mut best: Option<Untangled> = None;
        for start in starts {
            let now = untangle(body.obstacle(), &at(layers, start));
            let rank = |found: &Untangled| (found.crossings, found.own);
            if best.as_ref().is_none_or(|best| rank(&now) < rank(best)) {
                best = Some(now);
            }
            if best.as_ref().is_some_and(&is_enough) {
                break;
            }
        }
        Arrived { untangled: best.unwrap_or_default(), gave_way: body.steps() }
    };
    with_drawn(&stage.body, &places, |drawn| with_body_after(room, before, drawn, layers.len(), arrive))
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
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::mesh::shapes;
    use crate::transform::Transform;

    const IDENTITY: Transform = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

    #[test]
    fn changes_turn_with_the_skinning_and_fade() {
        let quarter = [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let stage = |drape: [f64; 3], transform| Waypoint {
            body: Arc::new(Surface::from_mesh(&shapes::tetrahedron())),
            draped: vec![vec![drape]],
            skinned: vec![vec![drape]],
            transforms: vec![transform],
        };
        let Waypoint { draped, transforms, .. } = stage([1.0, 0.0, 0.0], IDENTITY);
        let reached = Reached { draped, positions: vec![vec![[1.2, 0.0, 0.4]]], transforms, crossings: 0 };
        let next = stage([0.0, 1.0, 0.0], quarter);
        let found = carried(&reached, &next, 0.5)[0][0];
        for (a, b) in found.iter().zip([0.0, 1.1, 0.2]) {
            assert!((a - b).abs() < 1e-12, "{found:?}");
        }
    }

    #[test]
    fn garments_with_themselves_count_in_short_steps_only() {
        let reached = || Reached { draped: vec![], positions: vec![], transforms: vec![], crossings: 2 };
        let place = |own| Place { reached: reached(), gave_way: None, own, sides: OnceLock::new() };
        let found = |crossings, own| Untangled { crossings, own, ..Untangled::default() };
        for is_short in [false, true] {
            assert!(place(Some(50)).crosses_less_than(&found(3, 0), is_short));
            assert!(!place(Some(50)).crosses_less_than(&found(2, 56), is_short));
            assert_eq!(place(Some(50)).crosses_less_than(&found(0, 57), is_short), is_short);
            assert!(!place(Some(0)).crosses_less_than(&found(0, 4), is_short));
            assert!(!place(None).crosses_less_than(&found(0, 1000), is_short));
        }
    }
}
