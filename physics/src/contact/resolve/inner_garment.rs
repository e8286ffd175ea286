//! A garment as what lies under another one, and which of its sides looks away from the body.

use super::RestGarment;
use crate::contact::TriangleTree;
use crate::mesh::vertex_normals;
use crate::query::ClosestPoint;
use crate::vec3::{add_scaled, dot, norm, scale, sub};

/// A garment that lies under another one.
pub(super) struct InnerGarment<'a> {
    garment: &'a RestGarment,
    pub tree: TriangleTree<'a>,
    closest: ClosestPoint,
    facing: Vec<f64>,
    bounds: [[f64; 3]; 2],
}

impl<'a> InnerGarment<'a> {
    /// `tree` of the garment where it is; `facing` as of [`facing`].
    pub fn new(garment: &'a RestGarment, tree: TriangleTree<'a>, facing: Vec<f64>) -> Self {
        let closest = ClosestPoint::of_tree(&tree, |_| true);
        let bounds = bounds(tree.positions());
        Self { garment, tree, closest, facing, bounds }
    }

    /// Distance of `p` to the garment [m], negative under it, if it is within `reach` and `p` lies over or under the garment and
    /// not beside it.
    pub fn signed_distance(&self, p: [f64; 3], reach: f64) -> Option<f64> {
        let [low, high] = self.bounds;
        if !(0..3).all(|k| p[k] - reach <= high[k] && low[k] - reach <= p[k]) {
            return None;
        }
        let found = self.closest.project_within(p, reach)?;
        let facing = self.facing[self.garment.faces[found.face as usize][0] as usize];
        let normal = scale(found.normal, facing);
        let offset = sub(p, found.position);
        let along = dot(offset, normal);
        if self.is_at_border(found.face, found.barycentric) {
            // Past the hem there is nothing to be over; right at it there is.
            let beside = norm(add_scaled(offset, -along, normal));
            return (beside <= 0.5 * along.abs()).then_some(along);
        }
        let distance = found.distance_squared.sqrt();
        Some(if along < 0.0 { -distance } else { distance })
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
