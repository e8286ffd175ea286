//! Which part of the body a garment covers, and how thick what is worn below another garment is.

use super::binding::{nearest_body_vertices, smooth};
use super::body::Body;
use super::garment::Garment;
use clothcombo_physics::mesh::Topology;
use clothcombo_physics::query::{ClosestPoint, Feature};
use std::collections::HashSet;

/// Averaging steps over the body, half towards the mean of the ring each: at edges of a centimetre the hem of what is below fades
/// over some three centimetres, as cloth over it would.
const FADE: usize = 10;

/// Body farther from the garment than this (m) is not below it, however it faces it: the legs in a wide skirt are up to 13 cm
/// away.
const FARTHEST_COVERED: f64 = 0.15;

/// Where a garment lies on the zero body.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// The body vertex nearest to each vertex of the garment `[V]`.
    nearest: Vec<u32>,
    /// How far each vertex of the body is covered by the garment, from 0 to 1, fading at hems.
    covered: Vec<f32>,
}

impl Footprint {
    /// Of a garment that lies on the zero body. A body vertex is covered if the point of the garment closest to it is near
    /// and does not lie on a hem.
    pub fn new(garment: &Garment, body: &Body) -> Self {
        let (positions, faces) = (garment.rest.positions(), garment.rest.faces());
        let hems = Topology::new(&garment.rest).boundary_loops;
        let edges = hems.iter().flat_map(|hem| hem.iter().zip(hem.iter().cycle().skip(1)));
        let edges: HashSet<[u32; 2]> = edges.map(|(a, b)| [*a.min(b), *a.max(b)]).collect();
        let mut on_hem = vec![false; positions.len()];
        hems.iter().flatten().for_each(|v| on_hem[*v as usize] = true);
        let surface = ClosestPoint::new(positions.to_vec(), faces);
        let is_covered = |p: &[f64; 3]| {
            let Some(found) = surface.project_within(*p, FARTHEST_COVERED) else { return false };
            let corners = faces[found.face as usize];
            match found.feature {
                Feature::Face => true,
                Feature::Vertex(k) => !on_hem[corners[k] as usize],
                Feature::Edge(k) => {
                    let (a, b) = (corners[k], corners[(k + 1) % 3]);
                    !edges.contains(&[a.min(b), a.max(b)])
                }
            }
        };
        let covered = body.template.iter().map(|p| f32::from(u8::from(is_covered(p))));
        let mut covered: Vec<f32> = covered.collect();
        smooth(&mut covered, 1, body.topology(), FADE);
        let nearest = nearest_body_vertices(garment, body, true);
        Self { nearest: nearest.into_iter().map(|v| v as u32).collect(), covered }
    }

    /// Thickness (m) of the garments `below` this one, each with its own (m), at the vertices of this one `[V]`.
    pub fn thickness_of<'a>(&self, below: impl Iterator<Item = (&'a Self, f64)>) -> Vec<f32> {
        let mut sum = vec![0.0; self.nearest.len()];
        for (other, thickness) in below {
            sum.iter_mut()
                .zip(&self.nearest)
                .for_each(|(sum, v)| *sum += thickness as f32 * other.covered[*v as usize]);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::Category;
    use crate::generate::mannequin;
    use clothcombo_physics::TriMesh;
    use clothcombo_physics::mesh::shapes::tube;

    /// A tube around the trunk, between two heights (m).
    fn band(radius: f64, low: f64, high: f64) -> Garment {
        let mesh = tube(radius, high - low, 40, 20);
        let highest = mesh.positions().iter().map(|p| p[1]).fold(f64::MIN, f64::max);
        let moved = mesh.positions().iter().map(|p| [p[0], p[1] - highest + high, p[2]]).collect();
        let mesh: TriMesh = mesh.with_positions(moved).unwrap();
        Garment::new(Category::Top, mesh)
    }

    #[test]
    fn what_is_below_counts_where_it_covers_and_fades_at_its_hem() {
        let body = mannequin();
        let hips = body.joint_place("pelvis").unwrap()[1];
        let inner = Footprint::new(&band(0.2, hips - 0.05, hips + 0.15), &body);
        let outer = band(0.25, hips - 0.2, hips + 0.3);
        let footprint = Footprint::new(&outer, &body);
        let below = footprint.thickness_of([(&inner, 0.001), (&inner, 0.007)].into_iter());
        let mut between = 0;
        for (p, h) in outer.rest.positions().iter().zip(&below) {
            let height = p[1] - hips;
            assert!((0.0..=0.008_001).contains(h), "{h}");
            if (0.04..0.06).contains(&height) {
                assert!(*h > 0.007, "{h} in the middle of what is below, {height}");
            } else if !(-0.15..0.25).contains(&height) {
                assert!(*h < 0.001, "{h} where nothing is below, {height}");
            }
            between += usize::from((0.001..0.007).contains(h));
        }
        assert!(between > 0, "no fading");
        assert!(footprint.thickness_of([].into_iter()).iter().all(|h| *h == 0.0));
    }
}
