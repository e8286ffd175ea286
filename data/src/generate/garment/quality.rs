//! What the generator guarantees of a garment, measured: topology, triangle shapes, and no contact with the body.

use crate::mesh::{Quality, smallest_sine, triangle_normal};
use clothcombo_physics::contact::TriangleTree;
use clothcombo_physics::query::{Distance, Surface};
use clothcombo_physics::vec3::{dot, norm, sub};
use clothcombo_physics::{Topology, TriMesh};
use std::collections::HashSet;

/// Measurements of a garment at rest on the body it was made for.
#[derive(Debug)]
pub(super) struct GarmentQuality {
    /// Connected components.
    pub components: usize,
    /// Closed boundary curves.
    pub boundary_loops: usize,
    /// Vertices − edges + faces; 2 − `boundary_loops` for one piece without handles.
    pub euler_characteristic: i64,
    /// Every edge has one or two faces which run through it in opposite directions, every boundary vertex lies on one loop.
    pub is_orientable_manifold: bool,
    /// Smallest triangle angle in degrees.
    pub smallest_angle: f64,
    /// Shortest and longest edge, relative to the median edge.
    pub edge_ratio: [f64; 2],
    /// Least signed distance of a vertex to the body (m), positive outside.
    pub least_gap: f64,
    /// Pairs of a garment triangle and a body triangle that share a point, decided exactly.
    pub body_triangle_pairs: usize,
    /// Pairs of garment triangles that intersect beyond the vertices they share, decided exactly.
    pub self_triangle_pairs: usize,
    /// Share of the faces, by area, that face away from the body.
    pub outward: f64,
}

impl GarmentQuality {
    pub(super) fn measure(rest: &TriMesh, body: &Surface<f64>, body_tree: &TriangleTree) -> Self {
        let topology = Topology::new(rest);
        let positions = rest.positions();
        let mut directed = HashSet::with_capacity(rest.face_count() * 3);
        let oriented = rest.faces().iter().all(|f| (0..3).all(|i| directed.insert((f[i], f[(i + 1) % 3]))));
        let mut on_boundary = HashSet::new();
        let simple_loops = topology.boundary_loops.iter().flatten().all(|v| on_boundary.insert(*v));
        let mut lengths: Vec<f64> = topology
            .edges
            .iter()
            .map(|[a, b]| norm(sub(positions[*a as usize], positions[*b as usize])))
            .collect();
        lengths.sort_by(f64::total_cmp);
        let median = lengths[lengths.len() / 2];
        let smallest_angle = (0..rest.face_count())
            .map(|f| smallest_sine(rest.corners(f)).min(1.0).asin().to_degrees())
            .fold(f64::MAX, f64::min);
        let gaps: Vec<_> = positions.iter().map(|p| body.gap(*p, Distance::ClosestPoint)).collect();
        let (mut outward, mut area) = (0.0, 0.0);
        for (f, face) in rest.faces().iter().enumerate() {
            let normal = triangle_normal(rest.corners(f));
            let away = face.iter().map(|v| dot(gaps[*v as usize].gradient, normal)).sum::<f64>();
            area += norm(normal);
            outward += if away > 0.0 { norm(normal) } else { 0.0 };
        }
        let tree = TriangleTree::new(positions, rest.faces());
        Self {
            components: topology.component_count,
            boundary_loops: topology.boundary_loops.len(),
            euler_characteristic: positions.len() as i64 - topology.edges.len() as i64
                + rest.face_count() as i64,
            is_orientable_manifold: oriented && simple_loops && topology.non_manifold_edges.is_empty(),
            smallest_angle,
            edge_ratio: [lengths[0] / median, lengths[lengths.len() - 1] / median],
            least_gap: gaps.iter().map(|g| g.gap).fold(f64::MAX, f64::min),
            body_triangle_pairs: tree.pairs_with(body_tree).len(),
            self_triangle_pairs: tree.self_pairs().len(),
            outward: outward / area,
        }
    }

    pub(super) fn check(&self, limits: &Quality, openings: usize) -> Result<(), String> {
        let fail = |condition: bool, message: String| if condition { Err(message) } else { Ok(()) };
        fail(!self.is_orientable_manifold, "is no orientable manifold".to_string())?;
        fail(self.components != 1, format!("falls into {} pieces", self.components))?;
        fail(
            self.boundary_loops != openings || self.euler_characteristic != 2 - openings as i64,
            format!("has {} openings instead of {openings}", self.boundary_loops),
        )?;
        fail(
            self.body_triangle_pairs > 0,
            format!("cuts the body in {} pairs of triangles", self.body_triangle_pairs),
        )?;
        fail(
            self.self_triangle_pairs > 0,
            format!("cuts itself in {} pairs of triangles", self.self_triangle_pairs),
        )?;
        fail(self.least_gap < 0.003, format!("comes within {:.1} mm of the body", self.least_gap * 1e3))?;
        fail(
            self.smallest_angle < limits.angle,
            format!("has a triangle angle of {:.1} degrees", self.smallest_angle),
        )?;
        fail(
            self.edge_ratio[0] < limits.edge_ratio[0] || self.edge_ratio[1] > limits.edge_ratio[1],
            format!("has edges of {:.2} to {:.2} of the median", self.edge_ratio[0], self.edge_ratio[1]),
        )?;
        fail(self.outward < 0.6, "faces inward".to_string())
    }
}

/// Whether the cut surface is one piece with the wanted number of openings and every open edge lies on a cut.
pub(super) fn check_openings(
    positions: &[[f64; 3]],
    labels: &[u32],
    faces: &[[u32; 3]],
    openings: usize,
) -> Result<(), String> {
    let mesh = TriMesh::new(positions.to_vec(), faces.to_vec()).map_err(|e| format!("is no mesh: {e}"))?;
    let topology = Topology::new(&mesh);
    let euler = positions.len() as i64 - topology.edges.len() as i64 + faces.len() as i64;
    let found = topology.boundary_loops.len();
    if found != openings || euler != 2 - openings as i64 {
        return Err(format!("opens in {found} places instead of {openings} (Euler characteristic {euler})"));
    }
    let off_curve = topology.boundary_loops.iter().any(|curve| {
        (0..curve.len()).any(|i| {
            let (a, b) = (curve[i] as usize, curve[(i + 1) % curve.len()] as usize);
            labels[a] & labels[b] == 0
        })
    });
    if off_curve { Err("reaches out of its bounding box".to_string()) } else { Ok(()) }
}
