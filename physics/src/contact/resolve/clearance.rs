//! Clearance for cloth where a posed body presses into itself.
//!
//! Skinned bodies do not know contact: the upper arm of a hanging arm lies inside the chest, the thigh of a crouching body
//! inside the belly. No cloth can be outside of both, and where two parts merely touch there is no room for it either. Real soft
//! tissue yields. So does this body as an obstacle: both surfaces step back by half of the clearance that is missing between
//! them. Cloth then lies between the two parts, under the given surface. A certificate counts against the body as given.

use rayon::prelude::*;

use super::condition::{along_line, normal_of};
use super::obstacle::{BodyObstacle, touching};
use crate::contact::Triangle;
use crate::query::{FaceSide, Surface};
use crate::vec3::{add_scaled, bounds, dot};

/// Distance that two facing parts of the body keep (m), for straight triangles around a limb…
const BODY_CLEARANCE: f64 = 0.006;
/// …and for the two sheets of each garment (m).
const CLEARANCE_PER_GARMENT: f64 = 0.002;
/// Two surfaces face each other where their normals have a cosine below this.
const FACING_PARTS: f64 = -0.3;
/// Farthest that the surface of another part is looked for (m).
const DEEPEST_PART: f64 = 0.08;
/// Largest yield of a vertex (m).
const LONGEST_YIELD: f64 = 0.04;
/// Rings of neighbours that yield along, each half as far.
const RINGS: usize = 2;
/// How far outside the surface a vertex is asked whether it is inside another part (m).
const VERTEX_LOOK_OUT: f64 = 1e-6;

/// Where a body yields: where it lies inside itself, and where two parts are too near to each other for cloth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Clearance {
    /// By which share where it does not lie inside itself, 0–1.
    pub share: f64,
    /// Whether it also yields where it lies so deep inside itself, or at such a slant, that no surface faces it. Cloth that
    /// enters a crease step by step needs that; cloth that is there already would only be drawn deeper.
    pub is_deep: bool,
}

impl Clearance {
    /// Wherever two surfaces face each other.
    pub const AMPLE: Self = Self { share: 1.0, is_deep: false };
    /// Everywhere.
    pub const DEEP: Self = Self { share: 1.0, is_deep: true };

    /// The same by another share.
    pub fn with_share(self, share: f64) -> Self {
        Self { share, ..self }
    }
}

/// The body's yield a step before.
#[derive(Debug, Clone, Copy)]
pub(super) struct Before<'a> {
    /// Per vertex (m).
    pub steps: &'a [f64],
    /// How much it may change (m): another surface may face a vertex all of a sudden.
    pub most: f64,
}

/// A body that has yielded.
pub(super) struct YieldedBody {
    /// The surface after it.
    pub surface: Surface<f64>,
    /// Vertices that yielded.
    pub yielded: Vec<bool>,
    /// Yield per vertex (m) at full clearance.
    pub steps: Vec<f64>,
    /// Corners of faces that were inside another part, or intersected one, before.
    pub pinched: Vec<bool>,
}

impl YieldedBody {
    /// Of the body `drawn` near `garments` garments, wherever two surfaces face each other.
    pub fn ample(drawn: &BodyObstacle<'_>, garments: usize) -> Option<Self> {
        Self::of(drawn, garments, Clearance::AMPLE, None)
    }

    /// Of the given body `drawn`, near `garments` garments. `None` if nothing has to yield, or the surface is not closed and has
    /// no inside.
    pub fn of(
        drawn: &BodyObstacle<'_>,
        garments: usize,
        clearance: Clearance,
        before: Option<Before<'_>>,
    ) -> Option<Self> {
        let body = drawn.surface;
        let (mut steps, pinched) =
            steps(drawn, BODY_CLEARANCE + CLEARANCE_PER_GARMENT * garments as f64, clearance.is_deep)?;
        if let Some(Before { steps: before, most }) = before {
            steps.iter_mut().zip(before).for_each(|(step, was)| *step = step.clamp(was - most, was + most));
        }
        let scaled =
            steps.iter().zip(&pinched).map(|(s, pinched)| if *pinched { *s } else { clearance.share * s });
        let scaled: Vec<f64> = scaled.collect();
        if scaled.iter().all(|s| *s == 0.0) {
            return None;
        }
        let moved = body.positions.iter().zip(&body.normals).zip(&scaled);
        let positions = moved.map(|((p, n), step)| add_scaled(*p, -step, *n)).collect();
        let yielded: Vec<bool> = scaled.iter().map(|s| *s > 0.0).collect();
        Some(Self { surface: Surface::new(positions, body.faces.clone()), yielded, steps, pinched })
    }
}

impl<'a> BodyObstacle<'a> {
    /// The body after yielding. Where it meets itself only because of that, it counts as it was.
    pub fn yielded_obstacle(yielded: &'a YieldedBody, near: &[bool]) -> Self {
        let is_pinched = |v: u32| yielded.pinched[v as usize];
        let mut obstacle = Self::pinched_where(&yielded.surface, near.to_vec(), is_pinched);
        obstacle.yields(yielded);
        obstacle
    }

    /// Notes which faces yield.
    pub fn yields(&mut self, yielded: &YieldedBody) {
        self.yielded = touching(&self.surface.faces, &yielded.yielded);
    }
}

/// How far every vertex steps back, against its normal (m); only those `near` cloth and around them do. Also the corners of
/// faces inside another part, or intersecting one. `None` without an inside.
fn steps(drawn: &BodyObstacle<'_>, clearance: f64, is_deep: bool) -> Option<(Vec<f64>, Vec<bool>)> {
    let BodyObstacle { surface, near, .. } = drawn;
    let (positions, faces, union) = (&surface.positions, &surface.faces, drawn.union.as_ref()?);
    // Whether all, or some, of the faces at a vertex are inside another part.
    let (mut all_inside, mut some_inside) = (vec![true; positions.len()], vec![false; positions.len()]);
    for (face, side) in faces.iter().zip(union.sides()) {
        for &v in face {
            all_inside[v as usize] &= *side == FaceSide::Buried;
            some_inside[v as usize] |= *side != FaceSide::Exposed;
        }
    }
    let missing = |v: usize| -> f64 {
        if !near[v] {
            return 0.0;
        }
        let (p, n) = (positions[v], surface.normals[v]);
        let is_inside =
            all_inside[v] || some_inside[v] && union.winding_number(add_scaled(p, VERTEX_LOOK_OUT, n)) >= 1;
        let (deepest, v) = (DEEPEST_PART, v as u32);
        let apart = match is_inside {
            true => facing_surface(drawn, v, -deepest)
                .or_else(|| is_deep.then(|| -nearest_facing(drawn, v).unwrap_or(deepest))),
            false => facing_surface(drawn, v, clearance),
        };
        apart.map_or(0.0, |apart| (0.5 * (clearance - apart)).clamp(0.0, LONGEST_YIELD))
    };
    let mut steps: Vec<f64> = (0..positions.len()).into_par_iter().with_min_len(256).map(missing).collect();
    for _ in 0..RINGS {
        let before = steps.clone();
        for face in faces.iter() {
            let most = face.iter().fold(0.0, |m: f64, &v| m.max(before[v as usize]));
            face.iter().for_each(|&v| steps[v as usize] = steps[v as usize].max(0.5 * most));
        }
    }
    Some((steps, some_inside))
}

/// How far from vertex `v` along its normal a surface faces it, at most `reach` (backwards where that is negative).
fn facing_surface(BodyObstacle { surface, tree, .. }: &BodyObstacle<'_>, v: u32, reach: f64) -> Option<f64> {
    let (p, n) = (surface.positions[v as usize], surface.normals[v as usize]);
    let faces_it = |f: u32| {
        if surface.faces[f as usize].contains(&v) {
            return None;
        }
        let triangle = tree.triangle(f)?;
        let (along, _) = along_line(p, n, &triangle)?;
        let is_in_reach = along * reach.signum() > 0.0 && along.abs() <= reach.abs();
        (is_in_reach && dot(normal_of(&triangle), n) < FACING_PARTS).then_some(along)
    };
    let along = tree.faces_in_box(bounds([p, add_scaled(p, reach, n)]));
    along.filter_map(faces_it).min_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// How far from vertex `v`, inside another part, the nearest surface is that does not face the way of its normal: for a vertex
/// that has just gone in at a slant, and has no surface straight behind it.
fn nearest_facing(BodyObstacle { surface, tree, .. }: &BodyObstacle<'_>, v: u32) -> Option<f64> {
    let n = surface.normals[v as usize];
    let looks_elsewhere = |f: u32, triangle: &Triangle| {
        !surface.faces[f as usize].contains(&v) && dot(normal_of(triangle), n) < 0.0
    };
    tree.nearest(surface.positions[v as usize], DEEPEST_PART, looks_elsewhere)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;
    use crate::mesh::shapes;
    use crate::vec3::{add, norm, sub};

    /// Two balls of 10 cm, their centres `apart`.
    fn balls(apart: f64) -> TriMesh {
        let ball = shapes::icosphere(0.1, 4);
        shapes::union(&[&ball, &shapes::mapped(&ball, |p| add(p, [apart, 0.0, 0.0]))])
    }

    fn yielded_obstacle(apart: f64, garments: usize) -> (Surface<f64>, Option<YieldedBody>) {
        let body = Surface::from_mesh(&balls(apart));
        let near = vec![true; body.positions.len()];
        let yielded = YieldedBody::of(&BodyObstacle::new(&body, near), garments, Clearance::AMPLE, None);
        (body, yielded)
    }

    /// The least distance of the two balls along the line of their centres, by their vertices.
    fn space(surface: &Surface<f64>, apart: f64) -> f64 {
        let (left, right) = surface.positions.split_at(surface.positions.len() / 2);
        let near_axis = |p: &&[f64; 3]| norm([0.0, p[1], p[2]]) < 0.03;
        let end = left.iter().filter(near_axis).map(|p| p[0]).fold(f64::NEG_INFINITY, f64::max);
        let is_left = |p: &&[f64; 3]| p[0] < apart;
        right.iter().filter(near_axis).filter(is_left).map(|p| p[0]).fold(f64::INFINITY, f64::min) - end
    }

    #[test]
    fn overlapping_parts_get_clearance() {
        for (apart, garments) in [(0.19, 1), (0.203, 1), (0.17, 3)] {
            let (body, yielded) = yielded_obstacle(apart, garments);
            let yielded = yielded.unwrap();
            let clearance = BODY_CLEARANCE + CLEARANCE_PER_GARMENT * garments as f64;
            assert!(space(&body, apart) < 0.5 * clearance);
            let space = space(&yielded.surface, apart);
            assert!((0.9 * clearance..1.3 * clearance).contains(&space), "{apart}: {space} of {clearance}");
            let moves = body.positions.iter().zip(&yielded.surface.positions).map(|(p, q)| norm(sub(*q, *p)));
            for (moved, yielded) in moves.zip(&yielded.yielded) {
                assert_eq!(moved > 0.0, *yielded);
                assert!(moved <= 0.5 * (0.2 - apart + clearance) * 1.05 + 1e-9);
            }
            let share = yielded.yielded.iter().filter(|g| **g).count() as f64 / yielded.yielded.len() as f64;
            assert!(share < 0.3, "{share}");
        }
    }

    /// From step to step the yield of no vertex changes more than allowed; a share of the clearance is a share of the yield.
    #[test]
    fn the_yield_is_limited_per_step_and_scales_with_the_share() {
        let body = Surface::from_mesh(&balls(0.19));
        let near = vec![true; body.positions.len()];
        let drawn = BodyObstacle::new(&body, near);
        let all = YieldedBody::of(&drawn, 1, Clearance::AMPLE, None).unwrap();
        let (steps, most) = (vec![0.0; body.positions.len()], 0.002);
        let slow =
            YieldedBody::of(&drawn, 1, Clearance::AMPLE, Some(Before { steps: &steps, most })).unwrap();
        assert!(all.steps.iter().any(|step| *step > most));
        for (slow, all) in slow.steps.iter().zip(&all.steps) {
            assert_eq!(*slow, all.min(most));
        }
        let half = YieldedBody::of(&drawn, 1, Clearance::AMPLE.with_share(0.5), None).unwrap();
        let moves = |yielded: &YieldedBody| -> Vec<f64> {
            let moved = yielded.surface.positions.iter().zip(&body.positions);
            moved.map(|(p, q)| norm(sub(*p, *q))).collect()
        };
        for ((half, all), pinched) in moves(&half).iter().zip(moves(&all)).zip(&all.pinched) {
            let share = if *pinched { 1.0 } else { 0.5 };
            assert!((half - share * all).abs() < 1e-12);
        }
    }

    /// Vertices that have just gone in at a slant have no surface straight behind them: the nearest one counts, so that they do
    /// not yield all at once.
    #[test]
    fn a_vertex_that_has_just_gone_in_yields_a_little() {
        let steps = |apart: f64| {
            let body = Surface::from_mesh(&balls(apart));
            let near = vec![true; body.positions.len()];
            YieldedBody::of(&BodyObstacle::new(&body, near), 1, Clearance::DEEP, None).unwrap().steps
        };
        for apart in [0.199, 0.19, 0.17, 0.15] {
            // Nowhere farther than half of what overlaps along the line of the centres.
            let most = steps(apart).into_iter().fold(0.0, f64::max);
            assert!(
                most <= 0.5 * (0.2 - apart + BODY_CLEARANCE + CLEARANCE_PER_GARMENT) * 1.05 + 1e-9,
                "{apart}: {most}"
            );
        }
    }

    #[test]
    fn what_is_apart_open_or_far_from_cloth_stays() {
        assert!(yielded_obstacle(0.25, 1).1.is_none());
        let open = Surface::from_mesh(&shapes::grid(0.1, 0.1, 4, 4));
        let near = vec![true; open.positions.len()];
        assert!(YieldedBody::of(&BodyObstacle::new(&open, near), 1, Clearance::AMPLE, None).is_none());
        let body = Surface::from_mesh(&balls(0.19));
        let far = vec![false; body.positions.len()];
        assert!(YieldedBody::of(&BodyObstacle::new(&body, far), 1, Clearance::AMPLE, None).is_none());
        // Near each other, but not inside.
        let body = Surface::from_mesh(&balls(0.203));
        let near = vec![true; body.positions.len()];
        let drawn = BodyObstacle::new(&body, near);
        assert!(YieldedBody::of(&drawn, 1, Clearance::AMPLE, None).is_some());
        assert!(YieldedBody::of(&drawn, 1, Clearance::AMPLE.with_share(0.0), None).is_none());
    }
}
