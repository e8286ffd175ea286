//! Which part of the body clothes can meet: a tight top asks nothing of ten fingers, which are half of the body's triangles.

use std::collections::HashSet;

/// Cells in which cloth is looked for [m].
const CELL: f64 = 0.05;
/// What lies in a cell with cloth, or so many cells beside one along each axis, is near.
const REACH: i64 = 2;
/// A triangle over more cells is near everything.
const MOST_CELLS: f64 = 4096.0;

/// So far cloth may move [m] and still meet nothing of the body but what is near; a little less than all, for rounding.
pub(super) const MARGIN: f64 = REACH as f64 * CELL * (1.0 - 1e-9);

/// Which vertices of a surface belong to a face near a triangle of the cloth, given as positions and faces of each garment;
/// all where none does. Faces count, however large: none that comes closer than [`MARGIN`] is left out.
pub(super) fn near_cloth(
    points: &[[f64; 3]],
    surface: &[[u32; 3]],
    cloth: &[(&[[f64; 3]], &[[u32; 3]])],
) -> Vec<bool> {
    let mut cells: HashSet<[i64; 3]> = HashSet::new();
    for (positions, faces) in cloth {
        for face in *faces {
            match cells_of(face.map(|v| positions[v as usize])) {
                Some(found) => cells.extend(found),
                None => return vec![true; points.len()],
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
    let mut near = vec![false; points.len()];
    for face in surface {
        let mut found = cells_of(face.map(|v| points[v as usize]));
        if found.as_mut().is_none_or(|found| found.any(|cell| cells.contains(&cell))) {
            face.iter().for_each(|&v| near[v as usize] = true);
        }
    }
    if near.contains(&true) { near } else { vec![true; points.len()] }
}

/// The cells that the box around a triangle touches; `None` for more than [`MOST_CELLS`], or corners that are no numbers.
fn cells_of(corners: [[f64; 3]; 3]) -> Option<impl Iterator<Item = [i64; 3]>> {
    let cell = |x: f64| (x / CELL).floor() as i64;
    let bound = |pick: fn(f64, f64) -> f64| -> [i64; 3] {
        std::array::from_fn(|k| cell(pick(pick(corners[0][k], corners[1][k]), corners[2][k])))
    };
    let (low, high) = (bound(f64::min), bound(f64::max));
    let count: f64 = (0..3).map(|k| high[k] as f64 - low[k] as f64 + 1.0).product();
    let is_small = count <= MOST_CELLS && corners.as_flattened().iter().all(|x| x.is_finite());
    let [x, y, z] = [0, 1, 2].map(|k| low[k]..=high[k]);
    let columns = move || x.flat_map(move |x| y.clone().map(move |y| [x, y]));
    is_small.then(|| columns().flat_map(move |[x, y]| z.clone().map(move |z| [x, y, z])))
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
        let near = |cloth: &[[f64; 3]]| near_cloth(&points, &faces, &[(cloth, &[[0, 1, 2]])]);
        let distance = |p: &[f64; 3]| {
            let outside = (0..3).map(|k| {
                let [low, high] =
                    [f64::min, f64::max].map(|pick| triangle.iter().map(|t| t[k]).reduce(pick).unwrap());
                (low - p[k]).max(p[k] - high).max(0.0)
            });
            outside.fold(0.0, f64::max)
        };
        for (p, near) in points.iter().zip(near(&triangle)) {
            assert!(near || distance(p) >= MARGIN);
            assert!(!near || distance(p) <= MARGIN + CELL);
        }
        let huge = [[-900.0; 3], [900.0, 0.0, 0.0], [0.0, 900.0, 0.0]];
        assert!(near(&huge).iter().all(|n| *n));
        let far = triangle.map(|p| p.map(|x| x + 50.0));
        assert!(near(&far).iter().all(|n| *n), "a body that is nowhere near is taken whole");
    }

    /// No corner of the large face is anywhere near the cloth that crosses its middle.
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
        let near = near_cloth(&points, &[[0, 1, 2], [3, 4, 5]], &[(&triangle, &[[0, 1, 2]])]);
        assert_eq!(near, [true, true, true, false, false, false]);
    }
}
