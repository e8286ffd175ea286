//! Signed distance to the outside of a surface whose parts intersect each other: an arm pressed into a torso.
//!
//! There the side that the nearest triangle shows is not the side of the body: a triangle of the torso inside the arm has the
//! inside of the body on both sides, and the distance signed by its normal jumps where another triangle becomes the nearest.
//! [`UnionDistance`] leaves out what is buried and takes the sign from the winding number wherever a normal could be wrong. It
//! is continuous, with slope 1 (1-Lipschitz): the unsigned distance is, and the sign changes only on the boundary of the
//! union, all of which is among the triangles that are kept.
//!
//! **What is buried.** Triangles that intersect others (exact predicates, [`crate::contact`]) form the seams and are kept whole;
//! they cut the rest into connected pieces, and each piece lies wholly in the boundary of the union or wholly in its inside.
//! One winding number per piece says which.

use std::sync::OnceLock;

use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};

use super::closest_point::triangle_box;
use super::{ClosestPoint, SurfacePoint};
use crate::contact::self_triangle_pairs;
use crate::mesh::FacesAtVertex;
use crate::vec3::{self, add, add_scaled, cross, dot, normalized, scale, sub};

/// How far outside a triangle the side of its piece is asked for [m].
const LOOK_OUT: f64 = 1e-8;
/// Questions that are asked of all faces instead of a tree.
const FEW: usize = 64;
/// Rings of faces where a part of a surface ends that may cross what does not belong to it.
const END_RINGS: usize = 2;

/// Where a face of a surface lies, seen from the union of the surface's parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaceSide {
    /// On the boundary of the union.
    Exposed,
    /// It crosses another face: partly on the boundary, partly inside.
    Seam,
    /// Inside another part.
    Buried,
}

/// Closest-point queries on the boundary of the union of a closed surface's parts.
#[derive(Debug)]
pub struct UnionDistance {
    /// Built at first use.
    kept: OnceLock<ClosestPoint>,
    kept_corners: Vec<[u32; 3]>,
    /// Kept face → face.
    kept_faces: Vec<u32>,
    sides: Vec<FaceSide>,
    /// Whether the normals at a kept face and its neighbours tell the side.
    is_sure: Vec<bool>,
    all: Crossings,
    buried: usize,
}

impl UnionDistance {
    /// `positions` `[V, 3]` (m), `faces` `[F, 3]` of a closed surface, counter-clockwise seen from outside, with every index
    /// below `V`. On a surface with a border the winding number means nothing at it, and the distance may jump there.
    pub fn new(positions: Vec<[f64; 3]>, faces: &[[u32; 3]]) -> Self {
        let seams = self_triangle_pairs(&positions, faces);
        Self::of_part(positions, faces, |_| true, &seams)
    }

    /// The same for queries near some of the faces only: the others are never the closest, but count for what is inside.
    /// `seams`: the pairs of those faces that intersect, as [`self_triangle_pairs`] finds them.
    pub fn of_part(
        positions: Vec<[f64; 3]>,
        faces: &[[u32; 3]],
        is_part: impl Fn(u32) -> bool,
        seams: &[(u32, u32)],
    ) -> Self {
        // As ClosestPoint does.
        let is_whole = |face: &[u32; 3]| face.iter().all(|&v| vec3::is_finite(positions[v as usize]));
        let part: Vec<u32> =
            (0..faces.len() as u32).filter(|&f| is_part(f) && is_whole(&faces[f as usize])).collect();
        let part_faces: Vec<[u32; 3]> = part.iter().map(|&f| faces[f as usize]).collect();
        let mut crosses = vec![false; faces.len()];
        for &(a, b) in seams {
            crosses[a as usize] = true;
            crosses[b as usize] = true;
        }
        let is_seam: Vec<bool> = part.iter().map(|&f| crosses[f as usize]).collect();
        let whole = faces.iter().filter(|face| is_whole(face)).copied().collect();
        let all = Crossings::new(positions, whole);
        let is_alone = at_the_end(all.positions.len(), faces, &part);
        let is_exposed = exposed(&all, &part_faces, &is_seam, &is_alone);
        let mut is_sure_vertex = vec![true; all.positions.len()];
        for (face, _) in part_faces.iter().zip(&is_exposed).filter(|(_, exposed)| !**exposed) {
            face.iter().for_each(|&v| is_sure_vertex[v as usize] = false);
        }
        let mut sides = vec![FaceSide::Exposed; faces.len()];
        for ((&f, seam), exposed) in part.iter().zip(&is_seam).zip(&is_exposed) {
            sides[f as usize] = match (seam, exposed) {
                (true, _) => FaceSide::Seam,
                (false, true) => FaceSide::Exposed,
                (false, false) => FaceSide::Buried,
            };
        }
        let kept_faces: Vec<u32> =
            part.iter().copied().filter(|&f| sides[f as usize] != FaceSide::Buried).collect();
        let kept: Vec<[u32; 3]> = kept_faces.iter().map(|&f| faces[f as usize]).collect();
        let is_sure = kept.iter().map(|face| face.iter().all(|&v| is_sure_vertex[v as usize])).collect();
        let buried = part.len() - kept.len();
        Self { kept: OnceLock::new(), kept_corners: kept, kept_faces, sides, is_sure, all, buried }
    }

    /// Faces that lie in the inside of the union.
    pub fn buried(&self) -> usize {
        self.buried
    }

    /// Where every face lies; faces that were left out, or with a corner that is not finite, count as exposed.
    pub fn sides(&self) -> &[FaceSide] {
        &self.sides
    }

    /// The face that [`SurfacePoint::face`] of [`project`](Self::project) means.
    pub fn kept_face(&self, face: u32) -> u32 {
        self.kept_faces[face as usize]
    }

    /// How many parts `p` is inside of, on a closed surface without parts turned inside out.
    pub fn winding_number(&self, p: [f64; 3]) -> i32 {
        self.all.winding_number(p)
    }

    /// Queries on the faces that are kept.
    pub fn kept(&self) -> &ClosestPoint {
        self.kept.get_or_init(|| ClosestPoint::new(self.all.positions.clone(), &self.kept_corners))
    }

    /// The closest point of the kept faces, and whether `p` is inside; `None` for a query that is not finite or a surface
    /// without a face.
    pub fn project(&self, p: [f64; 3]) -> Option<(SurfacePoint, bool)> {
        let found = self.kept().project(p)?;
        let is_inside = match self.is_sure[found.face as usize] {
            true => dot(sub(p, found.position), found.normal) < 0.0,
            false => self.all.winding_number(p) >= 1,
        };
        Some((found, is_inside))
    }
}

/// Which faces of a `part` are where it ends. What they cross may not belong to it, so that they do not tell of their
/// neighbours' side.
fn at_the_end(vertices: usize, faces: &[[u32; 3]], part: &[u32]) -> Vec<bool> {
    if part.len() == faces.len() {
        return vec![false; part.len()];
    }
    let mut is_inner: Vec<bool> = vec![false; faces.len()];
    part.iter().for_each(|&f| is_inner[f as usize] = true);
    for _ in 0..END_RINGS {
        let mut touched = vec![false; vertices];
        for (face, _) in faces.iter().zip(&is_inner).filter(|(_, is_inner)| !**is_inner) {
            face.iter().for_each(|&v| touched[v as usize] = true);
        }
        for (face, is_inner) in faces.iter().zip(&mut is_inner) {
            *is_inner &= !face.iter().any(|&v| touched[v as usize]);
        }
    }
    part.iter().map(|&f| !is_inner[f as usize]).collect()
}

/// Which of some faces that are no seam have the outside of the union before them and its inside behind them. Those that are
/// `alone` are asked one by one.
fn exposed(all: &Crossings, faces: &[[u32; 3]], is_seam: &[bool], is_alone: &[bool]) -> Vec<bool> {
    let at_vertex = FacesAtVertex::new(all.positions.len(), faces);
    let mut root: Vec<u32> = (0..faces.len() as u32).collect();
    let is_joined = |f: u32| !is_seam[f as usize] && !is_alone[f as usize];
    for (f, [a, b, c]) in (0u32..).zip(faces).filter(|(f, _)| is_joined(*f)) {
        for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
            let beside = at_vertex.of(from).iter().filter(|&&g| g > f && is_joined(g));
            for &g in beside.filter(|&&g| faces[g as usize].contains(&to)) {
                let (one, other) = (find(&mut root, f), find(&mut root, g));
                root[one.max(other) as usize] = one.min(other);
            }
        }
    }
    let roots: Vec<u32> = (0..faces.len() as u32).map(|f| find(&mut root, f)).collect();
    // The side is asked at the largest face of each piece, where rounding matters least.
    let areas: Vec<f64> = faces.iter().map(|face| vec3::norm_squared(all.normal(*face))).collect();
    let mut largest: Vec<usize> = (0..faces.len()).collect();
    for f in 0..faces.len() {
        let at = &mut largest[roots[f] as usize];
        if areas[f] > areas[*at] {
            *at = f;
        }
    }
    let pieces = (0..faces.len()).filter(|&f| roots[f] as usize == f && !is_seam[f]).count();
    let is_exposed_piece: Vec<bool> = (0..faces.len())
        .map(|piece| {
            if roots[piece] as usize != piece || is_seam[piece] {
                return false;
            }
            let face = faces[largest[piece]];
            let [a, b, c] = all.corners(face);
            let centre = scale(add(add(a, b), c), 1.0 / 3.0);
            let before = add_scaled(centre, LOOK_OUT, normalized(all.normal(face)));
            // A tree is not worth building for a few questions.
            let number = match pieces <= FEW {
                true => all.winding_number_of_all(before),
                false => all.winding_number(before),
            };
            number == 0
        })
        .collect();
    roots.iter().map(|&piece| is_exposed_piece[piece as usize]).collect()
}

/// The representative of a face's piece.
fn find(root: &mut [u32], mut face: u32) -> u32 {
    while root[face as usize] != face {
        root[face as usize] = root[root[face as usize] as usize];
        face = root[face as usize];
    }
    face
}

/// Winding numbers of a closed surface, by the faces that a ray along +x crosses.
///
/// Which faces it crosses is decided edge by edge, each with the same numbers from both of its faces: on a closed surface no
/// crossing is missed or counted twice, whatever the rounding.
struct Crossings {
    positions: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
    /// Built at first use.
    bvh: OnceLock<Bvh>,
}

impl std::fmt::Debug for Crossings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Crossings").field("faces", &self.faces.len()).finish_non_exhaustive()
    }
}

impl Crossings {
    fn new(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Self {
        Self { positions, faces, bvh: OnceLock::new() }
    }

    fn corners(&self, face: [u32; 3]) -> [[f64; 3]; 3] {
        face.map(|v| self.positions[v as usize])
    }

    /// Normal, twice the area long.
    fn normal(&self, face: [u32; 3]) -> [f64; 3] {
        let [a, b, c] = self.corners(face);
        cross(sub(b, a), sub(c, a))
    }

    fn winding_number(&self, p: [f64; 3]) -> i32 {
        let bvh = self.bvh.get_or_init(|| {
            let boxes: Vec<_> = self.faces.iter().map(|face| triangle_box(self.corners(*face))).collect();
            Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes)
        });
        let meets = |low: [f64; 3], high: [f64; 3]| {
            high[0] >= p[0] && (1..3).all(|k| low[k] <= p[k] && p[k] <= high[k])
        };
        let leaves = bvh.leaves(|node| meets(node.mins().to_array(), node.maxs().to_array()));
        leaves.map(|face| self.crossing(self.faces[face as usize], p)).sum()
    }

    /// The same without a tree.
    fn winding_number_of_all(&self, p: [f64; 3]) -> i32 {
        self.faces.iter().map(|face| self.crossing(*face, p)).sum()
    }

    /// 1 where the ray from `p` leaves through `face`, −1 where it enters, 0 where it misses.
    fn crossing(&self, face: [u32; 3], p: [f64; 3]) -> i32 {
        let corners = self.corners(face);
        // The winding number of the projected triangle: its edges past y = p.y, seen from p.
        let turns: i32 = (0..3)
            .map(|e| {
                let (a, b) = (corners[e], corners[(e + 1) % 3]);
                match (a[1] <= p[1], b[1] <= p[1]) {
                    (true, false) => i32::from(is_left(a, b, p)),
                    (false, true) => -i32::from(is_left(b, a, p)),
                    _ => 0,
                }
            })
            .sum();
        if turns == 0 {
            return 0;
        }
        let normal = self.normal(face);
        let ahead = dot(normal, sub(corners[0], p)) * normal[0] > 0.0;
        if ahead { turns } else { 0 }
    }
}

/// Whether `p` lies left of the line from `a` to `b` in the plane of y and z.
fn is_left(a: [f64; 3], b: [f64; 3], p: [f64; 3]) -> bool {
    (b[1] - a[1]) * (p[2] - a[2]) - (p[1] - a[1]) * (b[2] - a[2]) > 0.0
}

#[cfg(test)]
mod tests;
