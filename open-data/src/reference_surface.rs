//! A fixed triangle sheet to which a remeshed copy keeps: its surface, its boundary curves and their corners.

use clothcombo_data::mesh::{LabelledTriangles, RemeshTarget};
use clothcombo_physics::query::ClosestPoint;
use clothcombo_physics::vec3::{add, dot, norm_squared, scale, sub};
use std::collections::HashMap;

/// The sheet before remeshing. Labels are bit sets of the boundary curves a vertex lies on; two bits make a corner.
pub(super) struct ReferenceSurface {
    surface: ClosestPoint,
    /// Boundary segments with the bits both ends share.
    segments: Vec<([[f64; 3]; 2], u32)>,
    corners: Vec<([f64; 3], u32)>,
    edge_length: f64,
}

impl ReferenceSurface {
    pub fn new(triangles: &LabelledTriangles, edge_length: f64) -> Self {
        let LabelledTriangles { positions, labels, faces } = triangles;
        let segments = boundary_edges(faces)
            .into_iter()
            .map(|[a, b]| {
                let ends = [positions[a as usize], positions[b as usize]];
                (ends, labels[a as usize] & labels[b as usize])
            })
            .collect();
        let corners =
            positions.iter().zip(labels).filter(|(_, l)| l.count_ones() > 1).map(|(p, l)| (*p, *l)).collect();
        Self { surface: ClosestPoint::new(positions.clone(), faces), segments, corners, edge_length }
    }
}

/// Edges with one face, directed as that face runs, sorted.
pub(super) fn boundary_edges(faces: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut uses: HashMap<[u32; 2], (u32, [u32; 2])> = HashMap::with_capacity(faces.len() * 2);
    for f in faces {
        for i in 0..3 {
            let (a, b) = (f[i], f[(i + 1) % 3]);
            uses.entry([a.min(b), a.max(b)]).or_insert((0, [a, b])).0 += 1;
        }
    }
    let mut edges: Vec<[u32; 2]> = uses.into_values().filter(|(n, _)| *n == 1).map(|(_, e)| e).collect();
    edges.sort_unstable();
    edges
}

/// The point of segment `ab` closest to `p`.
fn closest_on_segment(p: [f64; 3], [a, b]: [[f64; 3]; 2]) -> [f64; 3] {
    let along = sub(b, a);
    let length_squared = norm_squared(along);
    let t = if length_squared > 0.0 { (dot(sub(p, a), along) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    add(a, scale(along, t))
}

impl RemeshTarget for ReferenceSurface {
    fn project(&self, point: [f64; 3], label: u32) -> [f64; 3] {
        let nearest = |candidates: &mut dyn Iterator<Item = [f64; 3]>| {
            let mut best = (f64::MAX, point);
            for q in candidates {
                let d = norm_squared(sub(q, point));
                if d < best.0 {
                    best = (d, q);
                }
            }
            best.1
        };
        match label.count_ones() {
            0 => self.surface.project(point).map_or(point, |hit| hit.position),
            1 => nearest(
                &mut self
                    .segments
                    .iter()
                    .filter(|(_, l)| l & label != 0)
                    .map(|(s, _)| closest_on_segment(point, *s)),
            ),
            _ => nearest(&mut self.corners.iter().filter(|(_, l)| *l == label).map(|(p, _)| *p)),
        }
    }

    fn edge_length(&self, _: [f64; 3]) -> f64 {
        self.edge_length
    }
}
