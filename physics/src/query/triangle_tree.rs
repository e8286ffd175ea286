//! Which triangles of two meshes, or of one mesh with itself, intersect: a bounding-volume tree proposes, exact predicates
//! decide.

use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode, BvhWorkspace};
use rayon::prelude::*;

use super::triangle_pair::{Triangle, corners, has_area, mesh_triangles_intersect, triangles_intersect};
use super::triangle_point::{box_distance_squared, closest_on_triangle};

/// A mesh in a state, ready for intersection tests: positions `[V, 3]` (m), faces `[F, 3]`, and a tree over the faces.
///
/// Faces that are no triangle take part in nothing: an index out of range, a corner that is not finite, or no area (corners
/// exactly on one line, such as repeated positions).
#[derive(Debug)]
pub struct TriangleTree<'a> {
    positions: &'a [[f64; 3]],
    faces: &'a [[u32; 3]],
    bvh: Bvh,
    /// Leaf of the tree → face.
    kept: Vec<u32>,
}

/// The tree of a [`TriangleTree`] without the mesh, to be kept while that moves.
#[derive(Default)]
pub(crate) struct KeptTree {
    bvh: Bvh,
    kept: Vec<u32>,
}

impl<'a> TriangleTree<'a> {
    /// Builds the tree in O(F log F).
    pub fn new(positions: &'a [[f64; 3]], faces: &'a [[u32; 3]]) -> Self {
        Self::of_part(positions, faces, |_, _| true)
    }

    /// Of some of the faces, which keep their numbers.
    pub(crate) fn of_part(
        positions: &'a [[f64; 3]],
        faces: &'a [[u32; 3]],
        is_part: impl Fn(u32, &Aabb) -> bool,
    ) -> Self {
        let (kept, boxes): (Vec<u32>, Vec<Aabb>) = triangle_boxes(positions, faces)
            .into_iter()
            .filter(|(face, bounds)| is_part(*face, bounds))
            .unzip();
        Self { positions, faces, bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes), kept }
    }

    /// As [`new`](Self::new), with the tree of the same faces elsewhere, whose boxes are fitted anew in O(F): for meshes that are
    /// still in about the same shape. Pairs are the same.
    pub(crate) fn refitted(tree: KeptTree, positions: &'a [[f64; 3]], faces: &'a [[u32; 3]]) -> Self {
        let KeptTree { mut bvh, kept } = tree;
        let boxes = triangle_boxes(positions, faces);
        if !boxes.iter().map(|(face, _)| face).eq(&kept) {
            return Self::new(positions, faces);
        }
        for (leaf, (_, bounds)) in (0..).zip(boxes) {
            bvh.insert_or_update_partially(bounds, leaf, 0.0);
        }
        bvh.refit_without_opt();
        Self { positions, faces, bvh, kept }
    }

    /// The tree alone, for [`refitted`](Self::refitted).
    pub(crate) fn into_kept(self) -> KeptTree {
        KeptTree { bvh: self.bvh, kept: self.kept }
    }

    /// Positions of the mesh, `[V, 3]` (m).
    pub(crate) fn positions(&self) -> &'a [[f64; 3]] {
        self.positions
    }

    /// All faces of the mesh, `[F, 3]`.
    pub(crate) fn all_faces(&self) -> &'a [[u32; 3]] {
        self.faces
    }

    /// The bounding volumes; leaf `i` is face `part()[i]`.
    pub(crate) fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// The faces that take part, ascending.
    pub(crate) fn part(&self) -> &[u32] {
        &self.kept
    }

    /// Faces that take part in nothing.
    pub fn skipped(&self) -> usize {
        self.faces.len() - self.kept.len()
    }

    /// Pairs (face of `self`, face of `other`) that share a point, in ascending order. The meshes are taken for strangers:
    /// equal indices mean nothing.
    pub fn pairs_with(&self, other: &TriangleTree) -> Vec<(u32, u32)> {
        if self.bvh.is_empty() || other.bvh.is_empty() {
            return Vec::new();
        }
        let candidates = self
            .bvh
            .leaf_pairs(&other.bvh, |a, b| a.intersects(b))
            .map(|(a, b)| (self.kept[a as usize], other.kept[b as usize]));
        decided(candidates.collect(), |(a, b)| {
            self.triangle(a).zip(other.triangle(b)).is_some_and(|(a, b)| triangles_intersect(&a, &b))
        })
    }

    /// Pairs (face of another mesh, face of this one that is `asked` for) that share a point, for some `faces` of the other mesh
    /// with `positions` and `all_faces`; in ascending order.
    pub(crate) fn pairs_of_faces(
        &self,
        positions: &[[f64; 3]],
        all_faces: &[[u32; 3]],
        faces: &[u32],
        asked: impl Fn(u32) -> bool + Copy + Sync,
    ) -> Vec<(u32, u32)> {
        if self.bvh.is_empty() {
            return Vec::new();
        }
        sorted_pairs(faces, |f| {
            let triangle = corners(positions, all_faces[f as usize]).filter(has_area);
            triangle.into_iter().flat_map(move |a| {
                let meets = move |g: &u32| {
                    asked(*g) && self.triangle(*g).is_some_and(|b| triangles_intersect(&a, &b))
                };
                self.faces_meeting(triangle_box(a)).filter(meets).map(move |g| (f, g))
            })
        })
    }

    /// Pairs of different faces of this mesh, smaller index first, that intersect beyond the vertices they share (see
    /// [`mesh_triangles_intersect`]), in ascending order.
    pub fn self_pairs(&self) -> Vec<(u32, u32)> {
        let mut candidates = Vec::new();
        self.bvh.traverse_bvtt_single_tree::<false>(&mut BvhWorkspace::default(), &mut |a, b| {
            let (a, b) = (self.kept[a as usize], self.kept[b as usize]);
            candidates.push((a.min(b), a.max(b)));
        });
        decided(candidates, |(a, b)| mesh_triangles_intersect(self.positions, self.face(a), self.face(b)))
    }

    /// Those of [`self_pairs`](Self::self_pairs) in which one of `faces` takes part.
    pub(crate) fn self_pairs_of_faces(&self, faces: &[u32]) -> Vec<(u32, u32)> {
        if self.bvh.is_empty() {
            return Vec::new();
        }
        let mut takes_part = vec![false; self.faces.len()];
        faces.iter().for_each(|&f| takes_part[f as usize] = true);
        let takes_part = &takes_part;
        sorted_pairs(faces, |f| {
            // Two of them meet once, seen from the smaller one.
            let meets = move |g: &u32| {
                (f < *g || f > *g && !takes_part[*g as usize])
                    && mesh_triangles_intersect(self.positions, self.face(f), self.face(*g))
            };
            let triangle = self.triangle(f).filter(has_area);
            let near = triangle.into_iter().flat_map(|a| self.faces_meeting(triangle_box(a)));
            near.filter(meets).map(move |g| (f.min(g), f.max(g)))
        })
    }

    /// Faces whose box meets the box from `low` to `high`, in no particular order.
    pub(crate) fn faces_in_box(&self, (low, high): ([f64; 3], [f64; 3])) -> impl Iterator<Item = u32> {
        self.faces_meeting(Aabb::new(Vector::from_array(low), Vector::from_array(high)))
    }

    fn faces_meeting(&self, bounds: Aabb) -> impl Iterator<Item = u32> {
        let probe = BvhNode::leaf(bounds, 0);
        self.bvh.leaves(move |node| node.intersects(&probe)).map(|leaf| self.kept[leaf as usize])
    }

    /// How far `p` is from the nearest of the faces that `may_be`, if that is nearer than `reach`.
    pub(crate) fn nearest(
        &self,
        p: [f64; 3],
        reach: f64,
        may_be: impl Fn(u32, &Triangle) -> bool,
    ) -> Option<f64> {
        let distance_squared = |leaf: u32| {
            let face = self.kept[leaf as usize];
            let triangle = self.triangle(face).filter(|triangle| may_be(face, triangle))?;
            Some(closest_on_triangle(p, triangle).distance_squared)
        };
        let (_, nearest) = self.bvh.find_best(
            reach * reach,
            |node, _| box_distance_squared(p, node.mins().to_array(), node.maxs().to_array()),
            |leaf, _| distance_squared(leaf),
        )?;
        Some(nearest.sqrt())
    }

    /// Corner indices of a face of the tree.
    pub(crate) fn face(&self, face: u32) -> [u32; 3] {
        self.faces.get(face as usize).copied().unwrap_or([u32::MAX; 3])
    }

    /// Corners of a face of the tree.
    pub(crate) fn triangle(&self, face: u32) -> Option<Triangle> {
        corners(self.positions, self.face(face))
    }
}

/// Pairs (face of `a`, face of `b`) that share a point, in ascending order; the same for any number of threads.
///
/// Positions in metres; see [`TriangleTree`] for faces that are left out, and for a tree to keep where one mesh meets several.
/// Give the smaller mesh first: only the part of the second within its box is looked at.
pub fn triangle_pairs(
    a_positions: &[[f64; 3]],
    a_faces: &[[u32; 3]],
    b_positions: &[[f64; 3]],
    b_faces: &[[u32; 3]],
) -> Vec<(u32, u32)> {
    // A garment covers part of a body: the rest of the body needs no tree, and the garment, asked once, needs none at all.
    let boxes = triangle_boxes(a_positions, a_faces);
    let Some(region) = boxes.iter().map(|(_, bounds)| *bounds).reduce(|a, b| a.merged(&b)) else {
        return Vec::new();
    };
    let b = TriangleTree::of_part(b_positions, b_faces, |_, bounds| region.intersects(bounds));
    let faces: Vec<u32> = boxes.into_iter().map(|(face, _)| face).collect();
    b.pairs_of_faces(a_positions, a_faces, &faces, |_| true)
}

/// Pairs of faces of one mesh that intersect beyond the vertices they share: [`TriangleTree::self_pairs`].
pub fn self_triangle_pairs(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<(u32, u32)> {
    TriangleTree::new(positions, faces).self_pairs()
}

/// Every face that is a triangle, with its box.
fn triangle_boxes(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<(u32, Aabb)> {
    let bounds = |face: [u32; 3]| Some(triangle_box(corners(positions, face).filter(has_area)?));
    (0u32..).zip(faces).filter_map(|(index, &face)| Some((index, bounds(face)?))).collect()
}

/// The smallest box around a triangle.
pub(super) fn triangle_box(triangle: Triangle) -> Aabb {
    let [a, b, c] = triangle.map(Vector::from_array);
    Aabb::new(a.min(b).min(c), a.max(b).max(c))
}

/// The pairs `found` for some faces, in ascending order.
fn sorted_pairs<I: Iterator<Item = (u32, u32)>>(
    faces: &[u32],
    found: impl Fn(u32) -> I + Sync,
) -> Vec<(u32, u32)> {
    let mut pairs: Vec<(u32, u32)> =
        faces.par_iter().with_min_len(256).flat_map_iter(|&f| found(f)).collect();
    pairs.sort_unstable();
    pairs
}

/// Those of `candidates` that `intersect`, in ascending order.
fn decided(candidates: Vec<(u32, u32)>, intersect: impl Fn((u32, u32)) -> bool + Sync) -> Vec<(u32, u32)> {
    let mut pairs: Vec<(u32, u32)> =
        candidates.into_par_iter().with_min_len(1024).filter(|&pair| intersect(pair)).collect();
    pairs.sort_unstable();
    pairs
}
