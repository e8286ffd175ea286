//! The faces near a query point that moves a little between queries.
//!
//! A solver asks for the distance of the same points to the same surface in every step, and they have hardly moved. The distance of
//! a point to a face changes by at most as much as the point has moved (triangle inequality). So the faces that were near when a point
//! was looked up, nearest first, are asked only as far down as one of them can still be the closest; and where one that was not
//! near could be, the point is looked up anew. The answer is that of a fresh query, whatever was asked before.

use super::closest_point::{ClosestPoint, SurfacePoint};
use super::triangle_point::TrianglePoint;
use crate::vec3::{dot, norm, scale, sub};

/// Faces this much farther away than the closest one are remembered (m): about an edge of a body.
const SLACK: f64 = 0.01;

/// Most faces that are remembered of one point.
const MOST: usize = 32;

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
    /// The last point asked for, and whether it was inside.
    last: ([f64; 3], bool),
}

impl Default for NearFaces {
    fn default() -> Self {
        Self {
            at: [f64::NAN; 3],
            faces: Vec::new(),
            beyond: 0.0,
            clear: f64::NEG_INFINITY,
            last: ([f64::NAN; 3], false),
        }
    }
}

impl NearFaces {
    /// How far outside `p` is at least (m); negative if nothing is known.
    pub fn clearance(&self, p: [f64; 3]) -> f64 {
        // A comparison with NaN, where nothing was looked up yet, says no.
        (self.clear - norm(sub(p, self.at))).max(f64::NEG_INFINITY)
    }

    /// Remembers that `p`, just projected, is at a signed `distance`.
    pub fn set_distance(&mut self, p: [f64; 3], distance: f64) {
        self.last = (p, distance < 0.0);
        if p == self.at {
            self.clear = distance;
        }
    }

    /// Whether `p`, just asked for, is inside.
    pub fn is_inside(&self, p: [f64; 3]) -> bool {
        self.last.0 == p && self.last.1
    }

    /// The point of `surface` closest to a finite `p`. Points farther away than `reach` (m) are not remembered.
    pub fn project(&mut self, surface: &ClosestPoint, p: [f64; 3], reach: f64) -> Option<SurfacePoint> {
        if let Some((face, found)) = self.closest(surface, p) {
            return Some(surface.surface_point(face, found));
        }
        let found = surface.project(p)?;
        let distance = found.distance_squared.sqrt();
        *self = Self { at: p, beyond: distance, ..Self::default() };
        if distance <= reach + SLACK {
            self.beyond = distance + SLACK;
            self.faces = surface.faces_within(p, self.beyond);
            self.faces.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            if let Some(&(next, _)) = self.faces.get(MOST) {
                self.beyond = next;
                self.faces.truncate(MOST);
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

    /// Where the distance from `p`, just projected, to the remembered faces is smallest locally, if that is at most `band` (m) more than
    /// the least: distance and unit direction from there to `p`, nearest first.
    pub fn minima(&self, surface: &ClosestPoint, p: [f64; 3], band: f64) -> Vec<(f64, [f64; 3])> {
        let moved = norm(sub(p, self.at));
        let mut found: Vec<(f64, u32, TrianglePoint)> = Vec::new();
        let mut nearest = f64::INFINITY;
        for &(distance, face) in &self.faces {
            if distance - moved > nearest + band {
                break;
            }
            let point = surface.on_face(face, p);
            nearest = nearest.min(point.distance_squared.sqrt());
            found.push((point.distance_squared.sqrt(), face, point));
        }
        found.retain(|(distance, ..)| *distance > 0.0 && *distance <= nearest + band);
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut minima: Vec<(f64, [f64; 3])> = Vec::new();
        for (k, (distance, face, point)) in found.iter().enumerate() {
            // On the border of a face it is a minimum only if no neighbour there comes nearer, and the neighbours' is the same.
            let border = surface.face(*face);
            let is_on = |v: &u32| (0..3).any(|c| border[c] == *v && point.barycentric[c] > 0.0);
            let of_border = point.barycentric.iter().filter(|b| **b > 0.0).count();
            let is_other = |(_, other, _): &(f64, u32, TrianglePoint)| {
                surface.face(*other).iter().filter(|v| is_on(v)).count() < of_border
            };
            if of_border == 3 || found[..k].iter().all(is_other) {
                minima.push((*distance, scale(sub(p, point.position), 1.0 / distance)));
            }
        }
        // Minima that look the same way are one.
        let mut apart: Vec<(f64, [f64; 3])> = Vec::new();
        for minimum in minima {
            if apart.iter().all(|(_, direction)| dot(*direction, minimum.1) < SAME_DIRECTION) {
                apart.push(minimum);
            }
        }
        apart
    }
}

/// Cosine of the angle (1°) below which two directions are one.
const SAME_DIRECTION: f64 = 0.99985;

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
    fn over_a_valley_both_slopes_are_minima_and_over_a_ridge_there_is_one() {
        let bent = |slope: f64| {
            let grid = shapes::grid(0.2, 0.2, 8, 8);
            let mesh = shapes::mapped(&grid, |[x, y, _]| [x - 0.1, slope * (x - 0.1).abs(), 0.1 - y]);
            ClosestPoint::new(mesh.positions().to_vec(), mesh.faces())
        };
        let minima = |surface: &ClosestPoint, p: [f64; 3], band: f64| {
            let mut near = NearFaces::default();
            near.project(surface, p, 0.05).unwrap();
            near.minima(surface, p, band)
        };
        let p = [1e-4, 0.005, 0.003];
        let found = minima(&bent(1.0), p, 1e-3);
        assert_eq!(found.len(), 2);
        // Of p = (x, y) over |x|: (y ∓ x)/√2.
        for ((distance, _), expected) in found.iter().zip([p[1] - p[0], p[1] + p[0]]) {
            assert!((distance - expected / 2f64.sqrt()).abs() < 1e-12);
        }
        assert!(dot(found[0].1, found[1].1).abs() < 1e-12);
        assert_eq!(minima(&bent(1.0), p, 1e-5).len(), 1);
        assert_eq!(minima(&bent(-1.0), p, 1e-3).len(), 1);
    }
}
