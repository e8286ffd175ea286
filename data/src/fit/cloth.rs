//! A garment as the placement search sees it, in the file's coordinates.

use super::samples::Samples;

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
    pub coarse: Samples,
    pub fine: Samples,
}

impl<'a> Cloth<'a> {
    pub fn new(positions: &'a [[f64; 3]], faces: &'a [[u32; 3]], borders: &'a [Vec<u32>]) -> Self {
        let samples = |count| Samples::new(positions, faces, count);
        Self { positions, faces, borders, coarse: samples(COARSE), fine: samples(FINE) }
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
