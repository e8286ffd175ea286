//! Closest point on a triangle surface with its pseudo-normal, on a bounding-volume tree.
//!
//! The angle-weighted pseudo-normal gives the right sign of the distance wherever the closest point lies: inside a face, on
//! an edge or at a vertex (Bærentzen and Aanæs, "Signed distance computation using the angle weighted pseudonormal", IEEE
//! TVCG 2005). All of it is `f64`, whatever the caller's scalar: the sign must not depend on rounding.

use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};

use super::pseudo_normal::PseudoNormals;
use super::triangle_point::{Feature, TrianglePoint, box_distance_squared, closest_on_triangle};
use super::triangle_tree::{TriangleTree, triangle_box};
use crate::rows::{CompressedRows, faces_at_vertices};
use crate::vec3;

/// The point of a surface closest to a query point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Where it is (m).
    pub position: [f64; 3],
    /// Squared distance from the query point (m²).
    pub distance_squared: f64,
    /// The face it lies on, as numbered in what the query was built of; one of them when it lies on an edge or a vertex.
    pub face: u32,
    /// Barycentric coordinates in that face; non-negative, sum 1.
    pub barycentric: [f64; 3],
    /// Part of that face it lies on.
    pub feature: Feature,
    /// Unit pseudo-normal of the feature it lies on; zero where every incident face has no area.
    pub normal: [f64; 3],
}

/// Below this distance (m) the direction from the closest point is rounding, and the pseudo-normal replaces it.
const TOUCHING_DISTANCE: f64 = 1e-10;

impl SurfacePoint {
    /// Whether `p`, the point that it is closest to, lies behind its pseudo-normal.
    pub(crate) fn is_behind(&self, p: [f64; 3]) -> bool {
        vec3::dot(vec3::sub(p, self.position), self.normal) < 0.0
    }

    /// The distance of `p`, the point that it is closest to, negative where that `is_inside` (m), and its derivative by `p`.
    pub(crate) fn signed(&self, p: [f64; 3], is_inside: bool) -> (f64, [f64; 3]) {
        let length = self.distance_squared.sqrt();
        let sign = if is_inside { -1.0 } else { 1.0 };
        let direction = match length > TOUCHING_DISTANCE {
            true => vec3::scale(vec3::sub(p, self.position), sign / length),
            false => self.normal,
        };
        (sign * length, direction)
    }
}

/// Accelerated closest-point queries on one fixed surface.
#[derive(Debug)]
pub struct ClosestPoint {
    positions: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
    bvh: Bvh,
    /// Leaf of the tree → face; none for one that is never closest.
    leaves: Vec<Option<u32>>,
    at_vertex: CompressedRows<u32>,
}

impl ClosestPoint {
    /// Builds the tree. `positions` `[V, 3]` (m), `faces` `[F, 3]` with every index below `V`.
    ///
    /// Faces with a corner that is not finite are left out: nothing is ever closest to them.
    pub fn new(positions: Vec<[f64; 3]>, faces: &[[u32; 3]]) -> Self {
        let is_whole = |face: &[u32; 3]| face.iter().all(|&v| vec3::is_finite(positions[v as usize]));
        let whole = || (0u32..).zip(faces).filter(|(_, face)| is_whole(face));
        let boxes: Vec<Aabb> =
            whole().map(|(_, face)| triangle_box(face.map(|v| positions[v as usize]))).collect();
        let bvh = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        let leaves = whole().map(|(number, _)| Some(number)).collect();
        Self::on_tree(positions, faces.to_vec(), bvh, leaves)
    }

    /// On a tree that is there already, of its faces that `may_be` closest. Faces without area are not.
    pub(crate) fn of_tree(tree: &TriangleTree<'_>, may_be: impl Fn(u32) -> bool) -> Self {
        let leaves = tree.part().iter().map(|&face| may_be(face).then_some(face)).collect();
        Self::on_tree(tree.positions().to_vec(), tree.all_faces().to_vec(), tree.bvh().clone(), leaves)
    }

    fn on_tree(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>, bvh: Bvh, leaves: Vec<Option<u32>>) -> Self {
        let at_vertex = faces_at_vertices(positions.len(), &faces, leaves.iter().flatten().copied());
        Self { positions, faces, bvh, leaves, at_vertex }
    }

    /// The closest point of the surface; `None` for a query that is not finite or a surface without a face.
    pub fn project(&self, p: [f64; 3]) -> Option<SurfacePoint> {
        self.project_within(p, f64::INFINITY)
    }

    /// The same, if it is closer than `reach` (m).
    pub fn project_within(&self, p: [f64; 3], reach: f64) -> Option<SurfacePoint> {
        if !vec3::is_finite(p) {
            return None;
        }
        let (leaf, _) = self.bvh.find_best(
            (reach * reach).min(f64::MAX),
            |node, _| box_distance_squared(p, node.mins().to_array(), node.maxs().to_array()),
            |leaf, _| {
                let face = self.leaves[leaf as usize]?;
                Some(closest_on_triangle(p, self.corners(face)).distance_squared)
            },
        )?;
        let face = self.leaves[leaf as usize]?;
        Some(self.surface_point(face, self.on_face(face, p)))
    }

    /// Whether there is no face to be closest to.
    pub(super) fn is_empty(&self) -> bool {
        self.leaves.iter().all(Option::is_none)
    }

    /// What was `found` on a face, with its pseudo-normal.
    pub(super) fn surface_point(&self, face: u32, found: TrianglePoint) -> SurfacePoint {
        SurfacePoint {
            position: found.position,
            distance_squared: found.distance_squared,
            face,
            barycentric: found.barycentric,
            feature: found.feature,
            normal: self.feature_normal(face, found.feature),
        }
    }

    /// The point of a face closest to `p`.
    pub(super) fn on_face(&self, face: u32, p: [f64; 3]) -> TrianglePoint {
        closest_on_triangle(p, self.corners(face))
    }

    /// The faces at most `reach` (m) away from `p`, with their distances, in no particular order.
    pub(super) fn faces_within(&self, p: [f64; 3], reach: f64) -> Vec<(f64, u32)> {
        let is_near = |node: &BvhNode| {
            box_distance_squared(p, node.mins().to_array(), node.maxs().to_array()) <= reach * reach
        };
        let near = self.bvh.leaves(is_near).filter_map(|leaf| self.leaves[leaf as usize]);
        near.map(|face| (self.on_face(face, p).distance_squared.sqrt(), face))
            .filter(|(d, _)| *d <= reach)
            .collect()
    }

    /// Vertex indices of a face as numbered in [`SurfacePoint::face`].
    pub fn face(&self, face: u32) -> [u32; 3] {
        self.faces[face as usize]
    }

    pub(crate) fn corners(&self, face: u32) -> [[f64; 3]; 3] {
        self.faces[face as usize].map(|v| self.positions[v as usize])
    }

    fn feature_normal(&self, face: u32, feature: Feature) -> [f64; 3] {
        let Self { positions, faces, at_vertex, .. } = self;
        let normals = PseudoNormals { positions, faces, at_vertex };
        normals.at(face, feature)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;
    use crate::mesh::shapes::{self, SplitMix};
    use crate::query::brute_force;

    /// A closed surface with sharp convex and concave edges: vertex and edge signs need the pseudo-normal here.
    fn spiky() -> TriMesh {
        let sphere = shapes::icosphere(0.5, 2);
        let mut at = 0usize;
        let positions = sphere
            .positions()
            .iter()
            .map(|p| {
                at += 1;
                vec3::scale(*p, if at.is_multiple_of(3) { 1.7 } else { 0.7 })
            })
            .collect();
        sphere.with_positions(positions).unwrap()
    }

    #[test]
    fn distance_equals_brute_force() {
        for mesh in [spiky(), shapes::tube(0.3, 0.8, 14, 9), shapes::irregular_grid(1.0, 1.0, 9, 9, 0.4, 3)] {
            let closest = ClosestPoint::new(mesh.positions().to_vec(), mesh.faces());
            for p in SplitMix::new(7).points(300, 1.0) {
                let found = closest.project(p).unwrap();
                let expected = brute_force::distance_to_surface(mesh.positions(), mesh.faces(), p);
                assert!((found.distance_squared.sqrt() - expected).abs() < 1e-12);
                // The barycentric coordinates are those of the position.
                let corners = closest.face(found.face).map(|v| mesh.positions()[v as usize]);
                let rebuilt =
                    (0..3).fold([0.0; 3], |sum, k| vec3::add_scaled(sum, found.barycentric[k], corners[k]));
                assert!(vec3::distance_squared(rebuilt, found.position) < 1e-24);
                assert!((found.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                assert!(found.barycentric.iter().all(|&w| w >= -1e-12));
            }
        }
    }

    #[test]
    fn sign_agrees_with_the_winding_number_on_a_spiky_closed_surface() {
        let mesh = spiky();
        let closest = ClosestPoint::new(mesh.positions().to_vec(), mesh.faces());
        let mut inside_count = 0;
        for p in SplitMix::new(4).points(2000, 0.9) {
            let found = closest.project(p).unwrap();
            let inside = brute_force::winding_number(mesh.positions(), mesh.faces(), p) > 0.5;
            let below = vec3::dot(vec3::sub(p, found.position), found.normal) < 0.0;
            assert_eq!(below, inside, "at {p:?}");
            inside_count += usize::from(inside);
        }
        assert!((100..1900).contains(&inside_count));
    }

    #[test]
    fn surfaces_with_broken_parts_still_answer() {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3], [0.0; 3], [f64::NAN; 3]];
        let closest = ClosestPoint::new(positions, &[[0, 3, 4], [0, 1, 5], [0, 1, 2]]);
        let found = closest.project([0.2, 0.2, -0.3]).unwrap();
        assert!((found.distance_squared.sqrt() - 0.3).abs() < 1e-12);
        assert_eq!(closest.face(found.face), [0, 1, 2]);
        assert_eq!(closest.project([f64::NAN, 0.0, 0.0]), None);
        assert!(ClosestPoint::new(vec![[0.0; 3]], &[]).project([0.0; 3]).is_none());
    }
}
