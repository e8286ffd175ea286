//! A garment as what lies under another one: the half-space that its nearest sheet leaves.

use super::RestGarment;
use super::obstacle::{CONTACT, Plane};
use crate::contact::TriangleTree;
use crate::mesh::vertex_normals;
use crate::query::ClosestPoint;
use crate::vec3::{add_scaled, dot, norm, scale, sub};

/// A garment that lies under the one being resolved.
pub(super) struct LayerObstacle<'a> {
    garment: &'a RestGarment,
    pub tree: TriangleTree<'a>,
    closest: ClosestPoint,
    facing: Vec<f64>,
    bounds: [[f64; 3]; 2],
}

impl<'a> LayerObstacle<'a> {
    /// `tree` of the garment where it is; `facing` as of [`facing`].
    pub fn new(garment: &'a RestGarment, tree: TriangleTree<'a>, facing: Vec<f64>) -> Self {
        let closest = ClosestPoint::of_tree(&tree, |_| true);
        let bounds = bounds(tree.positions());
        Self { garment, tree, closest, facing, bounds }
    }

    /// 1 where face `f` looks away from the body, −1 where the mesh is inside out.
    pub fn facing(&self, f: u32) -> f64 {
        self.garment.faces.get(f as usize).map_or(1.0, |face| self.facing[face[0] as usize])
    }

    /// Whether a box comes closer than `margin` to the garment.
    pub fn is_near(&self, [low, high]: [[f64; 3]; 2], margin: f64) -> bool {
        (0..3).all(|k| low[k] - margin <= self.bounds[1][k] && self.bounds[0][k] - margin <= high[k])
    }

    /// The half-space over the garment at the point nearest to `p`, if it is within `reach` and `p` lies over or under the
    /// garment and not beside it.
    pub fn look(&self, p: [f64; 3], reach: f64, gap: f64) -> Option<Plane> {
        if !self.is_near([p, p], reach) {
            return None;
        }
        let found = self.closest.project_within(p, reach)?;
        let facing = self.facing(found.face);
        let normal = scale(found.normal, facing);
        let offset = sub(p, found.position);
        let along = dot(offset, normal);
        let length = found.distance_squared.sqrt();
        if self.is_at_border(found.face, found.barycentric) {
            // Past the hem there is nothing to be over; right at it there is.
            let beside = add_scaled(offset, -along, normal);
            if norm(beside) > gap.max(0.5 * along.abs()) {
                return None;
            }
            return Some(Plane::at(&found, normal, along, false));
        }
        let distance = if along < 0.0 { -length } else { length };
        let direction = if length > CONTACT { scale(offset, distance.signum() / length) } else { normal };
        Some(Plane::at(&found, direction, distance, false))
    }

    fn is_at_border(&self, f: u32, barycentric: [f64; 3]) -> bool {
        let face = self.garment.faces[f as usize];
        let zero: Vec<usize> = (0..3).filter(|&k| barycentric[k] <= 1e-9).collect();
        match zero[..] {
            [] => false,
            // On the edge opposite to corner k, which starts at corner k + 1.
            [k] => self.garment.border_edges[f as usize] >> ((k + 1) % 3) & 1 == 1,
            _ => (0..3).any(|k| barycentric[k] > 0.5 && self.garment.is_border[face[k] as usize]),
        }
    }
}

/// For every vertex 1 or −1: which side of its component looks away from the body, by what most of its vertices say.
pub(super) fn facing(
    garment: &RestGarment,
    positions: &[[f64; 3]],
    outward: impl Fn(usize) -> [f64; 3],
) -> Vec<f64> {
    let normals = vertex_normals(positions, &garment.faces);
    let component = &garment.topology.component_of_vertex;
    let mut votes = vec![0.0; garment.topology.component_count];
    for v in 0..positions.len() {
        votes[component[v] as usize] += dot(normals[v], outward(v));
    }
    component.iter().map(|&c| if votes[c as usize] < 0.0 { -1.0 } else { 1.0 }).collect()
}

/// Smallest and largest coordinates.
fn bounds(positions: &[[f64; 3]]) -> [[f64; 3]; 2] {
    positions.iter().fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[low, high], p| {
        [std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k]))]
    })
}
