//! Points sorted into cells, for sums over all pairs within a radius.

use crate::real::Real;
use crate::vec3::{bounds, is_finite, to_f64};

/// Cells per radius where points are sparse and where they are dense: smaller cells fit the sphere better, and cost more
/// look-ups and longer lists per point.
const CELLS_PER_RADIUS: [i64; 2] = [2, 4];

/// Points per occupied coarse cell from which the finer cells are used.
const DENSE: usize = 48;

/// Cells are larger than the radius asks for by this share: a pair that rounding puts inside the radius is not missed.
const CELL_SLACK: f64 = 1e-6;

/// Points sorted by cell. Cells are kept as a sorted list, not as an array: one vertex far away costs nothing.
pub(crate) struct CellGrid<T> {
    /// Original index of every sorted point; points that are not finite are left out.
    pub(crate) order: Vec<u32>,
    pub(crate) points: Vec<[T; 3]>,
    /// The same points, one list per axis.
    pub(crate) axes: [Vec<T>; 3],
    per_radius: i64,
    /// Key and first point of every occupied cell, ascending; a larger key and the end of the last cell follow.
    cells: Vec<(u64, u32)>,
}

/// Bits per axis of a cell key.
const KEY_BITS: u32 = 21;

/// Rows start here, so that the neighbours of the first cell have keys too.
const KEY_MARGIN: i64 = CELLS_PER_RADIUS[1];

impl<T: Real> CellGrid<T> {
    /// Sorts `positions` (m) for sums over pairs closer than `radius` (m).
    pub(crate) fn new(positions: &[[T; 3]], radius: f64) -> Self {
        let [coarse, fine] = CELLS_PER_RADIUS;
        let grid = Self::with_cells(positions, radius, coarse);
        let is_dense = grid.order.len() > DENSE * grid.cell_count();
        if is_dense { Self::with_cells(positions, radius, fine) } else { grid }
    }

    fn with_cells(positions: &[[T; 3]], radius: f64, per_radius: i64) -> Self {
        let finite = positions.iter().filter(|p| is_finite(**p));
        let (low, _) = bounds(finite.map(|p| to_f64(*p)));
        let per_metre = per_radius as f64 / (radius * (1.0 + CELL_SLACK));
        // Beyond 2 million cells along an axis, points share the last cell: slower, still right.
        let last = (1i64 << KEY_BITS) - 1 - 2 * KEY_MARGIN;
        let mut keyed: Vec<(u64, u32)> = positions
            .iter()
            .enumerate()
            .filter(|(_, p)| is_finite(**p))
            .map(|(v, p)| {
                let p = to_f64(*p);
                let cell = std::array::from_fn(|k| {
                    KEY_MARGIN + (((p[k] - low[k]) * per_metre) as i64).clamp(0, last)
                });
                (key(cell), v as u32)
            })
            .collect();
        keyed.sort_unstable();
        let mut cells: Vec<(u64, u32)> = Vec::new();
        for (k, &(key, _)) in keyed.iter().enumerate() {
            if cells.last().is_none_or(|&(last, _)| last != key) {
                cells.push((key, k as u32));
            }
        }
        cells.push((u64::MAX, keyed.len() as u32));
        let order: Vec<u32> = keyed.iter().map(|&(_, v)| v).collect();
        let points: Vec<[T; 3]> = order.iter().map(|&v| positions[v as usize]).collect();
        let axes = [0, 1, 2].map(|axis| points.iter().map(|p| p[axis]).collect());
        Self { order, points, axes, per_radius, cells }
    }

    /// Number of occupied cells.
    pub(crate) fn cell_count(&self) -> usize {
        self.cells.len() - 1
    }

    /// The sorted points of a cell.
    pub(crate) fn range(&self, cell: usize) -> std::ops::Range<usize> {
        self.cells[cell].1 as usize..self.cells[cell + 1].1 as usize
    }

    /// Calls `visit` with the points of the cells that come closer to `cell` than the radius, in order; a row of cells along x
    /// is one range.
    pub(crate) fn for_each_range_around(&self, cell: usize, mut visit: impl FnMut(std::ops::Range<usize>)) {
        let mask = (1i64 << KEY_BITS) - 1;
        let key_here = self.cells[cell].0 as i64;
        let [x, y, z] = [key_here & mask, (key_here >> KEY_BITS) & mask, key_here >> (2 * KEY_BITS)];
        let reach = self.per_radius;
        // Whole cells between two cells that are `offset` cells apart.
        let between = |offset: i64| (offset.abs() - 1).max(0);
        for dz in -reach..=reach {
            for dy in -reach..=reach {
                let left = reach * reach - between(dy).pow(2) - between(dz).pow(2);
                let Some(dx) = (0..=reach).rev().find(|&dx| between(dx).pow(2) < left) else { continue };
                let (first, last) = (key([x - dx, y + dy, z + dz]), key([x + dx, y + dy, z + dz]));
                let from = self.cells.partition_point(|&(k, _)| k < first);
                let to = from + self.cells[from..].iter().take_while(|&&(k, _)| k <= last).count();
                if from < to {
                    visit(self.cells[from].1 as usize..self.cells[to].1 as usize);
                }
            }
        }
    }
}

/// Cells in rows along x, rows in layers along y. Coordinates are within `KEY_MARGIN` of a valid cell, hence not negative.
fn key([x, y, z]: [i64; 3]) -> u64 {
    ((z << (2 * KEY_BITS)) | (y << KEY_BITS) | x) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::vec3;

    #[test]
    fn every_point_within_the_radius_is_among_the_candidates() {
        let radius = 0.1;
        for columns in [12, 80] {
            let mut points =
                shapes::irregular_grid(0.5, 0.6, columns, columns + 2, 0.3, 1).positions().to_vec();
            // Far outliers, one of them beyond the last cell, and one that is nowhere.
            points.extend([[-3.0, 2.0, 40.0], [1e9, 0.0, 0.0], [1e9, 0.05, 0.0], [f64::NAN, 0.0, 0.0]]);
            let grid = CellGrid::new(&points, radius);
            assert_eq!(grid.order.len(), points.len() - 1);
            assert_eq!(grid.per_radius, if columns == 12 { 2 } else { 4 });
            for cell in 0..grid.cell_count() {
                let mut found = vec![0; points.len()];
                grid.for_each_range_around(cell, |range| {
                    for &v in &grid.order[range] {
                        found[v as usize] += 1;
                    }
                });
                for p in &grid.points[grid.range(cell)] {
                    for (v, q) in points.iter().enumerate() {
                        let close = vec3::distance_squared(*p, *q) < radius * radius;
                        assert!(found[v] == 1 || (found[v] == 0 && !close), "{v} {}", found[v]);
                    }
                }
            }
        }
    }
}
