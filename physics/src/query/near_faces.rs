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
