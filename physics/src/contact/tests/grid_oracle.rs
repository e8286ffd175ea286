//! Intersections of triangles on an integer grid: an oracle that shares no formula with the predicates of
//! the library.
//!
//! Separating axes in 128-bit integers. Coordinates below 2²² keep every product below 2¹²⁰.

/// A point on the grid.
pub type GridPoint = [i128; 3];

fn sub(a: GridPoint, b: GridPoint) -> GridPoint {
    std::array::from_fn(|k| a[k] - b[k])
}

fn dot(a: GridPoint, b: GridPoint) -> i128 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

fn cross(a: GridPoint, b: GridPoint) -> GridPoint {
    std::array::from_fn(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
}

fn normal(t: &[GridPoint]) -> GridPoint {
    cross(sub(t[1], t[0]), sub(t[2], t[0]))
}

/// Whether a triangle or segment `a` and a triangle `b` share a point: no axis that could separate them does.
pub fn meet(a: &[GridPoint], b: &[GridPoint; 3]) -> bool {
    let edges = |p: &[GridPoint]| -> Vec<GridPoint> {
        (0..p.len()).map(|i| sub(p[(i + 1) % p.len()], p[i])).collect()
    };
    let mut axes = vec![normal(b)];
    if a.len() == 3 {
        axes.push(normal(a));
    }
    for e in edges(a) {
        axes.extend(edges(b).into_iter().map(|f| cross(e, f)));
        axes.push(cross(normal(b), e));
    }
    axes.extend(edges(b).into_iter().map(|f| cross(normal(b), f)));
    axes.iter().filter(|axis| **axis != [0; 3]).all(|&axis| {
        let range = |points: &[GridPoint]| {
            let along = || points.iter().map(|&p| dot(axis, p));
            (along().min(), along().max())
        };
        let ((a_low, a_high), (b_low, b_high)) = (range(a), range(b));
        a_low <= b_high && b_low <= a_high
    })
}

/// As [`triangles_intersect`](super::triangles_intersect) of the library.
pub fn triangles_intersect(a: &[GridPoint; 3], b: &[GridPoint; 3]) -> bool {
    normal(a) != [0; 3] && normal(b) != [0; 3] && meet(a, b)
}

/// As its namesake in the library for two faces of a mesh; `meet_beyond` decides of two triangles that share
/// their first corner alone.
pub fn mesh_triangles_intersect(
    points: &[GridPoint],
    [fa, fb]: [[u32; 3]; 2],
    meet_beyond: impl Fn(&[GridPoint; 3], &[GridPoint; 3]) -> bool,
) -> bool {
    let corners = |face: [u32; 3]| face.map(|v| points[v as usize]);
    let (a, b) = (corners(fa), corners(fb));
    if normal(&a) == [0; 3] || normal(&b) == [0; 3] {
        return false;
    }
    let common: Vec<u32> = fa.into_iter().filter(|v| fb.contains(v)).collect();
    let others =
        |face: [u32; 3]| face.into_iter().filter(|v| !common.contains(v)).map(|v| points[v as usize]);
    match common[..] {
        [] => meet(&a, &b),
        [v] => {
            let [first, second] = [fa, fb].map(|face| {
                let rest: Vec<GridPoint> = others(face).collect();
                [points[v as usize], rest[0], rest[1]]
            });
            meet_beyond(&first, &second)
        }
        [u, v] => {
            let (u, v) = (points[u as usize], points[v as usize]);
            let heights = [fa, fb].map(|face| others(face).map(|p| cross(sub(v, u), sub(p, u))).next());
            let [Some(n), Some(m)] = heights else { return false };
            cross(n, m) == [0; 3] && dot(n, m) > 0
        }
        _ => true,
    }
}
