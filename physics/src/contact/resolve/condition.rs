//! Linear conditions on a garment's vertices, and where two triangles that intersect ask for them.

use crate::contact::Triangle;
use crate::vec3::{add_scaled, axpy, cross, dot, norm_squared, normalized, sub};

/// The half-space that the surface nearest to a point leaves to it: `normal·x ≥ offset`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    /// Unit normal, away from the obstacle.
    pub normal: [f64; 3],
    /// Where the surface is.
    pub offset: f64,
    /// Signed distance of the point that asked (m).
    pub distance: f64,
    /// Whether it may be violated without being a defect: it only keeps what is there.
    pub is_held: bool,
}

/// `Σ weight·(vertex·normal) ≥ target` over up to six vertices.
#[derive(Debug, Clone, Copy)]
pub(super) struct Condition {
    pub vertices: [u32; 6],
    pub weights: [f64; 6],
    pub count: u8,
    pub normal: [f64; 3],
    pub target: f64,
}

impl Condition {
    /// Of up to six vertices with a weight each.
    pub fn new<const N: usize>(vertices: [u32; N], weights: [f64; N], normal: [f64; 3], target: f64) -> Self {
        let mut contact =
            Self { vertices: [vertices[0]; 6], weights: [0.0; 6], count: N as u8, normal, target };
        contact.vertices[..N].copy_from_slice(&vertices);
        contact.weights[..N].copy_from_slice(&weights);
        contact
    }

    /// A vertex on the right side of a plane, `gap` away.
    pub fn vertex(v: u32, plane: &Plane, gap: f64) -> Self {
        Self::new([v], [1.0], plane.normal, plane.offset + gap)
    }

    /// Vertex `v` over a point of face `lower`, at least `gap` along `normal`.
    pub fn vertex_over(v: u32, (lower, at_lower): ([u32; 3], [f64; 3]), normal: [f64; 3], gap: f64) -> Self {
        let ([a, b, c], [x, y, z]) = (lower, at_lower);
        Self::new([v, a, b, c], [1.0, -x, -y, -z], normal, gap)
    }

    /// A point of face `upper` over a point of face `lower`, at least `gap` along `normal`.
    pub fn face_points(
        (upper, at_upper): ([u32; 3], [f64; 3]),
        (lower, at_lower): ([u32; 3], [f64; 3]),
        normal: [f64; 3],
        gap: f64,
    ) -> Self {
        let ([a, b, c], [d, e, f]) = (upper, lower);
        let ([u, v, w], [x, y, z]) = (at_upper, at_lower);
        Self::new([a, b, c, d, e, f], [u, v, w, -x, -y, -z], normal, gap)
    }

    /// The same condition on vertices numbered from `start` on.
    pub fn shifted(mut self, start: u32) -> Self {
        self.vertices.iter_mut().for_each(|v| *v += start);
        self
    }

    pub fn terms(&self) -> impl Iterator<Item = (usize, f64)> {
        let count = usize::from(self.count);
        self.vertices[..count].iter().zip(&self.weights[..count]).map(|(v, w)| (*v as usize, *w))
    }

    /// Moves the vertices that may move by the smallest step that meets the condition; whether one was needed.
    #[inline]
    pub fn enforce(&self, positions: &mut [[f64; 3]], may_move: &[bool]) -> bool {
        let height: f64 = self.terms().map(|(v, w)| w * dot(positions[v], self.normal)).sum();
        let missing = self.target - height;
        if missing <= 0.0 {
            return false;
        }
        let compliance: f64 = self.terms().filter(|(v, _)| may_move[*v]).map(|(_, w)| w * w).sum();
        // A point held by its fixed corners alone would throw the others far away.
        if compliance < 0.02 {
            return true;
        }
        for (v, w) in self.terms().filter(|(v, _)| may_move[*v]) {
            axpy(&mut positions[v], w * missing / compliance, self.normal);
        }
        true
    }
}

/// A corner of the part of one triangle that lies over or under another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Overlap {
    /// Its place in the upper triangle.
    pub at_upper: [f64; 3],
    /// Its place in the lower triangle, straight below or above along the normal.
    pub at_lower: [f64; 3],
    /// Height over the lower triangle, negative below (m).
    pub height: f64,
}

/// Unit normal; zero where there is no area.
pub(super) fn normal_of(triangle: &Triangle) -> [f64; 3] {
    normalized(cross(sub(triangle[1], triangle[0]), sub(triangle[2], triangle[0])))
}

/// The part of `upper` within the prism over `lower` along the unit vector `normal`. Heights are linear in between: the
/// triangles are apart if all corners lie over the lower triangle. Empty where the lower triangle is seen edge-on.
pub(super) fn overlap(upper: &Triangle, lower: &Triangle, normal: [f64; 3]) -> Vec<Overlap> {
    let area = dot(normal, cross(sub(lower[1], lower[0]), sub(lower[2], lower[0])));
    if area.abs() < 1e-14 {
        return Vec::new();
    }
    // Inward normals of the prism's sides, scaled so that the height over each side is a barycentric coordinate.
    let sides: [([f64; 3], [f64; 3]); 3] = std::array::from_fn(|k| {
        let (from, to, opposite) = (lower[(k + 1) % 3], lower[(k + 2) % 3], lower[k]);
        let inward = cross(normal, sub(to, from));
        let height = dot(inward, sub(opposite, from));
        (from, inward.map(|x| x / height))
    });
    let mut corners: Vec<[f64; 3]> = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let place = |at: &[f64; 3]| (0..3).fold([0.0; 3], |sum, k| add_scaled(sum, at[k], upper[k]));
    for (from, inward) in &sides {
        let inside: Vec<f64> = corners.iter().map(|at| dot(*inward, sub(place(at), *from))).collect();
        let mut kept = Vec::with_capacity(corners.len() + 1);
        for i in 0..corners.len() {
            let j = (i + 1) % corners.len();
            if inside[i] >= 0.0 {
                kept.push(corners[i]);
            }
            if (inside[i] >= 0.0) != (inside[j] >= 0.0) {
                let t = inside[i] / (inside[i] - inside[j]);
                kept.push(std::array::from_fn(|k| corners[i][k] + t * (corners[j][k] - corners[i][k])));
            }
        }
        corners = kept;
    }
    corners
        .iter()
        .map(|at| {
            let p = place(at);
            let at_lower = sides.map(|(from, inward)| dot(inward, sub(p, from)).clamp(0.0, 1.0));
            let below = (0..3).fold([0.0; 3], |sum, k| add_scaled(sum, at_lower[k], lower[k]));
            Overlap { at_upper: *at, at_lower, height: dot(normal, sub(p, below)) }
        })
        .collect()
}

/// How far from `p` the line along `direction` meets a triangle, and where in it.
pub(super) fn along_line(p: [f64; 3], direction: [f64; 3], [a, b, c]: &Triangle) -> Option<(f64, [f64; 3])> {
    let (ab, ac, ap) = (sub(*b, *a), sub(*c, *a), sub(p, *a));
    let across = cross(direction, ac);
    let scale_of = dot(ab, across);
    if scale_of.abs() < 1e-14 {
        return None;
    }
    let v = dot(ap, across) / scale_of;
    let other = cross(ap, ab);
    let w = dot(direction, other) / scale_of;
    let u = 1.0 - v - w;
    (u >= 0.0 && v >= 0.0 && w >= 0.0).then(|| (dot(ac, other) / scale_of, [u, v, w]))
}

/// Whether a triangle is too small to say where it looks.
pub(super) fn is_tiny(triangle: &Triangle) -> bool {
    norm_squared(cross(sub(triangle[1], triangle[0]), sub(triangle[2], triangle[0]))) < 1e-24
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::triangles_intersect;
    use crate::mesh::shapes::SplitMix;

    #[test]
    fn triangles_that_meet_have_an_overlap_below_and_lifting_it_parts_them() {
        let mut random = SplitMix::new(5);
        let mut met = 0;
        for _ in 0..4000 {
            let mut triangle =
                || -> Triangle { std::array::from_fn(|_| std::array::from_fn(|_| random.symmetric())) };
            let (upper, lower) = (triangle(), triangle());
            let normal = normal_of(&lower);
            let found = overlap(&upper, &lower, normal);
            let lowest = found.iter().map(|o| o.height).fold(f64::INFINITY, f64::min);
            if triangles_intersect(&upper, &lower) {
                met += 1;
                assert!(lowest <= 1e-9, "{lowest}");
            }
            if lowest.is_finite() {
                let lifted = upper.map(|p| add_scaled(p, 1e-6 - lowest.min(0.0), normal));
                assert!(!triangles_intersect(&lifted, &lower));
            }
            for o in &found {
                let at =
                    |t: &Triangle, w: [f64; 3]| (0..3).fold([0.0; 3], |sum, k| add_scaled(sum, w[k], t[k]));
                let expected = add_scaled(at(&lower, o.at_lower), o.height, normal);
                assert!(norm_squared(sub(at(&upper, o.at_upper), expected)) < 1e-16);
            }
        }
        assert!(met > 200, "{met}");
    }

    #[test]
    fn enforcing_meets_the_condition_and_moves_only_what_may_move() {
        let mut positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let contact = Condition::new([0, 1, 2], [0.2, 0.3, 0.5], [0.0, 0.0, 1.0], 0.1);
        assert!(contact.enforce(&mut positions, &[true, false, true]));
        assert_eq!(positions[1], [1.0, 0.0, 0.0]);
        let height = 0.2 * positions[0][2] + 0.5 * positions[2][2];
        assert!((height - 0.1).abs() < 1e-12);
        let before = positions.clone();
        assert!(!contact.enforce(&mut positions, &[true; 3]) || positions != before);
    }
}
