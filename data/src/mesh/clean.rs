//! Polygons of any file → triangles over welded vertices, each remembering where it came from.

use super::triangle::{smallest_sine, triangle_normal};
use clothcombo_physics::mesh::DisjointSets;
use clothcombo_physics::vec3::{cross, dot, norm, norm_squared, sub};
use std::collections::{HashMap, HashSet};

/// Vertices closer than this share of a mesh's diagonal are one.
pub const WELD_SHARE: f64 = 1e-5;

/// Faces whose edges have a cross product shorter than this share of the squared diagonal have no area.
pub const AREA_SHARE: f64 = 1e-10;

/// Lowest and highest coordinates of some points.
pub fn bounds<'a>(points: impl IntoIterator<Item = &'a [f64; 3]>) -> [[f64; 3]; 2] {
    let empty = [[f64::MAX; 3], [f64::MIN; 3]];
    points.into_iter().fold(empty, |[low, high], p| {
        [std::array::from_fn(|a| low[a].min(p[a])), std::array::from_fn(|a| high[a].max(p[a]))]
    })
}

/// The vertices that `faces` use, in order of first use, and the faces over these.
pub fn compact(faces: impl IntoIterator<Item = [u32; 3]>, vertices: usize) -> (Vec<u32>, Vec<[u32; 3]>) {
    let (mut number, mut used) = (vec![u32::MAX; vertices], Vec::new());
    let mut renumbered = |v: u32| {
        let slot = &mut number[v as usize];
        if *slot == u32::MAX {
            *slot = used.len() as u32;
            used.push(v);
        }
        *slot
    };
    let faces = faces.into_iter().map(|face| face.map(&mut renumbered)).collect();
    (used, faces)
}

/// The vertices that faces hang together by.
pub fn pieces<'a>(faces: impl IntoIterator<Item = &'a [u32; 3]>, vertices: usize) -> DisjointSets {
    let mut pieces = DisjointSets::new(vertices);
    for [a, b, c] in faces {
        pieces.join(*a, *b);
        pieces.join(*a, *c);
    }
    pieces
}

/// Length of the diagonal of the bounding box.
pub fn diagonal(positions: &[[f64; 3]]) -> f64 {
    let [low, high] = bounds(positions);
    if positions.is_empty() { 0.0 } else { norm(sub(high, low)) }
}

/// A polygon as triangles around its corner `first`.
pub fn fan(polygon: &[u32], first: usize) -> impl Iterator<Item = [u32; 3]> + '_ {
    let count = polygon.len();
    (1..count.saturating_sub(1)).map(move |i| [0, i, i + 1].map(|k| polygon[(first + k) % count]))
}

/// Where polygons of more than three corners were cut: another one over the same corners, however it begins and runs, is cut into
/// the same triangles, so that [`clean_faces`] finds it.
#[derive(Debug, Default)]
pub struct Cuts(HashMap<Vec<u32>, u32>);

impl Cuts {
    /// The corner of `polygon` to cut it from: that of an earlier one, or `own`.
    pub fn first(&mut self, polygon: &[u32], own: impl FnOnce() -> usize) -> usize {
        if polygon.len() < 4 {
            return 0;
        }
        let mut corners = polygon.to_vec();
        corners.sort_unstable();
        let vertex = *self.0.entry(corners).or_insert_with(|| polygon[own()]);
        polygon.iter().position(|v| *v == vertex).unwrap_or(0)
    }
}

/// A quad is cut by its second diagonal where the first one folds it, or the second leaves a smallest angle with a sine this many
/// times larger: every reader of quads takes the first one, and a quad that is nearly a rectangle must not change with rounding.
const WORTH_ANOTHER: f64 = 2.0;

/// Triangles of polygons.
#[derive(Debug, Default)]
pub struct Triangulated {
    /// Triangles, those of one polygon one after the other.
    pub faces: Vec<[u32; 3]>,
    /// The polygon that each of them is part of.
    pub polygon: Vec<u32>,
    /// For each corner of a triangle the corner of that polygon.
    pub corners: Vec<[u32; 3]>,
}

/// Cuts polygons into fans around their first corner; quads around their second one where that is much better.
pub fn triangulate<'a>(
    positions: &[[f64; 3]],
    polygons: impl IntoIterator<Item = &'a [u32]>,
) -> Triangulated {
    let (mut result, mut cuts) = (Triangulated::default(), Cuts::default());
    for (number, polygon) in polygons.into_iter().enumerate() {
        let count = polygon.len() as u32;
        let fan_around = |first: u32| {
            (1..count.saturating_sub(1)).map(move |i| [0, i, i + 1].map(|k| (first + k) % count))
        };
        let worst = |first: u32| {
            let sine = |t: [u32; 3]| smallest_sine(t.map(|k| positions[polygon[k as usize] as usize]));
            fan_around(first).map(sine).fold(f64::MAX, f64::min)
        };
        let is_folded = |first: u32| {
            let normal = |t: [u32; 3]| triangle_normal(t.map(|k| positions[polygon[k as usize] as usize]));
            let normals: Vec<[f64; 3]> = fan_around(first).map(normal).collect();
            normals.windows(2).any(|pair| dot(pair[0], pair[1]) < 0.0)
        };
        let is_better = || worst(1) > WORTH_ANOTHER * worst(0) || is_folded(0);
        let own = || usize::from(count == 4 && is_better() && !is_folded(1));
        let first = cuts.first(polygon, own) as u32;
        for triangle in fan_around(first) {
            result.faces.push(triangle.map(|k| polygon[k as usize]));
            result.corners.push(triangle);
        }
        result.polygon.resize(result.faces.len(), number as u32);
    }
    result
}

/// Vertices with near ones merged into the first of them.
#[derive(Debug)]
pub struct Welded {
    /// Positions that are left.
    pub positions: Vec<[f64; 3]>,
    /// For each of them the vertex it was.
    pub origin: Vec<u32>,
    /// For each old vertex its new number.
    pub number: Vec<u32>,
    /// Old vertices that became another one.
    pub merged: Vec<u32>,
}

/// Merges every vertex into the first one closer than `distance`.
pub fn weld(positions: &[[f64; 3]], distance: f64) -> Welded {
    let cell = |p: [f64; 3]| p.map(|x| (x / distance).floor() as i64);
    let mut grid: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut welded = Welded {
        positions: Vec::new(),
        origin: Vec::new(),
        number: Vec::with_capacity(positions.len()),
        merged: Vec::new(),
    };
    for (v, p) in positions.iter().enumerate() {
        let c = cell(*p);
        let mut near = None;
        'search: for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    let beside = [c[0].saturating_add(dx), c[1].saturating_add(dy), c[2].saturating_add(dz)];
                    for w in grid.get(&beside).into_iter().flatten() {
                        if norm_squared(sub(welded.positions[*w as usize], *p)) < distance * distance {
                            near = Some(*w);
                            break 'search;
                        }
                    }
                }
            }
        }
        match near {
            Some(w) => {
                welded.number.push(w);
                welded.merged.push(v as u32);
            }
            None => {
                let w = welded.positions.len() as u32;
                welded.number.push(w);
                welded.positions.push(*p);
                welded.origin.push(v as u32);
                grid.entry(c).or_default().push(w);
            }
        }
    }
    welded
}

/// Which faces stay.
#[derive(Debug, Default)]
pub struct CleanFaces {
    /// Indices of the faces that stay.
    pub kept: Vec<u32>,
    /// Faces without area.
    pub degenerate: Vec<u32>,
    /// Faces with the three vertices of an earlier one.
    pub repeated: Vec<u32>,
}

/// Sorts out faces that name a vertex twice, whose edges' cross product is not longer than `least_cross` (twice the area), or
/// that were there before.
pub fn clean_faces(positions: &[[f64; 3]], faces: &[[u32; 3]], least_cross: f64) -> CleanFaces {
    let mut clean = CleanFaces::default();
    let mut seen = HashSet::with_capacity(faces.len());
    for (number, f) in faces.iter().enumerate() {
        let [a, b, c] = f.map(|v| positions[v as usize]);
        let mut key = *f;
        key.sort_unstable();
        let collapsed = key[0] == key[1] || key[1] == key[2];
        let list = if collapsed || norm(cross(sub(b, a), sub(c, a))) <= least_cross {
            &mut clean.degenerate
        } else if !seen.insert(key) {
            &mut clean.repeated
        } else {
            &mut clean.kept
        };
        list.push(number as u32);
    }
    clean
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quads_take_the_better_diagonal_and_every_triangle_knows_its_polygon() {
        let positions =
            [[0.0, 0.0, 0.0], [1.0, -0.02, 0.0], [2.0, 0.0, 0.0], [1.0, 0.5, 0.0], [0.0, 9.0, 0.0]];
        let polygons = [&[0u32, 1, 2, 3][..], &[0, 2, 4], &[0, 1, 2, 3, 4]];
        let made = triangulate(&positions, polygons);
        assert_eq!(made.faces, [[1, 2, 3], [1, 3, 0], [0, 2, 4], [0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        assert_eq!(made.polygon, [0, 0, 1, 2, 2, 2]);
        assert_eq!(made.corners[..3], [[1, 2, 3], [1, 3, 0], [0, 1, 2]]);
        // Concave at its second corner: the first diagonal runs outside. A rectangle keeps its first one, however it is rounded.
        let dart = [[0.0, 0.0, 0.0], [1.0, 0.8, 0.0], [2.0, 0.0, 0.0], [1.0, 2.0, 0.0]];
        assert_eq!(triangulate(&dart, [&[0u32, 1, 2, 3][..]]).faces, [[1, 2, 3], [1, 3, 0]]);
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.1, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(triangulate(&square, [&[0u32, 1, 2, 3][..]]).faces, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn polygons_over_the_same_corners_are_cut_into_the_same_triangles() {
        let corners: Vec<[f64; 3]> =
            (0..5).map(|k| f64::from(k) * 1.2).map(|angle| [angle.cos(), angle.sin(), 0.0]).collect();
        for count in [4, 5] {
            let polygon: Vec<u32> = (0..count).collect();
            for start in 0..count as usize {
                let mut again = polygon.clone();
                again.rotate_left(start);
                let reversed: Vec<u32> = again.iter().rev().copied().collect();
                for again in [again, reversed] {
                    let cut = triangulate(&corners, [polygon.as_slice(), &again]);
                    let each = count - 2;
                    let clean = clean_faces(&corners, &cut.faces, 1e-10);
                    assert_eq!(clean.repeated, (each..2 * each).collect::<Vec<_>>(), "{again:?}");
                    for (face, corners) in cut.faces.iter().zip(&cut.corners).skip(each as usize) {
                        assert_eq!(corners.map(|k| again[k as usize]), *face);
                    }
                }
            }
        }
    }

    #[test]
    fn near_vertices_become_the_first_of_them() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [1e-6, 0.0, -1e-6], [1.0 + 2e-5, 0.0, 0.0]];
        let welded = weld(&positions, 1e-5);
        assert_eq!(welded.origin, [0, 1, 3]);
        assert_eq!(welded.number, [0, 1, 0, 2]);
        assert_eq!(welded.merged, [2]);
    }

    #[test]
    fn collapsed_flat_and_repeated_faces_are_told_apart() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0]];
        let clean = clean_faces(&positions, &[[0, 1, 2], [0, 1, 1], [0, 1, 3], [2, 1, 0], [1, 3, 2]], 1e-10);
        assert_eq!(clean.kept, [0, 4]);
        assert_eq!(clean.degenerate, [1, 2]);
        assert_eq!(clean.repeated, [3]);
    }
}
