//! Broad phase: the part of the body that clothes can meet. Ten fingers are half of the body's triangles and far from a tight
//! top.

use crate::contact::Triangle;
use crate::vec3::{bounds, is_finite};
use std::ops::Range;

/// Cells in which cloth is looked for (m).
const NEAR_CELL: f64 = 0.05;
/// What lies in a cell with cloth, or so many cells beside one along each axis, is near.
const NEAR_CELLS: usize = 2;
/// Cloth over a box of more cells, 125 m³ here, is near everything.
const MOST_CELLS: f64 = 1e6;

/// Cloth that moves no farther than this (m) meets only faces that are near; a little less than all, for rounding.
pub(super) const NEAR_MARGIN: f64 = NEAR_CELLS as f64 * NEAR_CELL * (1.0 - 1e-9);

/// Which vertices of a surface belong to a face near a triangle of the `cloth`; all where none does. Faces count, however large:
/// none that comes closer than [`NEAR_MARGIN`] is left out.
pub(super) fn near_cloth(points: &[[f64; 3]], surface: &[[u32; 3]], cloth: &[Triangle]) -> Vec<bool> {
    let all = || vec![true; points.len()];
    let Some(mut cells) = Cells::around(cloth) else { return all() };
    cloth.iter().for_each(|triangle| cells.fill(*triangle));
    cells.spread();
    let mut near = vec![false; points.len()];
    for face in surface {
        if cells.meet(face.map(|v| points[v as usize])) {
            face.iter().for_each(|&v| near[v as usize] = true);
        }
    }
    if near.contains(&true) { near } else { all() }
}

/// A box of cells, of which some are full.
struct Cells {
    /// Its lowest corner (m).
    low: [f64; 3],
    count: [usize; 3],
    /// Along z first, then y.
    is_full: Vec<bool>,
}

impl Cells {
    /// Those around all corners of the cloth, with room to spread; `None` for more than [`MOST_CELLS`], or corners that are no
    /// numbers.
    fn around(cloth: &[Triangle]) -> Option<Self> {
        let corners = cloth.as_flattened();
        if !corners.iter().all(|p| is_finite(*p)) {
            return None;
        }
        let (low, high) = bounds(corners.iter().copied());
        // One more than what spreads, for rounding.
        let room = NEAR_CELLS as f64 + 1.0;
        let low = low.map(|x| x - room * NEAR_CELL);
        let sides: [f64; 3] = std::array::from_fn(|k| ((high[k] - low[k]) / NEAR_CELL).floor() + 1.0 + room);
        let is_small = sides.iter().product::<f64>() <= MOST_CELLS;
        let count = sides.map(|side| side as usize);
        is_small.then(|| Self { low, count, is_full: vec![false; count.iter().product()] })
    }

    /// First and one past the last cell along each axis of those that the box around a triangle touches; what is no number
    /// touches all.
    fn touched(&self, corners: Triangle) -> [Range<usize>; 3] {
        let (low, high) = bounds(corners);
        std::array::from_fn(|k| {
            if !corners.iter().all(|corner| corner[k].is_finite()) {
                return 0..self.count[k];
            }
            let cell = |x: f64| ((x - self.low[k]) / NEAR_CELL).floor();
            let first = cell(low[k]).max(0.0) as usize;
            let end = (cell(high[k]) + 1.0).max(0.0) as usize;
            first.min(self.count[k])..end.min(self.count[k])
        })
    }

    /// The cells of a column along z, of all columns in a box.
    fn columns(&self, [x, y, z]: [Range<usize>; 3]) -> impl Iterator<Item = Range<usize>> + use<> {
        let [_, deep, tall] = self.count;
        x.flat_map(move |x| {
            let z = z.clone();
            y.clone().map(move |y| (x * deep + y) * tall).map(move |column| column + z.start..column + z.end)
        })
    }

    fn fill(&mut self, corners: Triangle) {
        for column in self.columns(self.touched(corners)) {
            self.is_full[column].fill(true);
        }
    }

    /// Whether a triangle touches a full cell.
    fn meet(&self, corners: Triangle) -> bool {
        self.columns(self.touched(corners)).any(|column| self.is_full[column].contains(&true))
    }

    /// Fills what is within [`NEAR_CELLS`] cells of a full one along each axis.
    fn spread(&mut self) {
        let [_, deep, tall] = self.count;
        for stride in [1, tall, deep * tall] {
            for _ in 0..NEAR_CELLS {
                let before = self.is_full.clone();
                // There is room around what was filled, so that nothing spreads over an edge of the box.
                for (cell, _) in before.iter().enumerate().filter(|(_, is_full)| **is_full) {
                    self.is_full[cell - stride] = true;
                    self.is_full[cell + stride] = true;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::SplitMix;

    #[test]
    fn faces_within_reach_are_near_and_what_is_far_is_not() {
        let mut random = SplitMix::new(3);
        let mut point = || -> [f64; 3] { std::array::from_fn(|_| random.symmetric()) };
        let triangle = [[0.0; 3], [0.1, 0.0, 0.05], [0.0, 0.12, -0.02]];
        // Tiny faces, one at each of many points.
        let places: Vec<[f64; 3]> = (0..2000).map(|_| point()).collect();
        let points: Vec<[f64; 3]> = places.iter().flat_map(|p| [*p; 3]).collect();
        let faces: Vec<[u32; 3]> = (0..2000).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        let near = |cloth: &Triangle| near_cloth(&points, &faces, &[*cloth]);
        let distance = |p: &[f64; 3]| {
            let outside = (0..3).map(|k| {
                let [low, high] =
                    [f64::min, f64::max].map(|pick| triangle.iter().map(|t| t[k]).reduce(pick).unwrap());
                (low - p[k]).max(p[k] - high).max(0.0)
            });
            outside.fold(0.0, f64::max)
        };
        for (p, near) in points.iter().zip(near(&triangle)) {
            assert!(near || distance(p) >= NEAR_MARGIN);
            assert!(!near || distance(p) <= NEAR_MARGIN + NEAR_CELL);
        }
        let huge = [[-900.0; 3], [900.0, 0.0, 0.0], [0.0, 900.0, 0.0]];
        assert!(near(&huge).iter().all(|n| *n));
        let far = triangle.map(|p| p.map(|x| x + 50.0));
        assert!(near(&far).iter().all(|n| *n), "a body that is nowhere near is taken whole");
    }

    /// No corner of the large face is anywhere near the cloth that intersects its middle.
    #[test]
    fn a_coarse_body_is_near_by_its_faces() {
        let points = [
            [-1.0, -1.0, 0.0],
            [2.0, -1.0, 0.0],
            [-1.0, 2.0, 0.0],
            [3.0; 3],
            [3.1, 3.0, 3.0],
            [3.0, 3.1, 3.0],
        ];
        let triangle = [[0.0, 0.0, -0.01], [0.02, 0.0, 0.01], [0.0, 0.02, 0.01]];
        let near = near_cloth(&points, &[[0, 1, 2], [3, 4, 5]], &[triangle]);
        assert_eq!(near, [true, true, true, false, false, false]);
    }
}
