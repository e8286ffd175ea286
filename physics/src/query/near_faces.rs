//! The faces near a query point that moves a little between queries.
//!
//! A solver asks for the distance of the same points to the same surface in every step, and they have hardly moved. The
//! distance of a point to a face changes by at most as much as the point has moved (triangle inequality). So the faces
//! that were near when a point was looked up, nearest first, are asked only as far down as one of them can still be the
//! closest; and where one that was not near could be, the point is looked up anew. The answer is that of a fresh query,
//! whatever was asked before.
//!
//! Also remembered are the sides of creases that the point has been on, for whoever has to know that there is another one
//! (`energy/creases.rs`).

use super::closest_point::{ClosestPoint, SurfacePoint};
use super::triangle_point::TrianglePoint;
use crate::vec3::{dot, norm, sub};

/// Faces this much farther away than the closest one are remembered (m): about an edge of a body.
const REMEMBERED_BEYOND: f64 = 0.01;

/// Most faces that are remembered of one point.
const MOST_FACES: usize = 32;

/// Most sides that are remembered of one point.
const MOST_SIDES: usize = 16;

/// Cosine of the angle (1°) below which two directions are one.
const SAME_DIRECTION: f64 = 0.99985;

/// A distance this much less (m) is as large.
const EQUAL_DISTANCE: f64 = 1e-9;

/// What is remembered of one point.
#[derive(Debug, Clone)]
pub(crate) struct NearFaces {
    /// Where it was looked up (m).
    at: [f64; 3],
    /// Distance there and number of the nearest faces, nearest first.
    faces: Vec<(f64, u32)>,
    /// No other face was nearer than this there (m).
    beyond: f64,
    /// The signed distance was at least this there, if known (m).
    clear: f64,
    /// The last point seen of every direction of the gradient, latest first.
    seen: Vec<SeenSide>,
}

/// The linear function that a distance follows near a point.
#[derive(Debug, Clone, Copy)]
struct SeenSide {
    /// The point (m).
    at: [f64; 3],
    /// Signed distance there (m).
    distance: f64,
    gradient: [f64; 3],
}

impl Default for NearFaces {
    fn default() -> Self {
        Self { at: [f64::NAN; 3], faces: Vec::new(), beyond: 0.0, clear: f64::NEG_INFINITY, seen: Vec::new() }
    }
}

impl NearFaces {
    /// How far outside `p` is at least (m); negative if nothing is known.
    pub fn clearance(&self, p: [f64; 3]) -> f64 {
        // A comparison with NaN, where nothing was looked up yet, says no.
        (self.clear - norm(sub(p, self.at))).max(f64::NEG_INFINITY)
    }

    /// Remembers the signed distance (m) of `p`, just projected, and its gradient.
    pub fn see(&mut self, p: [f64; 3], distance: f64, gradient: [f64; 3]) {
        if p == self.at {
            self.clear = distance;
        }
        if self.seen.first().is_none_or(|side| side.at != p) {
            self.seen.retain(|side| !is_same_way(side.gradient, gradient));
            self.seen.truncate(MOST_SIDES - 1);
            self.seen.insert(0, SeenSide { at: p, distance, gradient });
        }
    }

    /// The linear functions that the distance was seen to follow near `p`, just seen: value at `p` (m) and gradient,
    /// its own first, then those that are at most `band` (m) larger there, least first, and were seen no farther than
    /// `reach` (m) away. It is the least of them where it is concave; those of a ridge, where it is not, are less at
    /// `p` than it is and none of them.
    pub fn sides(&self, p: [f64; 3], [band, reach]: [f64; 2]) -> Vec<(f64, [f64; 3])> {
        let Some(here) = self.seen.iter().find(|side| side.at == p) else { return Vec::new() };
        let near = self.seen.iter().filter(|side| norm(sub(p, side.at)) <= reach);
        let extended = near.map(|side| (side.distance + dot(side.gradient, sub(p, side.at)), side));
        let mut others: Vec<_> = extended
            .filter(|(distance, side)| {
                !is_same_way(side.gradient, here.gradient) && *distance >= here.distance - EQUAL_DISTANCE
            })
            .filter(|(distance, _)| *distance <= here.distance + band)
            .map(|(distance, side)| (distance, side.gradient))
            .collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        others.insert(0, (here.distance, here.gradient));
        others
    }

    /// The point of `surface` closest to a finite `p`. Points farther away than `reach` (m) are not remembered.
    pub fn project(&mut self, surface: &ClosestPoint, p: [f64; 3], reach: f64) -> Option<SurfacePoint> {
        if let Some((face, found)) = self.closest(surface, p) {
            return Some(surface.surface_point(face, found));
        }
        let found = surface.project(p)?;
        let distance = found.distance_squared.sqrt();
        let seen = std::mem::take(&mut self.seen);
        *self = Self { at: p, beyond: distance, seen, ..Self::default() };
        if distance <= reach + REMEMBERED_BEYOND {
            self.beyond = distance + REMEMBERED_BEYOND;
            self.faces = surface.faces_within(p, self.beyond);
            self.faces.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            if let Some(&(next, _)) = self.faces.get(MOST_FACES) {
                self.beyond = next;
                self.faces.truncate(MOST_FACES);
            }
        }
        Some(found)
    }

    /// The closest of the faces, if no other can be closer.
    fn closest(&self, surface: &ClosestPoint, p: [f64; 3]) -> Option<(u32, TrianglePoint)> {
        let moved = norm(sub(p, self.at));
        let mut best: Option<(u32, TrianglePoint)> = None;
        let mut nearest = f64::INFINITY;
        for &(distance, face) in &self.faces {
            if distance - moved > nearest {
                return best;
            }
            let found = surface.on_face(face, p);
            if best.is_none_or(|(_, best)| found.distance_squared < best.distance_squared) {
                nearest = found.distance_squared.sqrt();
                best = Some((face, found));
            }
        }
        // False for NaN.
        if nearest <= self.beyond - moved { best } else { None }
    }
}

fn is_same_way(a: [f64; 3], b: [f64; 3]) -> bool {
    dot(a, b) >= SAME_DIRECTION
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{self, SplitMix};
    use crate::query::{Distance, Surface};
    use crate::vec3::add_scaled;

    #[test]
    fn a_point_that_wanders_gets_the_answers_of_fresh_queries() {
        // Two balls that intersect, so that there are creases, buried faces and a seam.
        let ball = shapes::icosphere(0.1, 3);
        let body = shapes::union(&[&ball, &shapes::mapped(&ball, |[x, y, z]| [x + 0.13, y, z])]);
        let surface = Surface::<f64>::from_mesh(&body);
        let mut random = SplitMix::new(11);
        let mut direction = || std::array::from_fn::<f64, 3, _>(|_| random.symmetric());
        let reach = 0.005;
        for _ in 0..40 {
            let mut p = add_scaled([0.065, 0.0, 0.0], 0.12, direction());
            let mut near = NearFaces::default();
            for step in 0..60 {
                p = add_scaled(p, [1e-4, 1e-3, 1e-2][step % 3], direction());
                let gap = surface.gap_near(p, Distance::Union, reach, &mut near);
                let expected = surface.gap(p, Distance::Union);
                if gap.gradient == [0.0; 3] {
                    assert!(gap.gap >= reach && gap.gap <= expected.gap + 1e-12, "{gap:?} {expected:?}");
                } else {
                    assert!((gap.gap - expected.gap).abs() < 1e-12, "{gap:?} {expected:?}");
                    assert!(norm(sub(gap.gradient, expected.gradient)) < 1e-6, "{gap:?} {expected:?}");
                }
            }
        }
    }

    #[test]
    fn over_a_valley_both_slopes_are_seen_and_over_a_ridge_only_one() {
        let bent = |slope: f64| {
            let grid = shapes::grid(0.2, 0.2, 8, 8);
            let mesh = shapes::mapped(&grid, |[x, y, _]| [x - 0.1, slope * (x - 0.1).abs(), 0.1 - y]);
            Surface::<f64>::from_mesh(&mesh)
        };
        let p = [1e-4, 0.005, 0.003];
        let seen_from = |surface: &Surface<f64>, band: f64, points: &[[f64; 3]]| {
            let mut near = NearFaces::default();
            points.iter().for_each(|p| {
                surface.gap_near(*p, Distance::ClosestPoint, 0.05, &mut near);
            });
            near.sides(p, [band, f64::INFINITY])
        };
        let across = [[-3e-4, 0.0052, 0.003], p];
        let valley = bent(1.0);
        let found = seen_from(&valley, 1e-3, &across);
        assert_eq!(found.len(), 2);
        // Of p = (x, y) over |x|: (y ∓ x)/√2.
        for ((distance, _), expected) in found.iter().zip([p[1] - p[0], p[1] + p[0]]) {
            assert!((distance - expected / 2f64.sqrt()).abs() < 1e-12);
        }
        assert!(dot(found[0].1, found[1].1).abs() < 1e-12);
        // Farther off than asked for; where it was not looked; over a ridge.
        assert_eq!(seen_from(&valley, 1e-5, &across).len(), 1);
        assert_eq!(seen_from(&valley, 1e-3, &[p]).len(), 1);
        assert!(seen_from(&valley, 1e-3, &across[..1]).is_empty());
        assert_eq!(seen_from(&bent(-1.0), 1e-3, &across).len(), 1);
    }
}
