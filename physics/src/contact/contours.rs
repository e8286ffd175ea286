//! The curves in which two surfaces intersect.
//!
//! Each intersecting triangle pair gives a segment. Its ends are named by the parts of the two meshes they lie on (a vertex,
//! an edge, a face of each), decided exactly; segments are chained where the names agree, so that rounding never tears a
//! curve. Triangles that lie in one plane or share a single point give no segment.

use std::collections::{HashMap, HashSet};

use crate::query::triangle_pair::{SegmentEnd, segment_ends};
use crate::query::triangle_tree::TriangleTree;
use crate::vec3;

/// One curve of intersection.
#[derive(Debug, Clone, PartialEq)]
pub struct Contour {
    /// Whether the last point joins the first.
    pub closed: bool,
    /// Length of all its segments (m).
    pub length: f64,
}

/// Chains the segments of `pairs`, as found by [`TriangleTree::pairs_with`], into contours.
///
/// A contour is open where it leaves a surface through its boundary, or where more than two segments meet.
pub fn contours(a: &TriangleTree, b: &TriangleTree, pairs: &[(u32, u32)]) -> Vec<Contour> {
    chained(a, b, pairs, |end| end)
}

/// The same for the pairs of one mesh with itself, as found by [`TriangleTree::self_pairs`]. A contour also ends where it
/// runs into a vertex that both sheets share.
pub fn self_contours(mesh: &TriangleTree, pairs: &[(u32, u32)]) -> Vec<Contour> {
    chained(mesh, mesh, pairs, |(a, b)| (a.min(b), a.max(b)))
}

/// A vertex, edge or face by its vertices in ascending order, filled up with `u32::MAX`.
type Part = [u32; 3];
type Name = (Part, Part);

/// Points by name, and segments between them, each once.
#[derive(Default)]
struct Segments {
    numbers: HashMap<Name, usize>,
    points: Vec<[f64; 3]>,
    segments: Vec<[usize; 2]>,
    seen: HashSet<[usize; 2]>,
}

impl Segments {
    fn point(&mut self, name: Name, position: [f64; 3]) -> usize {
        let next = self.points.len();
        let number = *self.numbers.entry(name).or_insert(next);
        if number == next {
            self.points.push(position);
        }
        number
    }

    fn join(&mut self, p: usize, q: usize) {
        // An edge that lies inside a face of the other surface is found from both its faces.
        let segment = [p.min(q), p.max(q)];
        if p != q && self.seen.insert(segment) {
            self.segments.push(segment);
        }
    }
}

fn chained(
    a: &TriangleTree,
    b: &TriangleTree,
    pairs: &[(u32, u32)],
    canonical: impl Fn(Name) -> Name,
) -> Vec<Contour> {
    let mut found = Segments::default();
    for &(face_a, face_b) in pairs {
        let ends = a.triangle(face_a).zip(b.triangle(face_b)).and_then(|(a, b)| segment_ends(&a, &b));
        let Some(ends) = ends else { continue };
        let (corners_a, corners_b) = (a.face(face_a), b.face(face_b));
        let [p, q] = ends.map(|SegmentEnd { position, on_a, on_b }| {
            found.point(canonical((part(corners_a, on_a), part(corners_b, on_b))), position)
        });
        found.join(p, q);
    }
    chain(&found.points, &found.segments)
}

fn part(face: [u32; 3], corners: u8) -> Part {
    let mut part: Part = std::array::from_fn(|k| if corners >> k & 1 == 1 { face[k] } else { u32::MAX });
    part.sort_unstable();
    part
}

/// Walks every segment once: first from points where curves end or branch, then around the loops that are left.
fn chain(points: &[[f64; 3]], segments: &[[usize; 2]]) -> Vec<Contour> {
    let mut at_point: Vec<Vec<usize>> = vec![Vec::new(); points.len()];
    for (index, segment) in segments.iter().enumerate() {
        segment.iter().for_each(|&p| at_point[p].push(index));
    }
    let mut used = vec![false; segments.len()];
    let mut contours = Vec::new();
    let mut walk = |start: usize, first: usize| {
        let (mut at, mut next) = (start, Some(first));
        let mut numbers = vec![start];
        while let Some(segment) = next.filter(|&s| !std::mem::replace(&mut used[s], true)) {
            at = segments[segment][usize::from(segments[segment][0] == at)];
            numbers.push(at);
            // A point of other than two segments ends the curve.
            next = match at_point[at][..] {
                [one, other] => Some(if one == segment { other } else { one }),
                _ => None,
            };
        }
        if numbers.len() > 1 {
            let step = |ends: &[usize]| vec3::distance_squared(points[ends[0]], points[ends[1]]).sqrt();
            contours.push(Contour { closed: at == start, length: numbers.windows(2).map(step).sum() });
        }
    };
    let ends = (0..points.len()).filter(|&p| at_point[p].len() != 2);
    for start in ends.chain(0..points.len()) {
        at_point[start].iter().for_each(|&first| walk(start, first));
    }
    contours
}
