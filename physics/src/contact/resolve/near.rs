//! Which part of the body clothes can meet: a tight top asks nothing of ten fingers, which are half of the body's triangles.

use std::collections::HashSet;

/// What is within one or two cells of cloth, along each axis, is near [m].
const CELL: f64 = 0.05;
/// Cells on each side.
const REACH: i64 = 2;
/// A triangle over more cells is near everything.
const MOST_CELLS: f64 = 4096.0;

/// Which points are near a triangle of the cloth, given as positions and faces of each garment; all where none is.
pub(super) fn near_cloth(points: &[[f64; 3]], cloth: &[(&[[f64; 3]], &[[u32; 3]])]) -> Vec<bool> {
    let cell = |x: f64| (x / CELL).floor() as i64;
    let mut cells: HashSet<[i64; 3]> = HashSet::new();
    for (positions, faces) in cloth {
        for corners in faces.iter().map(|face| face.map(|v| positions[v as usize])) {
            let low: [i64; 3] =
                std::array::from_fn(|k| cell(corners[0][k].min(corners[1][k]).min(corners[2][k])));
            let high: [i64; 3] =
                std::array::from_fn(|k| cell(corners[0][k].max(corners[1][k]).max(corners[2][k])));
            if (0..3).map(|k| (high[k] - low[k] + 1) as f64).product::<f64>() > MOST_CELLS {
                return vec![true; points.len()];
            }
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    cells.extend((low[2]..=high[2]).map(|z| [x, y, z]));
                }
            }
        }
    }
    for axis in 0..3 {
        let spread = |cell: &[i64; 3]| {
            let cell = *cell;
            (-REACH..=REACH).map(move |by| {
                let mut moved = cell;
                moved[axis] += by;
                moved
            })
        };
        cells = cells.iter().flat_map(spread).collect();
    }
    let near: Vec<bool> = points.iter().map(|p| cells.contains(&p.map(cell))).collect();
    if near.contains(&true) { near } else { vec![true; points.len()] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::SplitMix;

    #[test]
    fn what_is_within_reach_is_near_and_what_is_far_is_not() {
        let mut random = SplitMix::new(3);
        let mut point = || -> [f64; 3] { std::array::from_fn(|_| random.symmetric()) };
        let triangle = [[0.0; 3], [0.1, 0.0, 0.05], [0.0, 0.12, -0.02]];
        let points: Vec<[f64; 3]> = (0..2000).map(|_| point()).collect();
        let near = near_cloth(&points, &[(&triangle, &[[0, 1, 2]])]);
        let distance = |p: &[f64; 3]| {
            let outside = (0..3).map(|k| {
                let [low, high] =
                    [f64::min, f64::max].map(|pick| triangle.iter().map(|t| t[k]).reduce(pick).unwrap());
                (low - p[k]).max(p[k] - high).max(0.0)
            });
            outside.fold(0.0, f64::max)
        };
        for (p, near) in points.iter().zip(near) {
            assert!(near || distance(p) >= REACH as f64 * CELL);
            assert!(!near || distance(p) <= (REACH + 1) as f64 * CELL);
        }
        let huge = [[-900.0; 3], [900.0, 0.0, 0.0], [0.0, 900.0, 0.0]];
        assert!(near_cloth(&points, &[(&huge, &[[0, 1, 2]])]).iter().all(|n| *n));
        let far = triangle.map(|p| p.map(|x| x + 50.0));
        assert!(near_cloth(&points, &[(&far, &[[0, 1, 2]])]).iter().all(|n| *n));
    }
}
