//! A garment as the placement search sees it, in the file's coordinates.

use crate::mesh::{bounds, triangle_normal};
use clothcombo_physics::Topology;
use clothcombo_physics::vec3::{add, norm, scale, sub};

/// Sample points for the coarse and for the fine search.
const COARSE_SAMPLES: usize = 200;
const FINE_SAMPLES: usize = 1000;
/// Points of a border that are looked at, about.
const BORDER_POINTS: usize = 60;

/// A garment in the file's coordinates.
pub(super) struct Cloth<'a> {
    pub positions: &'a [[f64; 3]],
    pub faces: &'a [[u32; 3]],
    /// Vertices of each border, in order.
    pub borders: &'a [Vec<u32>],
    /// Their lengths.
    pub border_lengths: Vec<f64>,
    pub topology: &'a Topology,
    /// Points spread evenly over its area, for the coarse and for the fine search.
    pub coarse: Vec<[f64; 3]>,
    pub fine: Vec<[f64; 3]>,
}

impl<'a> Cloth<'a> {
    pub fn new(positions: &'a [[f64; 3]], faces: &'a [[u32; 3]], topology: &'a Topology) -> Self {
        let borders = &topology.boundary_loops;
        let length = |border: &Vec<u32>| {
            let next = border.iter().cycle().skip(1);
            let edges = border.iter().zip(next).map(|(a, b)| [a, b].map(|v| positions[*v as usize]));
            edges.map(|[a, b]| norm(sub(b, a))).sum()
        };
        let border_lengths = borders.iter().map(length).collect();
        Self {
            positions,
            faces,
            borders,
            border_lengths,
            topology,
            coarse: spread_over(positions, faces, COARSE_SAMPLES),
            fine: spread_over(positions, faces, FINE_SAMPLES),
        }
    }

    /// Largest extent in the file's unit.
    pub fn extent(&self) -> f64 {
        let [low, high] = bounds(self.positions);
        (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max)
    }

    /// The connected piece that a border belongs to.
    pub fn piece(&self, border: usize) -> u32 {
        self.piece_of_vertex(self.borders[border][0])
    }

    /// The connected piece of a vertex.
    pub fn piece_of_vertex(&self, vertex: u32) -> u32 {
        self.topology.component_of_vertex[vertex as usize]
    }

    /// Whether no piece has more than two openings: hats, socks and sleeves have not.
    pub fn is_tubes(&self) -> bool {
        let mut openings = vec![0; self.topology.component_count];
        (0..self.borders.len()).for_each(|border| openings[self.piece(border) as usize] += 1);
        openings.iter().all(|count| *count <= 2)
    }

    /// Positions of a border's vertices.
    pub fn border(&self, border: usize) -> Vec<[f64; 3]> {
        self.borders[border].iter().map(|v| self.positions[*v as usize]).collect()
    }

    /// Some of them.
    pub fn border_points(&self, border: usize) -> Vec<[f64; 3]> {
        let stride = self.borders[border].len().div_ceil(BORDER_POINTS);
        self.border(border).into_iter().step_by(stride.max(1)).collect()
    }
}

/// `count` points spread evenly over the area of a surface.
pub(super) fn spread_over(positions: &[[f64; 3]], faces: &[[u32; 3]], count: usize) -> Vec<[f64; 3]> {
    let corners = |f: &[u32; 3]| f.map(|v| positions[v as usize]);
    let mut sum = 0.0;
    let cumulative: Vec<f64> = (faces.iter())
        .map(|f| {
            sum += norm(triangle_normal(corners(f)));
            sum
        })
        .collect();
    let point = |k: usize| {
        let wanted = (k as f64 + 0.5) / count as f64 * sum;
        let face = cumulative.partition_point(|s| *s < wanted).min(faces.len() - 1);
        let [a, b, c] = corners(&faces[face]);
        // A low-discrepancy sequence folded into the triangle.
        let (u, v) = ((k as f64 * 0.754_877_666).fract(), (k as f64 * 0.569_840_291).fract());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        add(a, add(scale(sub(b, a), u), scale(sub(c, a), v)))
    };
    (0..count).map(point).collect()
}
