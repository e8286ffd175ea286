//! What a generated garment promises, measured: topology, triangle shapes, and no contact with the body.

use super::super::remesh::Quality;
use super::super::sheet::{smallest_sine, triangle_normal};
use super::distance;
use clothcombo_physics::query::{Distance, Surface};
use clothcombo_physics::vec3::{cross, dot, norm, sub};
use clothcombo_physics::{Topology, TriMesh};
use std::collections::{HashMap, HashSet};

/// Measurements of a garment at rest on the body it was made for.
#[derive(Debug, Clone, PartialEq)]
pub struct GarmentQuality {
    /// Number of vertices.
    pub vertices: usize,
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
    /// Least signed distance of a vertex to the body [m], positive outside.
    pub least_gap: f64,
    /// Garment triangles that cut a body triangle (exact pairs test).
    pub intersecting_faces: usize,
    /// Share of the faces, by area, that face away from the body.
    pub outward: f64,
}

impl GarmentQuality {
    pub(super) fn measure(rest: &TriMesh, body: &Surface<f64>) -> Self {
        let topology = Topology::new(rest);
        let positions = rest.positions();
        let mut directed = HashSet::with_capacity(rest.face_count() * 3);
        let oriented = rest.faces().iter().all(|f| (0..3).all(|i| directed.insert((f[i], f[(i + 1) % 3]))));
        let mut on_boundary = HashSet::new();
        let simple_loops = topology.boundary_loops.iter().flatten().all(|v| on_boundary.insert(*v));
        let mut lengths: Vec<f64> = topology
            .edges
            .iter()
            .map(|[a, b]| distance(positions[*a as usize], positions[*b as usize]))
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
        let gap: Vec<f64> = gaps.iter().map(|g| g.gap).collect();
        Self {
            vertices: positions.len(),
            components: topology.component_count,
            boundary_loops: topology.boundary_loops.len(),
            euler_characteristic: positions.len() as i64 - topology.edges.len() as i64
                + rest.face_count() as i64,
            is_orientable_manifold: oriented && simple_loops && topology.non_manifold_edges.is_empty(),
            smallest_angle,
            edge_ratio: [lengths[0] / median, lengths[lengths.len() - 1] / median],
            least_gap: gap.iter().copied().fold(f64::MAX, f64::min),
            intersecting_faces: intersecting_faces(rest, &gap, body),
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
        fail(self.intersecting_faces > 0, format!("cuts the body in {} triangles", self.intersecting_faces))?;
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

/// Counts garment faces that cut a body face.
fn intersecting_faces(rest: &TriMesh, gap: &[f64], body: &Surface<f64>) -> usize {
    // A point of a triangle is at most longest/√3 from one of its corners: farther from the body than that it cannot touch.
    let near: Vec<usize> = (0..rest.face_count())
        .filter(|f| {
            let [a, b, c] = rest.corners(*f);
            let longest = distance(a, b).max(distance(b, c)).max(distance(c, a));
            rest.faces()[*f].iter().any(|v| gap[*v as usize] < 0.58 * longest)
        })
        .collect();
    if near.is_empty() {
        return 0;
    }
    const CELL: f64 = 0.03;
    let cells = |triangle: &[[f64; 3]; 3]| -> [std::ops::RangeInclusive<i32>; 3] {
        std::array::from_fn(|axis| {
            let low = triangle.iter().map(|p| p[axis]).fold(f64::MAX, f64::min);
            let high = triangle.iter().map(|p| p[axis]).fold(f64::MIN, f64::max);
            (low / CELL).floor() as i32..=(high / CELL).floor() as i32
        })
    };
    let mut table: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
    for f in &near {
        for_each_cell(cells(&rest.corners(*f)), |cell| table.entry(cell).or_default().push(*f as u32));
    }
    let mut cut = HashSet::new();
    for face in body.faces.iter() {
        let triangle = face.map(|v| body.positions[v as usize]);
        for_each_cell(cells(&triangle), |cell| {
            for f in table.get(&cell).map_or(&[][..], Vec::as_slice) {
                if !cut.contains(f) && triangles_intersect(&rest.corners(*f as usize), &triangle) {
                    cut.insert(*f);
                }
            }
        });
    }
    cut.len()
}

fn for_each_cell(range: [std::ops::RangeInclusive<i32>; 3], mut visit: impl FnMut([i32; 3])) {
    for i in range[0].clone() {
        for j in range[1].clone() {
            for k in range[2].clone() {
                visit([i, j, k]);
            }
        }
    }
}

/// Two triangles cut each other if an edge of one passes through the other.
fn triangles_intersect(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> bool {
    for axis in 0..3 {
        let bounds = |t: &[[f64; 3]; 3]| {
            (t[0][axis].min(t[1][axis]).min(t[2][axis]), t[0][axis].max(t[1][axis]).max(t[2][axis]))
        };
        let ((a0, a1), (b0, b1)) = (bounds(a), bounds(b));
        if a1 < b0 || b1 < a0 {
            return false;
        }
    }
    (0..3).any(|i| segment_hits(a[i], a[(i + 1) % 3], b) || segment_hits(b[i], b[(i + 1) % 3], a))
}

fn segment_hits(p: [f64; 3], q: [f64; 3], triangle: &[[f64; 3]; 3]) -> bool {
    let normal = triangle_normal(*triangle);
    let (from, to) = (dot(normal, sub(p, triangle[0])), dot(normal, sub(q, triangle[0])));
    if (from > 0.0) == (to > 0.0) {
        return false;
    }
    // Signed volumes of the segment with the three edges agree in sign if it passes between them.
    let direction = sub(q, p);
    let volume = |i: usize| dot(direction, cross(sub(triangle[i], p), sub(triangle[(i + 1) % 3], p)));
    let volumes = [volume(0), volume(1), volume(2)];
    volumes.iter().all(|v| *v >= 0.0) || volumes.iter().all(|v| *v <= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_intersect_only_where_they_cross() {
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let through = [[0.2, 0.2, -1.0], [0.3, 0.2, 1.0], [0.2, 0.3, 1.0]];
        let above = through.map(|p| [p[0], p[1], p[2] + 1.5]);
        let beside = through.map(|p| [p[0] + 1.0, p[1], p[2]]);
        assert!(triangles_intersect(&flat, &through) && triangles_intersect(&through, &flat));
        assert!(!triangles_intersect(&flat, &above) && !triangles_intersect(&flat, &beside));
    }
}
