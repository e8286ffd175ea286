//! A posed surface that other things keep their distance from.

use std::sync::{Arc, OnceLock};

use crate::mesh::{TriMesh, is_closed, vertex_normals};
use crate::query::near_faces::NearFaces;
use crate::query::{ClosestPoint, SurfacePoint, UnionDistance, VertexIndex};
use crate::real::Real;
use crate::vec3;

/// How the signed distance to a surface is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Distance {
    /// `(p − x_b)·n_b` with the nearest vertex `b` and its area-weighted normal: the paper's form. Cheap; its sign can be
    /// wrong where vertices are sparse against the curvature.
    #[default]
    NearestVertex,
    /// The distance to the closest surface point, signed by the angle-weighted pseudo-normal there.
    ClosestPoint,
    /// The distance to the boundary of the union of a closed surface's parts, which may intersect each other; negative
    /// inside. Continuous everywhere ([`UnionDistance`]). Where nothing intersects it is [`Distance::ClosestPoint`].
    Union,
}

/// A signed distance and its derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap<T> {
    /// Signed distance (m), positive outside.
    pub gap: T,
    /// `∂gap/∂p` with the surface fixed.
    pub gradient: [T; 3],
    /// The nearest vertex ([`Distance::NearestVertex`]) or the corner of the closest face that weighs most in the closest
    /// point ([`Distance::ClosestPoint`]).
    pub vertex: u32,
}

/// Spacing of the numbers at a query point (m) above which nearest vertices are found in `f64`.
const FAR_SPACING: f64 = 1e-4;

/// A fixed surface in one pose: the body, or a garment as another garment sees it.
///
/// Its vertex index and its closest-point trees are each built at first use. Share it by `Arc`.
#[derive(Debug)]
pub struct Surface<T: Real> {
    /// Vertex positions `[V, 3]` (m).
    pub positions: Vec<[T; 3]>,
    /// Faces `[F, 3]`, counter-clockwise seen from outside.
    pub faces: Arc<[[u32; 3]]>,
    /// Area-weighted unit vertex normals `[V, 3]`; zero where undefined.
    pub normals: Vec<[T; 3]>,
    vertex_index: OnceLock<VertexIndex<T>>,
    closest_point: OnceLock<ClosestPoint>,
    union_distance: OnceLock<UnionDistance>,
    is_closed: OnceLock<bool>,
}

impl<T: Real> Surface<T> {
    /// Wraps a posed surface. Every index in `faces` must be below the number of positions, as a [`TriMesh`] guarantees.
    pub fn new(positions: Vec<[T; 3]>, faces: Arc<[[u32; 3]]>) -> Self {
        let normals = vertex_normals(&positions, &faces);
        Self {
            positions,
            faces,
            normals,
            vertex_index: OnceLock::new(),
            closest_point: OnceLock::new(),
            union_distance: OnceLock::new(),
            is_closed: OnceLock::new(),
        }
    }

    /// The surface of a mesh.
    pub fn from_mesh(mesh: &TriMesh) -> Self {
        let positions = mesh.positions().iter().map(|p| vec3::from_f64(*p)).collect();
        Self::new(positions, mesh.faces().into())
    }

    /// The kd-tree over the vertices.
    pub fn vertex_index(&self) -> &VertexIndex<T> {
        self.vertex_index.get_or_init(|| VertexIndex::new(&self.positions))
    }

    /// The closest-point tree over the faces.
    pub fn closest_point(&self) -> &ClosestPoint {
        self.closest_point.get_or_init(|| {
            ClosestPoint::new(self.positions.iter().map(|p| vec3::to_f64(*p)).collect(), &self.faces)
        })
    }

    /// The closest-point tree over the boundary of the union of its parts.
    pub fn union_distance(&self) -> &UnionDistance {
        self.union_distance.get_or_init(|| {
            let positions: Vec<_> = self.positions.iter().map(|p| vec3::to_f64(*p)).collect();
            UnionDistance::new(&positions, &self.faces)
        })
    }

    /// Whether the surface has no border.
    pub(crate) fn is_closed(&self) -> bool {
        *self.is_closed.get_or_init(|| is_closed(&self.faces))
    }

    /// Index of the vertex nearest to `p`; the lowest of several equally near.
    ///
    /// Squared distances of a far point are so large that rounding makes vertices of the front and of the back equally near,
    /// and the side of the surface a matter of chance. Where `T` no longer resolves [`FAR_SPACING`], a kilometre away for
    /// `f32`, all vertices are compared in `f64`: slow, and only ever needed by a garment that has exploded.
    pub fn nearest_vertex(&self, p: [T; 3]) -> u32 {
        let farthest = p.iter().fold(0.0, |m: f64, x| m.max(Real::to_f64(*x).abs()));
        if vec3::is_finite(p) && farthest * T::epsilon().to_f64() > FAR_SPACING {
            return self.nearest_vertex_from_afar(vec3::to_f64(p));
        }
        self.vertex_index().nearest(p).0
    }

    #[cold]
    fn nearest_vertex_from_afar(&self, p: [f64; 3]) -> u32 {
        // |x − p|² − |p|² orders the vertices alike and keeps their differences.
        let key = |x: &[T; 3]| {
            let x = vec3::to_f64(*x);
            let key = vec3::norm_squared(x) - 2.0 * vec3::dot(x, p);
            if key.is_nan() { f64::INFINITY } else { key }
        };
        let keys = self.positions.iter().map(key).enumerate();
        keys.fold((0, f64::INFINITY), |best, (i, key)| if key < best.1 { (i, key) } else { best }).0 as u32
    }

    /// The surface point closest to `p`; `None` if `p` is not finite.
    pub fn project(&self, p: [T; 3]) -> Option<SurfacePoint> {
        self.closest_point().project(vec3::to_f64(p))
    }

    /// Signed distance of `p` with its gradient. All NaN for a `p` that is not finite.
    pub fn gap(&self, p: [T; 3], distance: Distance) -> Gap<T> {
        let Some(tree) = self.tree(distance) else { return self.nearest_vertex_gap(p) };
        match tree.project(vec3::to_f64(p)) {
            Some(found) => self.gap_to(p, &found, distance),
            None => not_a_gap(),
        }
    }

    /// As [`gap`](Self::gap), where only contact counts: outside and beyond `reach` (m) the gap may be any from there to the true
    /// one, with no gradient.
    pub(crate) fn gap_within(&self, p: [T; 3], distance: Distance, reach: f64) -> Gap<T> {
        let q = vec3::to_f64(p);
        if self.is_continuous(distance) && vec3::is_finite(q) {
            let union = self.union_distance();
            match union.kept().project_within(q, reach) {
                Some(found) => return self.gap_to(p, &found, distance),
                // A winding number costs less than a distance.
                None if union.winding_number(q) < 1 && !union.kept().is_empty() => return clear_gap(reach),
                None => (),
            }
        }
        self.gap(p, distance)
    }

    /// As [`gap`](Self::gap), for a point whose `near` faces are remembered from query to query. Beyond `reach` (m) the
    /// gap may be any from there to the true one, with no gradient.
    pub(crate) fn gap_near(&self, p: [T; 3], distance: Distance, reach: f64, near: &mut NearFaces) -> Gap<T> {
        let q = vec3::to_f64(p);
        let Some(tree) = self.tree(distance).filter(|_| vec3::is_finite(q)) else {
            return self.gap(p, distance);
        };
        let clearance = near.clearance(q);
        if self.is_continuous(distance) && clearance >= reach {
            return clear_gap(clearance);
        }
        let Some(found) = near.project(tree, q, reach) else { return not_a_gap() };
        let gap = self.gap_to(p, &found, distance);
        near.see(q, gap.gap.to_f64(), vec3::to_f64(gap.gradient));
        gap
    }

    /// Whether a distance is continuous: others jump where the body overlaps itself or ends, however far away it is.
    fn is_continuous(&self, distance: Distance) -> bool {
        distance == Distance::Union && self.is_closed()
    }

    /// The faces that a distance is measured to; none where it is measured to vertices.
    fn tree(&self, distance: Distance) -> Option<&ClosestPoint> {
        match distance {
            Distance::NearestVertex => None,
            // A ray through a hole would tell the whole body as buried.
            Distance::Union if self.is_closed() => Some(self.union_distance().kept()),
            Distance::ClosestPoint | Distance::Union => Some(self.closest_point()),
        }
    }

    /// The distance from `found`, the point closest to `p` on the faces of the [`tree`](Self::tree), with its sign.
    fn gap_to(&self, p: [T; 3], found: &SurfacePoint, distance: Distance) -> Gap<T> {
        let q = vec3::to_f64(p);
        let is_inside = match self.is_continuous(distance) {
            true => self.union_distance().is_inside(q, found),
            false => found.is_behind(q),
        };
        let (gap, gradient) = found.signed(q, is_inside);
        let corners = self.faces[found.face as usize];
        let [a, b, c] = found.barycentric;
        let vertex = if a >= b && a >= c {
            corners[0]
        } else if b >= c {
            corners[1]
        } else {
            corners[2]
        };
        Gap { gap: T::from_f64(gap), gradient: vec3::from_f64(gradient), vertex }
    }

    /// The paper's form: `(p − x_b)·n_b`, gradient `n_b`.
    fn nearest_vertex_gap(&self, p: [T; 3]) -> Gap<T> {
        let vertex = self.nearest_vertex(p);
        let (Some(&position), Some(&normal)) =
            (self.positions.get(vertex as usize), self.normals.get(vertex as usize))
        else {
            return not_a_gap();
        };
        Gap { gap: vec3::dot(vec3::sub(p, position), normal), gradient: normal, vertex }
    }
}

/// Of a point at least `distance` (m) away, where no gradient is asked for.
fn clear_gap<T: Real>(distance: f64) -> Gap<T> {
    Gap { gap: T::from_f64(distance), gradient: vec3::zero(), vertex: 0 }
}

fn not_a_gap<T: Real>() -> Gap<T> {
    Gap { gap: T::nan(), gradient: [T::nan(); 3], vertex: 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{self, SplitMix};
    use crate::query::brute_force;

    #[test]
    fn gap_equals_brute_force() {
        let meshes = [shapes::icosphere(0.5, 3), shapes::tube(0.3, 0.7, 20, 12), shapes::tetrahedron()];
        for mesh in meshes {
            let surface = Surface::<f64>::from_mesh(&mesh);
            for p in SplitMix::new(2).points(400, 0.9) {
                for distance in [Distance::NearestVertex, Distance::ClosestPoint] {
                    let expected =
                        brute_force::gap(mesh.positions(), mesh.faces(), &surface.normals, p, distance);
                    let found = surface.gap(p, distance);
                    assert!((found.gap - expected.gap).abs() < 1e-12);
                    assert!(vec3::distance_squared(found.gradient, expected.gradient) < 1e-20);
                }
                let vertex = surface.gap(p, Distance::NearestVertex).vertex;
                assert_eq!(vertex, brute_force::nearest(mesh.positions(), p).0);
            }
        }
    }

    #[test]
    fn within_reach_and_inside_a_gap_is_that_of_all_faces() {
        let ball = shapes::icosphere(0.1, 3);
        let body = shapes::union(&[&ball, &shapes::mapped(&ball, |[x, y, z]| [x + 0.13, y, z])]);
        let surface = Surface::<f64>::from_mesh(&body);
        let (mut inside, mut beyond) = (0, 0);
        for p in SplitMix::new(21).points(2000, 0.3) {
            let exact = surface.gap(p, Distance::Union);
            let found = surface.gap_within(p, Distance::Union, 0.03);
            if exact.gap >= 0.03 {
                assert_eq!((found.gap, found.gradient), (0.03, [0.0; 3]));
                beyond += 1;
            } else {
                assert_eq!(found, exact);
                inside += usize::from(exact.gap < -0.03);
            }
        }
        assert!(inside > 10 && beyond > 500, "{inside} {beyond}");
    }

    #[test]
    fn a_surface_with_a_hole_has_no_union() {
        let ball = shapes::icosphere(0.5, 2);
        let half: Vec<[u32; 3]> = (ball.faces().iter().copied())
            .filter(|face| face.iter().all(|&v| ball.positions()[v as usize][0] <= 0.1))
            .collect();
        let surface = Surface::<f64>::new(ball.positions().to_vec(), half.into());
        for p in SplitMix::new(4).points(50, 0.9) {
            let (union, closest) = (surface.gap(p, Distance::Union), surface.gap(p, Distance::ClosestPoint));
            assert_eq!((union.gap, union.gradient), (closest.gap, closest.gradient));
            assert!(union.gap.is_finite());
        }
    }

    #[test]
    fn gap_of_a_sphere_is_the_distance_to_it() {
        let surface = Surface::<f64>::from_mesh(&shapes::icosphere(0.5, 4));
        for p in SplitMix::new(3).points(300, 0.8) {
            let exact = vec3::norm(p) - 0.5;
            assert!((surface.gap(p, Distance::ClosestPoint).gap - exact).abs() < 2e-3);
        }
    }

    #[test]
    fn gradient_is_the_central_difference_of_the_gap() {
        let step = 1e-6;
        for mesh in [shapes::icosphere(0.5, 2), shapes::tube(0.3, 0.7, 11, 6)] {
            let surface = Surface::<f64>::from_mesh(&mesh);
            for distance in [Distance::NearestVertex, Distance::ClosestPoint] {
                let mut checked = 0;
                for p in SplitMix::new(5).points(200, 0.9) {
                    let here = surface.gap(p, distance);
                    let moved: Vec<Gap<f64>> = (0..6)
                        .map(|k| {
                            let mut q = p;
                            q[k / 2] += if k % 2 == 0 { step } else { -step };
                            surface.gap(q, distance)
                        })
                        .collect();
                    // Where the nearest feature changes, the distance has no derivative.
                    if moved.iter().any(|g| g.vertex != here.vertex || g.gap.signum() != here.gap.signum()) {
                        continue;
                    }
                    for k in 0..3 {
                        let difference = (moved[2 * k].gap - moved[2 * k + 1].gap) / (2.0 * step);
                        assert!((difference - here.gradient[k]).abs() < 1e-4, "{distance:?} at {p:?}");
                    }
                    checked += 1;
                }
                assert!(checked > 150);
            }
        }
    }

    #[test]
    fn on_the_surface_the_gradient_is_the_pseudo_normal() {
        let mesh = shapes::icosphere(0.5, 2);
        let surface = Surface::<f64>::from_mesh(&mesh);
        for (vertex, p) in mesh.positions().iter().enumerate() {
            let gap = surface.gap(*p, Distance::ClosestPoint);
            assert!(gap.gap.abs() < 1e-12);
            assert_eq!(gap.vertex as usize, vertex);
            assert!((vec3::norm(gap.gradient) - 1.0).abs() < 1e-12);
            assert!(vec3::dot(gap.gradient, *p) > 0.49);
        }
    }

    #[test]
    fn from_afar_both_precisions_see_the_same_vertex_and_side() {
        let mesh = shapes::icosphere(0.5, 3);
        let (single, double) = (Surface::<f32>::from_mesh(&mesh), Surface::<f64>::from_mesh(&mesh));
        for p in SplitMix::new(7).points(50, 1.0) {
            for distance in [1e2, 1e4, 1e6, 1e9] {
                let far = vec3::from_f64::<f32>(vec3::scale(p, distance));
                let gap = single.gap(far, Distance::NearestVertex).gap;
                let expected = double.gap(vec3::to_f64(far), Distance::NearestVertex).gap;
                assert!((f64::from(gap) / expected - 1.0).abs() < 1e-5, "{gap} {expected}");
            }
        }
    }

    #[test]
    fn open_surface_has_two_sides() {
        let surface = Surface::<f32>::from_mesh(&shapes::grid(1.0, 1.0, 5, 5));
        for distance in [Distance::NearestVertex, Distance::ClosestPoint] {
            assert!((surface.gap([0.43, 0.57, 0.1], distance).gap - 0.1).abs() < 1e-6);
            assert!((surface.gap([0.43, 0.57, -0.1], distance).gap + 0.1).abs() < 1e-6);
        }
        // Beyond the border the distance is to the border, with the side of its face.
        let beyond = surface.gap([-0.3, 0.5, -0.4], Distance::ClosestPoint);
        assert!((beyond.gap + 0.5).abs() < 1e-6);
    }

    #[test]
    fn a_point_that_is_not_finite_gives_nan_and_no_panic() {
        let surface = Surface::<f32>::from_mesh(&shapes::tetrahedron());
        for distance in [Distance::NearestVertex, Distance::ClosestPoint] {
            let gap = surface.gap([f32::NAN, 0.0, 0.0], distance);
            assert!(gap.gap.is_nan());
            assert!((gap.vertex as usize) < surface.positions.len());
        }
    }
}
