//! The same queries without an accelerator, in O(V) or O(F) each: the oracles that the fast ones are tested against.

use crate::query::pseudo_normal::PseudoNormals;
use crate::query::triangle_point::closest_on_triangle;
use crate::query::{Distance, Gap};
use crate::real::Real;
use crate::rows::faces_at_vertices;
use crate::vec3;

/// Index and squared distance of the nearest point; the lowest index of several equally near. `(u32::MAX, ∞)` for no points.
pub fn nearest<T: Real>(points: &[[T; 3]], p: [T; 3]) -> (u32, T) {
    let mut best = (u32::MAX, T::infinity());
    for (index, point) in points.iter().enumerate() {
        let distance = vec3::distance_squared(*point, p);
        if distance < best.1 {
            best = (index as u32, distance);
        }
    }
    best
}

/// Distance (m) from `p` to the closest point of any triangle; infinite without a face.
pub fn distance_to_surface(positions: &[[f64; 3]], faces: &[[u32; 3]], p: [f64; 3]) -> f64 {
    faces
        .iter()
        .map(|face| closest_on_triangle(p, face.map(|v| positions[v as usize])).distance_squared)
        .fold(f64::INFINITY, f64::min)
        .sqrt()
}

/// [`crate::Surface::gap`] by exhaustive search (in `f64`; `normals` are area-weighted vertex normals).
///
/// # Panics
/// If the surface has no vertex, or, but for [`Distance::NearestVertex`], no face.
///
/// [`Distance::Union`] is taken for [`Distance::ClosestPoint`]: for surfaces that do not intersect themselves.
pub fn gap(
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    normals: &[[f64; 3]],
    p: [f64; 3],
    distance: Distance,
) -> Gap<f64> {
    match distance {
        Distance::NearestVertex => {
            let (vertex, _) = nearest(positions, p);
            let (position, normal) = (positions[vertex as usize], normals[vertex as usize]);
            Gap { gap: vec3::dot(vec3::sub(p, position), normal), gradient: normal, vertex }
        }
        Distance::ClosestPoint | Distance::Union => {
            let (index, found) = faces
                .iter()
                .map(|face| closest_on_triangle(p, face.map(|v| positions[v as usize])))
                .enumerate()
                .min_by(|a, b| a.1.distance_squared.total_cmp(&b.1.distance_squared))
                .expect("a surface has faces");
            let face = faces[index];
            let at_vertex = &faces_at_vertices(positions.len(), faces, 0..faces.len() as u32);
            let normal = PseudoNormals { positions, faces, at_vertex }.at(index as u32, found.feature);
            let offset = vec3::sub(p, found.position);
            let sign = if vec3::dot(offset, normal) < 0.0 { -1.0 } else { 1.0 };
            let corner =
                (0..3).max_by(|&i, &j| found.barycentric[i].total_cmp(&found.barycentric[j])).unwrap_or(0);
            Gap {
                gap: sign * found.distance_squared.sqrt(),
                gradient: vec3::scale(vec3::normalized(offset), sign),
                vertex: face[corner],
            }
        }
    }
}

/// Generalised winding number of a surface about `p` (Jacobson, Kavan and Sorkine-Hornung 2013): the sum of the signed solid
/// angles of its triangles (Van Oosterom and Strackee 1983) over 4π. For a closed surface it is a whole number: 0 outside, 1
/// inside, 2 where two parts of the surface overlap.
pub fn winding_number(positions: &[[f64; 3]], faces: &[[u32; 3]], p: [f64; 3]) -> f64 {
    let half_angle = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| vec3::normalized(vec3::sub(positions[v as usize], p)));
        let cosine = 1.0 + vec3::dot(a, b) + vec3::dot(b, c) + vec3::dot(c, a);
        vec3::dot(a, vec3::cross(b, c)).atan2(cosine)
    };
    faces.iter().map(half_angle).sum::<f64>() / (2.0 * std::f64::consts::PI)
}
