//! Signed distance to the outside of a surface whose parts intersect each other: an arm pressed into a torso.
//!
//! There the side that the nearest triangle shows is not the side of the body: a triangle of the torso inside the arm has the
//! inside of the body on both sides, and the distance signed by its normal jumps where another triangle becomes the nearest.
//! [`UnionDistance`] leaves out what is buried and takes the sign from the winding number wherever a normal could be wrong. It
//! is continuous, with slope 1 (1-Lipschitz): the unsigned distance is, and the sign changes only on the boundary of the
//! union, all of which is among the triangles that are kept.
//!
//! **What is buried.** Triangles that intersect others (exact predicates) form the seams and are kept whole;
//! they cut the rest into connected pieces, and each piece lies wholly in the boundary of the union or wholly in its inside.
//! One winding number per piece says which.

use super::ray_intersections::RayIntersections;
use super::triangle_tree::TriangleTree;
use super::{ClosestPoint, SurfacePoint};
use crate::mesh::DisjointSets;
use crate::rows::faces_at_vertices;
use crate::vec3::{self, add, add_scaled, dot, normalized, scale, sub};

/// How far outside a triangle the side of its piece is asked for (m).
const FACE_LOOK_OUT: f64 = 1e-8;
/// Rings of faces where a part of a surface ends that may intersect what does not belong to it.
const END_RINGS: usize = 2;

/// Where a face of a surface lies, seen from the union of the surface's parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaceSide {
    /// On the boundary of the union.
    Exposed,
    /// It intersects another face: partly on the boundary, partly inside.
    Seam,
    /// Inside another part.
    Buried,
}

/// Closest-point queries on the boundary of the union of a closed surface's parts.
#[derive(Debug)]
pub struct UnionDistance {
    /// On the faces that are not buried.
    kept: ClosestPoint,
    sides: Vec<FaceSide>,
    /// Whether the normals at a face and its neighbours tell the side.
    is_sure: Vec<bool>,
    all: RayIntersections,
}

impl UnionDistance {
    /// `positions` `[V, 3]` (m), `faces` `[F, 3]` of a closed surface, counter-clockwise seen from outside, with every index
    /// below `V`. On a surface with a border the winding number means nothing at it, and the distance may jump there.
    pub fn new(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Self {
        Self::of_tree(&TriangleTree::new(positions, faces))
    }

    /// The same for queries near the faces of `tree`, which may be some of its mesh: the others are never the closest, but
    /// count for what is inside.
    pub(crate) fn of_tree(tree: &TriangleTree<'_>) -> Self {
        let (positions, faces, part) = (tree.positions(), tree.all_faces(), tree.part());
        let part_faces: Vec<[u32; 3]> = part.iter().map(|&f| faces[f as usize]).collect();
        let mut intersects = vec![false; faces.len()];
        for (a, b) in tree.self_pairs() {
            intersects[a as usize] = true;
            intersects[b as usize] = true;
        }
        let is_seam: Vec<bool> = part.iter().map(|&f| intersects[f as usize]).collect();
        let is_whole = |face: &[u32; 3]| face.iter().all(|&v| vec3::is_finite(positions[v as usize]));
        let whole = faces.iter().copied().filter(is_whole).collect();
        let all = RayIntersections::new(positions.to_vec(), whole);
        let is_isolated = at_the_end(positions.len(), faces, part);
        let is_exposed = exposed(&all, &part_faces, &is_seam, &is_isolated);
        let mut is_sure_vertex = vec![true; positions.len()];
        for (face, _) in part_faces.iter().zip(&is_exposed).filter(|(_, exposed)| !**exposed) {
            face.iter().for_each(|&v| is_sure_vertex[v as usize] = false);
        }
        let is_sure = faces.iter().map(|face| face.iter().all(|&v| is_sure_vertex[v as usize])).collect();
        let mut sides = vec![FaceSide::Exposed; faces.len()];
        for ((&f, seam), exposed) in part.iter().zip(&is_seam).zip(&is_exposed) {
            sides[f as usize] = match (seam, exposed) {
                (true, _) => FaceSide::Seam,
                (false, true) => FaceSide::Exposed,
                (false, false) => FaceSide::Buried,
            };
        }
        let kept = ClosestPoint::of_tree(tree, |face| sides[face as usize] != FaceSide::Buried);
        Self { kept, sides, is_sure, all }
    }

    /// Where every face lies; faces that were left out, without area, or with a corner that is not finite, count as exposed.
    pub fn sides(&self) -> &[FaceSide] {
        &self.sides
    }

    /// How many parts `p` is inside of, on a closed surface without parts turned inside out.
    pub fn winding_number(&self, p: [f64; 3]) -> i32 {
        self.all.winding_number(p)
    }

    /// Queries on the faces that are kept.
    pub fn kept(&self) -> &ClosestPoint {
        &self.kept
    }

    /// The closest point of the kept faces, and whether `p` is inside; `None` for a query that is not finite or a surface
    /// without a face.
    pub fn project(&self, p: [f64; 3]) -> Option<(SurfacePoint, bool)> {
        let found = self.kept.project(p)?;
        Some((found, self.is_inside(p, &found)))
    }

    /// Whether `p` is inside, `found` being the closest point of the kept faces.
    pub(super) fn is_inside(&self, p: [f64; 3], found: &SurfacePoint) -> bool {
        match self.is_sure[found.face as usize] {
            true => dot(sub(p, found.position), found.normal) < 0.0,
            false => self.all.winding_number(p) >= 1,
        }
    }
}

/// Which faces of a `part` are where it ends. What they intersect may not belong to it, so that they do not decide their
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
/// `isolated` are asked one by one.
fn exposed(all: &RayIntersections, faces: &[[u32; 3]], is_seam: &[bool], is_isolated: &[bool]) -> Vec<bool> {
    let at_vertex = faces_at_vertices(all.positions().len(), faces, 0..faces.len() as u32);
    let mut pieces = DisjointSets::new(faces.len());
    let is_joined = |f: u32| !is_seam[f as usize] && !is_isolated[f as usize];
    for (f, [a, b, c]) in (0u32..).zip(faces).filter(|(f, _)| is_joined(*f)) {
        for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
            let beside = at_vertex.row(from as usize).iter().filter(|&&g| g > f && is_joined(g));
            beside.filter(|&&g| faces[g as usize].contains(&to)).for_each(|&g| pieces.join(f, g));
        }
    }
    let roots: Vec<u32> = (0..faces.len() as u32).map(|f| pieces.root(f)).collect();
    // The side is asked at the largest face of each piece, where rounding matters least.
    let areas: Vec<f64> = faces.iter().map(|face| vec3::norm_squared(all.normal(*face))).collect();
    let mut largest: Vec<usize> = (0..faces.len()).collect();
    for f in 0..faces.len() {
        let at = &mut largest[roots[f] as usize];
        if areas[f] > areas[*at] {
            *at = f;
        }
    }
    let is_exposed_piece: Vec<bool> = (0..faces.len())
        .map(|piece| {
            if roots[piece] as usize != piece || is_seam[piece] {
                return false;
            }
            let face = faces[largest[piece]];
            let [a, b, c] = all.corners(face);
            let centre = scale(add(add(a, b), c), 1.0 / 3.0);
            let before = add_scaled(centre, FACE_LOOK_OUT, normalized(all.normal(face)));
            all.winding_number(before) == 0
        })
        .collect();
    roots.iter().map(|&piece| is_exposed_piece[piece as usize]).collect()
}

#[cfg(test)]
mod tests;
