//! What lies behind a face: the largest ball that touches it from behind without anything in it (a "shrinking ball": Ma, Bae and
//! Choi, "3D medial axis point approximation using nearest neighbors and the normal field", The Visual Computer 2012) touches the
//! opposite sheet at its other end.

use crate::mesh::triangle::triangle_normal;
use clothcombo_physics::query::ClosestPoint;
use clothcombo_physics::vec3::{add, add_scaled, dot, norm, norm_squared, scale, sub};

/// Least cosine between the normal of a face and the reverse normal of what it faces.
const REVERSE: f64 = 0.7;
/// The ball's other end lies within this cosine straight behind the face.
const STRAIGHT: f64 = 0.8;
/// Steps until the ball shrinks no more; few are needed.
const SHRINKING_STEPS: usize = 12;

/// The other side of the cloth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Opposite {
    pub face: u32,
    /// Thickness (in the unit of the positions).
    pub distance: f64,
}

/// Centre of a face and its normal, twice as long as its area.
pub(super) fn centre_and_normal(positions: &[[f64; 3]], face: [u32; 3]) -> ([f64; 3], [f64; 3]) {
    let corners @ [a, b, c] = face.map(|v| positions[v as usize]);
    (scale(add(add(a, b), c), 1.0 / 3.0), triangle_normal(corners))
}

/// The sheet that face `number` has straight behind it within `limit`.
pub(super) fn opposite(
    surface: &ClosestPoint,
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    number: u32,
    limit: f64,
) -> Option<Opposite> {
    let (p, normal) = centre_and_normal(positions, faces[number as usize]);
    let length = norm(normal);
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    let normal = scale(normal, 1.0 / length);
    let mut radius = 0.5 * limit;
    let mut touched = None;
    for _ in 0..SHRINKING_STEPS {
        let centre = add_scaled(p, -radius, normal);
        let found = surface.project(centre)?;
        // Nothing but the face itself: the ball is as large as it gets.
        if found.distance_squared >= (radius * (1.0 - 1e-6)).powi(2) {
            break;
        }
        let chord = sub(p, found.position);
        let next = norm_squared(chord) / (2.0 * dot(chord, normal));
        if !(next.is_finite() && next > 0.0) {
            break;
        }
        touched = Some(found);
        let is_done = next >= radius * (1.0 - 1e-4);
        radius = next.min(radius);
        if is_done {
            break;
        }
    }
    let touched = touched?;
    let chord = sub(p, touched.position);
    let behind = centre_and_normal(positions, faces[touched.face as usize]).1;
    let is_opposite = -dot(behind, normal) >= REVERSE * norm(behind);
    let is_straight = dot(chord, normal) >= STRAIGHT * norm(chord);
    (is_opposite && is_straight).then_some(Opposite { face: touched.face, distance: dot(chord, normal) })
}
