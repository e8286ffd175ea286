//! Generalised winding number: how often a surface encloses a point, without any closest point or normal.
//!
//! Exhaustive, O(F) for each point: an oracle for the sign of a distance and for measurements, not for training.

use rayon::prelude::*;

use crate::vec3;

/// Triangles between two rescalings of the running product: each factor lies in [1e-16, 4], and 4¹⁶ and 1e-256 are finite.
const RESCALE_AFTER: usize = 16;

/// Generalised winding number of a surface about `p` (Jacobson, Kavan and Sorkine-Hornung 2013): the sum of the signed solid
/// angles of its triangles (Van Oosterom and Strackee 1983) over 4π.
///
/// `positions` `[V, 3]` (m), `faces` `[F, 3]` counter-clockwise seen from outside. For a closed surface it is a whole number: 0
/// outside, 1 inside, 2 where two parts of the surface overlap. A triangle with a corner exactly at `p` counts as 0.
pub fn winding_number(positions: &[[f64; 3]], faces: &[[u32; 3]], p: [f64; 3]) -> f64 {
    let seen: Vec<([f64; 3], f64)> = positions
        .iter()
        .map(|&v| {
            let offset = vec3::sub(v, p);
            let length = vec3::norm(offset);
            (vec3::scale(offset, 1.0 / length), length)
        })
        .collect();
    let mut sum = AngleSum::default();
    for chunk in faces.chunks(RESCALE_AFTER) {
        for face in chunk {
            let [(a, la), (b, lb), (c, lc)] = face.map(|v| seen[v as usize]);
            if la > 0.0 && lb > 0.0 && lc > 0.0 {
                // tan(Ω/2) of unit directions.
                let sine = vec3::dot(a, vec3::cross(b, c));
                let cosine = 1.0 + vec3::dot(a, b) + vec3::dot(b, c) + vec3::dot(c, a);
                sum.add(cosine, sine);
            }
        }
        sum.rescale();
    }
    // Half solid angles were added.
    sum.angle() / (2.0 * std::f64::consts::PI)
}

/// [`winding_number`] of every point of `points` `[N, 3]` (m), in parallel.
pub fn winding_numbers(positions: &[[f64; 3]], faces: &[[u32; 3]], points: &[[f64; 3]]) -> Vec<f64> {
    points.par_iter().map(|&p| winding_number(positions, faces, p)).collect()
}

/// `Σ atan2(sine, cosine)` as the argument of a product of complex numbers, with the full turns counted apart: one arc tangent
/// instead of one per term.
struct AngleSum {
    cosine: f64,
    sine: f64,
    turns: f64,
}

impl Default for AngleSum {
    fn default() -> Self {
        Self { cosine: 1.0, sine: 0.0, turns: 0.0 }
    }
}

impl AngleSum {
    #[inline(always)]
    fn add(&mut self, cosine: f64, sine: f64) {
        // On an edge the angle is undefined: the face counts as seen from the side, at no angle.
        if cosine == 0.0 && sine == 0.0 {
            return;
        }
        let product = (self.cosine * cosine - self.sine * sine, self.cosine * sine + self.sine * cosine);
        // Two angles of [0, π] whose sum appears negative went past π; two of (−π, 0) whose sum does not went past −π.
        if self.sine >= 0.0 && sine >= 0.0 && product.1 < 0.0 {
            self.turns += 1.0;
        } else if self.sine < 0.0 && sine < 0.0 && product.1 >= 0.0 {
            self.turns -= 1.0;
        }
        (self.cosine, self.sine) = product;
    }

    fn rescale(&mut self) {
        let size = self.cosine.abs().max(self.sine.abs());
        if size > 0.0 {
            self.cosine /= size;
            self.sine /= size;
        }
    }

    fn angle(&self) -> f64 {
        self.sine.atan2(self.cosine) + self.turns * 2.0 * std::f64::consts::PI
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{self, SplitMix};

    /// The definition, one arc tangent per triangle.
    fn by_definition(positions: &[[f64; 3]], faces: &[[u32; 3]], p: [f64; 3]) -> f64 {
        let solid_angle: f64 = faces
            .iter()
            .map(|face| {
                let [a, b, c] = face.map(|v| vec3::sub(positions[v as usize], p));
                let (la, lb, lc) = (vec3::norm(a), vec3::norm(b), vec3::norm(c));
                let numerator = vec3::dot(a, vec3::cross(b, c));
                let denominator =
                    la * lb * lc + vec3::dot(a, b) * lc + vec3::dot(b, c) * la + vec3::dot(c, a) * lb;
                2.0 * numerator.atan2(denominator)
            })
            .sum();
        solid_angle / (4.0 * std::f64::consts::PI)
    }

    #[test]
    fn a_point_on_an_edge_takes_nothing_from_the_other_triangles() {
        // Corners on the axes: the middle of an edge between opposite corners of the base is on two faces.
        let corners = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let faces = [[0, 3, 1], [0, 1, 2], [0, 2, 3], [1, 3, 2]];
        let found = winding_number(&corners, &faces, [0.0; 3]);
        assert!((found - by_definition(&corners, &faces, [0.0; 3])).abs() < 1e-12, "{found}");
        assert!(found.abs() > 0.1);
    }

    #[test]
    fn one_inside_a_sphere_and_zero_outside() {
        let sphere = shapes::icosphere(0.5, 3);
        let mut inside = 0;
        for p in SplitMix::new(1).points(500, 0.8) {
            let distance = vec3::norm(p);
            // Between the faces' planes and the sphere through the vertices lies a shell of neither.
            if (0.49..=0.5).contains(&distance) {
                continue;
            }
            let expected = if distance < 0.5 { 1.0 } else { 0.0 };
            assert!((winding_number(sphere.positions(), sphere.faces(), p) - expected).abs() < 1e-9);
            inside += usize::from(distance < 0.5);
        }
        assert!((50..450).contains(&inside));
    }

    #[test]
    fn two_where_two_spheres_overlap() {
        let sphere = shapes::icosphere(0.5, 3);
        let shifted = shapes::mapped(&sphere, |[x, y, z]| [x + 0.6, y, z]);
        let both = shapes::union(&[&sphere, &shifted]);
        let found = winding_numbers(
            both.positions(),
            both.faces(),
            &[[0.3, 0.0, 0.0], [-0.2, 0.0, 0.0], [0.8, 0.1, 0.0], [0.3, 0.48, 0.0], [2.0, 0.0, 0.0]],
        );
        for (found, expected) in found.iter().zip([2.0, 1.0, 1.0, 0.0, 0.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }

    #[test]
    fn equals_the_definition_on_open_and_turned_surfaces() {
        let sphere = shapes::icosphere(0.4, 2);
        let flipped: Vec<[u32; 3]> = sphere.faces().iter().map(|&[a, b, c]| [a, c, b]).collect();
        let tube = shapes::tube(0.3, 0.7, 20, 12);
        let sheet = shapes::irregular_grid(1.0, 1.0, 9, 9, 0.4, 3);
        let cases = [
            (sphere.positions(), flipped.as_slice()),
            (tube.positions(), tube.faces()),
            (sheet.positions(), sheet.faces()),
        ];
        for (positions, faces) in cases {
            for p in SplitMix::new(5).points(200, 0.9) {
                let expected = by_definition(positions, faces, p);
                assert!((winding_number(positions, faces, p) - expected).abs() < 1e-10, "at {p:?}");
            }
        }
        assert!((winding_number(sphere.positions(), &flipped, [0.0; 3]) + 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_point_at_a_vertex_gives_a_number() {
        let sphere = shapes::icosphere(0.5, 2);
        let found = winding_number(sphere.positions(), sphere.faces(), sphere.positions()[7]);
        assert!((0.0..1.0).contains(&found), "{found}");
        assert_eq!(winding_number(&[], &[], [0.0; 3]), 0.0);
    }
}
