//! The posed body as what garments have to stay outside of.

use super::Layer;
use super::condition::{Plane, along_line, normal_of};
use super::garment::triangles;
use super::near::{NEAR_MARGIN, near_cloth};
use crate::contact::{Triangle, TriangleTree};
use crate::query::{ClosestPoint, FaceSide, Surface, SurfacePoint, UnionDistance};
use crate::vec3::{add, add_scaled, bounds, dot, scale, sub};
use std::sync::OnceLock;

/// Below this distance (m) the direction from the closest point is rounding.
const CONTACT: f64 = 1e-9;

/// The body as seen from a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct BodyView {
    /// Distance to the nearest exposed face, without sign (m).
    pub far: f64,
    /// The half-space it must stay in; `None` in a pinched region.
    pub plane: Option<Plane>,
}

/// The posed body, as far as it is near cloth.
///
/// **Pinched regions.** Where one part of the body lies inside another (an arm pressed into the torso), no cloth can be
/// outside of both. The rule (after Baraff, Witkin and Kass, "Untangling cloth", 2003): faces inside another part of the
/// body, the seams where parts cross, and the faces next to those are *pinched*. They push nothing, and what intersects them is
/// counted apart. A vertex inside the body whose nearest face, of all, is pinched is left alone.
pub(super) struct BodyObstacle<'a> {
    pub tree: TriangleTree<'a>,
    is_pinched: Vec<bool>,
    has_pinched: bool,
    /// Faces that yield.
    pub(super) yielded: Vec<bool>,
    /// Of a surface without a border: inside and outside are known everywhere.
    pub union: Option<UnionDistance>,
    /// All faces near cloth; made when it is first asked.
    all: OnceLock<ClosestPoint>,
    pub surface: &'a Surface<f64>,
    /// Vertices near cloth.
    pub near: Vec<bool>,
}

impl<'a> BodyObstacle<'a> {
    /// The body as it is drawn, near `layers`: the same garments once or, at several positions, more often.
    pub fn near_layers(surface: &'a Surface<f64>, layers: &[Layer<'_>]) -> Self {
        Self::new(surface, near_cloth(&surface.positions, &surface.faces, &triangles(layers)))
    }

    /// The body as it is drawn; `near`: vertices near cloth.
    pub fn new(surface: &'a Surface<f64>, near: Vec<bool>) -> Self {
        Self::pinched_where(surface, near, |_| true)
    }

    pub(super) fn pinched_where(
        surface: &'a Surface<f64>,
        near: Vec<bool>,
        may_be: impl Fn(u32) -> bool,
    ) -> Self {
        let faces = &surface.faces;
        let is_part = |f: u32| faces[f as usize].iter().any(|&v| near[v as usize]);
        let tree = TriangleTree::of_part(&surface.positions, faces, |f, _| is_part(f));
        let union = surface.is_closed().then(|| UnionDistance::of_tree(&tree));
        let mut touched = vec![false; surface.positions.len()];
        if let Some(union) = &union {
            for (face, _) in faces.iter().zip(union.sides()).filter(|(_, side)| **side != FaceSide::Exposed) {
                face.iter().for_each(|&v| touched[v as usize] = may_be(v));
            }
        }
        let is_pinched = touching(faces, &touched);
        let has_pinched = is_pinched.contains(&true);
        let yielded = Vec::new();
        Self { tree, is_pinched, has_pinched, yielded, union, all: OnceLock::new(), surface, near }
    }

    /// Whether face `f` is pinched.
    pub fn is_pinched(&self, f: u32) -> bool {
        self.is_pinched.get(f as usize).is_some_and(|p| *p)
    }

    /// Whether face `f` yields, to leave clearance for cloth.
    pub fn yielded(&self, f: u32) -> bool {
        self.yielded.get(f as usize).is_some_and(|p| *p)
    }

    /// The nearest of all faces near cloth, whatever the side.
    fn nearest_of_all(&self, p: [f64; 3]) -> Option<SurfacePoint> {
        self.all.get_or_init(|| ClosestPoint::of_tree(&self.tree, |_| true)).project(p)
    }

    /// Whether the body's face nearest to `p` is pinched.
    pub fn is_pinch(&self, p: [f64; 3]) -> bool {
        self.has_pinched && self.nearest_of_all(p).is_some_and(|found| self.is_pinched(found.face))
    }

    /// Whether the body's face nearest to the middle of a triangle is pinched.
    pub fn is_pinch_at(&self, [a, b, c]: &Triangle) -> bool {
        self.has_pinched && self.is_pinch(scale(add(add(*a, *b), *c), 1.0 / 3.0))
    }

    /// The body as seen from `p`; `None` where it is not near cloth.
    pub fn look(&self, p: [f64; 3]) -> Option<BodyView> {
        let (found, mut is_inside) = match &self.union {
            Some(union) => union.project(p)?,
            None => {
                let found = self.nearest_of_all(p)?;
                (found, dot(sub(p, found.position), found.normal) < 0.0)
            }
        };
        let far = found.distance_squared.sqrt();
        if far >= NEAR_MARGIN {
            // The nearest face may not be near cloth, and the normal of another one says nothing.
            is_inside = self.union.as_ref().is_some_and(|union| union.winding_number(p) >= 1);
        }
        let distance = if is_inside { -far } else { far };
        let direction =
            if far > CONTACT { scale(sub(p, found.position), distance.signum() / far) } else { found.normal };
        let is_pinched = self.is_pinched(found.face);
        let plane = if is_inside && (is_pinched || self.is_pinch(p)) {
            None
        } else {
            let offset = dot(direction, found.position);
            Some(Plane { normal: direction, offset, distance, is_held: is_pinched })
        };
        Some(BodyView { far, plane })
    }

    /// The half-space that the body leaves to `p`, where `plane` is that of the nearest way out: more than half way through a limb
    /// that is the limb's other side, and cloth goes back to its own, `away` from the body, at most `farthest` (m).
    pub fn back_from_through(
        &self,
        plane: Option<Plane>,
        p: [f64; 3],
        away: [f64; 3],
        farthest: f64,
    ) -> Option<Plane> {
        let is_through = plane.is_some_and(|plane| plane.distance < 0.0 && dot(plane.normal, away) < 0.0);
        if is_through { self.exit(p, away, farthest).or(plane) } else { plane }
    }

    /// The half-space a point inside the body has to reach by `way` (unit), at most `reach` (m) along it: that of the first
    /// surface there. `None` where there is none, or where it is pinched.
    fn exit(&self, p: [f64; 3], way: [f64; 3], reach: f64) -> Option<Plane> {
        let leaves = |f: u32| {
            let triangle = self.tree.triangle(f)?;
            let normal = normal_of(&triangle);
            let (far, _) = along_line(p, way, &triangle)?;
            ((0.0..=reach).contains(&far) && dot(normal, way) > 0.0).then_some((far, f, normal))
        };
        let along = self.tree.faces_in_box(bounds([p, add_scaled(p, reach, way)]));
        let nearest =
            |a: &(f64, u32, [f64; 3]), b: &(f64, u32, [f64; 3])| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        let (far, f, normal) = along.filter_map(leaves).min_by(nearest)?;
        let distance = -far * dot(normal, way);
        let offset = dot(normal, p) - distance;
        (!self.is_pinched(f)).then_some(Plane { normal, offset, distance, is_held: false })
    }
}

/// Which faces have a corner that is `touched`.
pub(super) fn touching(faces: &[[u32; 3]], touched: &[bool]) -> Vec<bool> {
    faces.iter().map(|face| face.iter().any(|&v| touched[v as usize])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    /// The nearest face of the part that is near cloth looks the other way.
    #[test]
    fn a_point_far_from_the_body_is_outside() {
        let body = Surface::from_mesh(&shapes::icosphere(0.5, 3));
        let near: Vec<bool> = body.positions.iter().map(|p| p[0] > 0.3).collect();
        let obstacle = BodyObstacle::new(&body, near);
        let behind = obstacle.look([-0.8, 0.1, 0.0]).unwrap();
        assert!(behind.plane.unwrap().distance > NEAR_MARGIN);
        let deep = obstacle.look([-0.1, 0.1, 0.0]).unwrap();
        assert!(deep.plane.unwrap().distance < -NEAR_MARGIN);
        let open = Surface::from_mesh(&shapes::grid(0.2, 0.2, 4, 4));
        let all = vec![true; open.positions.len()];
        let under = BodyObstacle::new(&open, all).look([0.1, 0.1, -0.5]).unwrap();
        assert!(under.plane.unwrap().distance > 0.0, "no inside is known so far from an open surface");
    }
}
