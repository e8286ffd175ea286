//! A garment as the placement search sees it, in the file's coordinates.

use super::samples::Samples;
use crate::mesh::bounds;
use clothcombo_physics::Topology;
use clothcombo_physics::vec3::{norm, sub};

/// Sample points for the coarse and for the fine search.
const COARSE: usize = 200;
const FINE: usize = 1000;
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
    pub coarse: Samples,
    pub fine: Samples,
}

impl<'a> Cloth<'a> {
    pub fn new(positions: &'a [[f64; 3]], faces: &'a [[u32; 3]], topology: &'a Topology) -> Self {
        let samples = |count| Samples::new(positions, faces, count);
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
            coarse: samples(COARSE),
            fine: samples(FINE),
        }
    }

    /// The same at other positions, such as another size.
    pub fn moved<'b>(&self, positions: &'b [[f64; 3]]) -> Cloth<'b>
    where
        'a: 'b,
    {
        Cloth::new(positions, self.faces, self.topology)
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
