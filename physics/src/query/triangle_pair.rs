//! Whether two triangles intersect, decided exactly.
//!
//! Every decision is the sign of a determinant of the given coordinates, evaluated by Shewchuk's adaptive predicates
//! (crate `robust`): nothing is rounded, no tolerance exists, touching and coplanar triangles are decided like any other.
//! The signs are exact as long as no product of three coordinates overflows or underflows (coordinates between 1e-80 and
//! 1e80 in magnitude, or zero). Only the *position* of an intersection ([`intersection_segment`]) is rounded.
//!
//! **Meaning.** A triangle is closed: its edges and corners belong to it. Two triangles intersect when they share at least
//! one point. A triangle without area (corners on one line, or a corner that is not finite) intersects nothing: whatever
//! passes through it passes through the edges that its neighbours own as well.

use robust::{Coord, Coord3D};

use crate::vec3;

/// Three corners `[x, y, z]` (m).
pub type Triangle = [[f64; 3]; 3];

/// Whether two closed triangles share at least one point. Exact; `false` where either has no area.
pub fn triangles_intersect(a: &Triangle, b: &Triangle) -> bool {
    if surely_one_side(a, b) || surely_one_side(b, a) {
        return false;
    }
    let (of_b, of_a) = (sides(a, b), sides(b, a));
    if one_side(&of_b) || one_side(&of_a) {
        return false;
    }
    if of_a == [0.0; 3] || of_b == [0.0; 3] {
        return flat_pair(a, b).is_some_and(|(a, b)| !separates(&a, &b) && !separates(&b, &a));
    }
    // Planes that intersect: the common part is a point or a segment whose ends lie on edges. An edge inside the other plane
    // needs no look of its own: its ends and whatever intersects it belong to edges that leave the plane.
    (0..3).any(|i| straddles(of_a[i], of_a[(i + 1) % 3]) && line_meets(a[i], a[(i + 1) % 3], b))
        || (0..3).any(|j| straddles(of_b[j], of_b[(j + 1) % 3]) && line_meets(b[j], b[(j + 1) % 3], a))
}

/// Whether two faces of one mesh intersect beyond what their common vertices make them share. Exact.
///
/// | common vertices (by index) | intersect when |
/// |---|---|
/// | none | they share a point, as in [`triangles_intersect`] |
/// | one | they share a second point |
/// | two | they lie in one plane on the same side of the common edge (a fold by exactly 180°) |
/// | three | always (the same triangle twice) |
///
/// Vertices at the same place with different indices are different vertices. Faces without area, with a corner that is not
/// finite or with an index out of range intersect nothing.
pub fn mesh_triangles_intersect(positions: &[[f64; 3]], face_a: [u32; 3], face_b: [u32; 3]) -> bool {
    let (Some(a), Some(b)) = (corners(positions, face_a), corners(positions, face_b)) else {
        return false;
    };
    let first_common = (0..3).find(|&i| face_b.contains(&face_a[i]));
    let Some(first) = first_common else {
        return triangles_intersect(&a, &b);
    };
    match face_a.iter().filter(|v| face_b.contains(v)).count() {
        1 => {
            let other = (0..3).find(|&j| face_b[j] == face_a[first]).unwrap_or(0);
            meet_beyond_vertex(&rotated(&a, first), &rotated(&b, other))
        }
        2 => {
            let apex = |face: [u32; 3], of: [u32; 3]| (0..3).find(|&i| !of.contains(&face[i]));
            let (Some(i), Some(j)) = (apex(face_a, face_b), apex(face_b, face_a)) else {
                return false;
            };
            // Corner 0 of each is the apex, corners 1 and 2 are the common edge.
            folded_over(&rotated(&a, i), b[j], &b)
        }
        _ => flat_axis(&a).is_some(),
    }
}

/// The segment two triangles in different planes share (m), rounded to `f64`.
///
/// `None` where they share nothing, a single point, or lie in one plane, or one of them has no area.
pub fn intersection_segment(a: &Triangle, b: &Triangle) -> Option<[[f64; 3]; 2]> {
    segment_ends(a, b).map(|ends| ends.map(|end| end.position))
}

/// One end of the segment in which two triangles intersect.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SegmentEnd {
    /// Where it is (m), rounded.
    pub position: [f64; 3],
    /// The smallest part of the first triangle that holds it, as a set of corners (bit `i` = corner `i`): one bit is a
    /// corner, two an edge, three the inside. Exact.
    pub on_a: u8,
    /// The same for the second triangle.
    pub on_b: u8,
}

/// Both ends of the common segment, with the exact parts of the triangles they lie on; `None` as in
/// [`intersection_segment`].
pub(crate) fn segment_ends(a: &Triangle, b: &Triangle) -> Option<[SegmentEnd; 2]> {
    let (of_b, of_a) = (sides(a, b), sides(b, a));
    if one_side(&of_b) || one_side(&of_a) || of_b == [0.0; 3] || of_a == [0.0; 3] {
        return None;
    }
    let mut first: Option<SegmentEnd> = None;
    for swapped in [false, true] {
        let (one, other, heights) = if swapped { (b, a, &of_b) } else { (a, b, &of_a) };
        for i in 0..3 {
            let Some((position, on_one, on_other)) = edge_intersection(one, i, heights, other) else {
                continue;
            };
            let (on_a, on_b) = if swapped { (on_other, on_one) } else { (on_one, on_other) };
            let end = SegmentEnd { position, on_a, on_b };
            match first {
                None => first = Some(end),
                // Two ends of one segment never lie on the same pair of parts.
                Some(start) if (start.on_a, start.on_b) != (on_a, on_b) => return Some([start, end]),
                Some(_) => {}
            }
        }
    }
    None
}

/// Where edge `i` of `one`, whose corners lie at `heights` over the plane of `other`, meets `other`: position, part of
/// `one`, part of `other`.
fn edge_intersection(
    one: &Triangle,
    i: usize,
    heights: &[f64; 3],
    other: &Triangle,
) -> Option<([f64; 3], u8, u8)> {
    let next = (i + 1) % 3;
    let (p, q, dp, dq) = (one[i], one[next], heights[i], heights[next]);
    if !straddles(dp, dq) {
        return None;
    }
    let along = edge_signs(p, q, other);
    if mixed(&along) {
        return None;
    }
    let on_one = (u8::from(dp == 0.0 || dq != 0.0) << i) | (u8::from(dq == 0.0 || dp != 0.0) << next);
    // On the line of edge j the point has no share of the corner opposite to it.
    let on_other = (0..3).filter(|&j| along[j] == 0.0).fold(0b111u8, |part, j| part & !(1 << ((j + 2) % 3)));
    let position = if dp == 0.0 {
        p
    } else if dq == 0.0 {
        q
    } else if let Some(corner) = (0..3).find(|&k| on_other == 1u8 << k) {
        other[corner]
    } else {
        vec3::add_scaled(p, dp / (dp - dq), vec3::sub(q, p))
    };
    Some((position, on_one, on_other))
}

/// Corners of a face; `None` for an index out of range or a corner that is not finite.
pub(crate) fn corners(positions: &[[f64; 3]], face: [u32; 3]) -> Option<Triangle> {
    let corner = |v: u32| positions.get(v as usize).copied().filter(|p| vec3::is_finite(*p));
    Some([corner(face[0])?, corner(face[1])?, corner(face[2])?])
}

/// Whether the triangle has area: exactly, its corners are not on one line.
pub(crate) fn has_area(triangle: &Triangle) -> bool {
    flat_axis(triangle).is_some()
}

/// `a` and `b` share corner 0: whether they share another point. The extreme common point seen from that corner lies on the
/// edge opposite to it in one of the two.
fn meet_beyond_vertex(a: &Triangle, b: &Triangle) -> bool {
    if surely_parted_at_corner(a, b) {
        return false;
    }
    let of_b = [side(a, b[1]), side(a, b[2])];
    if one_side(&of_b) {
        return false;
    }
    let of_a = [side(b, a[1]), side(b, a[2])];
    if one_side(&of_a) {
        return false;
    }
    if of_a == [0.0; 2] || of_b == [0.0; 2] {
        return flat_pair(a, b)
            .is_some_and(|(a, b)| segment_meets_flat(a[1], a[2], &b) || segment_meets_flat(b[1], b[2], &a));
    }
    line_meets(a[1], a[2], b) || line_meets(b[1], b[2], a)
}

/// `a` has the common edge at corners 1 and 2; `apex` is the corner of `b` off that edge.
fn folded_over(a: &Triangle, apex: [f64; 3], b: &Triangle) -> bool {
    if surely_on_both_sides(a, apex) || side(a, apex) != 0.0 {
        return false;
    }
    let (Some(axis), true) = (flat_axis(a), has_area(b)) else {
        return false;
    };
    let [own, u, v] = a.map(|p| flat(p, axis));
    let (here, there) = (turn(u, v, own), turn(u, v, flat(apex, axis)));
    (here > 0.0 && there > 0.0) || (here < 0.0 && there < 0.0)
}

fn rotated(triangle: &Triangle, first: usize) -> Triangle {
    std::array::from_fn(|k| triangle[(first + k) % 3])
}

/// Sign (and size, six times a volume) of a point's height over the plane of a triangle.
#[inline]
fn side(plane: &Triangle, p: [f64; 3]) -> f64 {
    orient(plane[0], plane[1], plane[2], p)
}

#[inline]
fn sides(plane: &Triangle, of: &Triangle) -> [f64; 3] {
    of.map(|p| side(plane, p))
}

/// Whether a triangle lies on one side of a plane beyond any rounding: most pairs end here, at a third of the price of three
/// exact signs. `false` says nothing.
#[inline]
fn surely_one_side(plane: &Triangle, of: &Triangle) -> bool {
    // A difference, two products, a difference, a product and two sums: at most 8 roundings of 2^-53 per term; 16 are taken.
    const SIDE_ROUNDING: f64 = 8.0 * f64::EPSILON;
    let (u, v) = (vec3::sub(plane[1], plane[0]), vec3::sub(plane[2], plane[0]));
    let normal = vec3::cross(u, v);
    let sizes: [f64; 3] = std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        (u[i] * v[j]).abs() + (u[j] * v[i]).abs()
    });
    let (mut above, mut below) = (true, true);
    for &p in of {
        let w = vec3::sub(p, plane[0]);
        let (height, slack) = (vec3::dot(normal, w), SIDE_ROUNDING * vec3::dot(sizes, w.map(f64::abs)));
        above &= height > slack;
        below &= height < -slack;
    }
    above || below
}

/// Whether a plane through corner 0, which `a` and `b` share, has the rest of both on different sides beyond any rounding, as at
/// most corners of a mesh. `false` says nothing.
#[inline]
fn surely_parted_at_corner(a: &Triangle, b: &Triangle) -> bool {
    // A difference, a product and two sums: at most 5 roundings of 2^-53 per term; 16 are taken.
    const CORNER_ROUNDING: f64 = 8.0 * f64::EPSILON;
    let edges = |t: &Triangle| [vec3::sub(t[1], t[0]), vec3::sub(t[2], t[0])];
    let (of_a, of_b) = (edges(a), edges(b));
    // Any normal will do; the one from the middle of b to that of a, both one long, is nearly always one that does.
    let middle = |[u, v]: [[f64; 3]; 2]| {
        let sum = vec3::add(u, v);
        vec3::scale(sum, 1.0 / vec3::norm(sum))
    };
    let normal = vec3::sub(middle(of_a), middle(of_b));
    let sizes = normal.map(f64::abs);
    let is_over = |edge: &[f64; 3], sign: f64| {
        sign * vec3::dot(normal, *edge) > CORNER_ROUNDING * vec3::dot(sizes, edge.map(f64::abs))
    };
    of_a.iter().all(|edge| is_over(edge, 1.0)) && of_b.iter().all(|edge| is_over(edge, -1.0))
}

/// Whether `apex` lies beyond the edge of `a` between corners 1 and 2, seen from corner 0 and beyond any rounding, as
/// in all of a mesh but its folds. `false` says nothing.
#[inline]
fn surely_on_both_sides(a: &Triangle, apex: [f64; 3]) -> bool {
    // The cosine between the two heights, of vectors that are each right to a few roundings.
    const FOLD_ROUNDING: f64 = 64.0 * f64::EPSILON;
    let [along, own, other] = [a[2], a[0], apex].map(|p| vec3::sub(p, a[1]));
    let product = vec3::dot(vec3::cross(own, along), vec3::cross(other, along));
    let squares = vec3::norm_squared(own) * vec3::norm_squared(other) * vec3::norm_squared(along).powi(2);
    product < 0.0 && product * product > FOLD_ROUNDING * FOLD_ROUNDING * squares && squares.is_finite()
}

#[inline]
fn orient(a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3]) -> f64 {
    let coord = |p: [f64; 3]| Coord3D { x: p[0], y: p[1], z: p[2] };
    robust::orient3d(coord(a), coord(b), coord(c), coord(d))
}

#[inline]
fn one_side(heights: &[f64]) -> bool {
    heights.iter().all(|&h| h > 0.0) || heights.iter().all(|&h| h < 0.0)
}

/// On different sides, or exactly one of them in the plane.
#[inline]
fn straddles(p: f64, q: f64) -> bool {
    (p >= 0.0 && q <= 0.0 || p <= 0.0 && q >= 0.0) && (p != 0.0 || q != 0.0)
}

#[inline]
fn mixed(signs: &[f64; 3]) -> bool {
    signs.iter().any(|&s| s > 0.0) && signs.iter().any(|&s| s < 0.0)
}

/// On which side the line `pq` passes each edge of a triangle.
#[inline]
fn edge_signs(p: [f64; 3], q: [f64; 3], triangle: &Triangle) -> [f64; 3] {
    std::array::from_fn(|j| orient(p, q, triangle[j], triangle[(j + 1) % 3]))
}

/// Whether the line `pq`, which intersects the plane of the triangle, meets the triangle.
#[inline]
fn line_meets(p: [f64; 3], q: [f64; 3], triangle: &Triangle) -> bool {
    !mixed(&edge_signs(p, q, triangle))
}

type Flat = [[f64; 2]; 3];

/// Drops one coordinate.
fn flat(p: [f64; 3], axis: usize) -> [f64; 2] {
    [p[(axis + 1) % 3], p[(axis + 2) % 3]]
}

fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let coord = |p: [f64; 2]| Coord { x: p[0], y: p[1] };
    robust::orient2d(coord(a), coord(b), coord(c))
}

/// An axis along which the triangle keeps its area; `None` where it has none.
fn flat_axis(triangle: &Triangle) -> Option<usize> {
    (0..3).find(|&axis| {
        let [a, b, c] = triangle.map(|p| flat(p, axis));
        turn(a, b, c) != 0.0
    })
}

/// Two triangles of one plane without the coordinate they can spare; `None` where one has no area.
fn flat_pair(a: &Triangle, b: &Triangle) -> Option<(Flat, Flat)> {
    let axis = flat_axis(a)?;
    has_area(b).then(|| (a.map(|p| flat(p, axis)), b.map(|p| flat(p, axis))))
}

/// Whether all `points` lie strictly beyond one edge of the triangle. Two closed convex polygons are apart exactly when an
/// edge of one of them does this.
fn separates(triangle: &Flat, points: &[[f64; 2]]) -> bool {
    let inside = turn(triangle[0], triangle[1], triangle[2]).signum();
    (0..3).any(|i| points.iter().all(|&p| turn(triangle[i], triangle[(i + 1) % 3], p) * inside < 0.0))
}

fn segment_meets_flat(p: [f64; 2], q: [f64; 2], triangle: &Flat) -> bool {
    !separates(triangle, &[p, q]) && !one_side(&triangle.map(|corner| turn(p, q, corner)))
}
