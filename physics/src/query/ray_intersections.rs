//! Winding numbers of closed surfaces, by the faces that a ray intersects.

use crate::rows::CompressedRows;
use crate::vec3::{bounds, cross, dot, sub};

/// Cells of the grid for each face, at most…
const CELLS_PER_FACE: f64 = 0.5;
/// …and entries in them: larger faces are in more cells, and a coarser grid is taken then.
const ENTRIES_PER_FACE: usize = 16;

/// Winding numbers of a closed surface, by the faces that a ray along +x intersects.
///
/// Which faces it intersects is decided edge by edge, each with the same numbers from both of its faces: on a closed surface no
/// intersection is missed or counted twice, whatever the rounding.
#[derive(Debug)]
pub(super) struct RayIntersections {
    positions: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
    /// Sides of a grid over y and z. Built in O(F), where a tree takes O(F log F): every body in another pose asks a few hundred
    /// questions only.
    axes: [GridAxis; 2],
    /// The faces whose boxes touch every cell.
    cells: CompressedRows<u32>,
}

impl RayIntersections {
    /// `positions` `[V, 3]` (m), `faces` `[F, 3]` whose corners are finite.
    pub fn new(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Self {
        let boxes: Vec<([f64; 3], [f64; 3])> =
            faces.iter().map(|face| bounds(face.map(|v| positions[v as usize]))).collect();
        let (low, high) = bounds(boxes.iter().flat_map(|(low, high)| [*low, *high]));
        let [long, wide] = [1, 2].map(|k| (high[k] - low[k]).max(0.0));
        let mut cells = CELLS_PER_FACE * faces.len() as f64;
        loop {
            // Square cells where both sides have a length.
            let side = (long * wide / cells).sqrt();
            let count = |length: f64| ((length / side) as usize).clamp(1, cells.max(1.0) as usize);
            let axis = |k: usize, length| GridAxis { low: low[k], high: high[k], count: count(length) };
            let axes = [axis(1, long), axis(2, wide)];
            let ranges = |(low, high): &([f64; 3], [f64; 3])| {
                [0, 1].map(|k| [low, high].map(|corner| axes[k].cell(corner[k + 1])))
            };
            let touched = |b: &_| ranges(b).iter().map(|[from, to]| to - from + 1).product::<usize>();
            if cells <= 1.0 || boxes.iter().map(touched).sum::<usize>() <= ENTRIES_PER_FACE * faces.len() {
                let cells = filled(&axes, boxes.iter().map(ranges));
                return Self { positions, faces, axes, cells };
            }
            cells *= 0.25;
        }
    }

    /// `[V, 3]` (m).
    pub fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// Corners of a face.
    pub fn corners(&self, face: [u32; 3]) -> [[f64; 3]; 3] {
        face.map(|v| self.positions[v as usize])
    }

    /// Normal of a face, twice the area long.
    pub fn normal(&self, face: [u32; 3]) -> [f64; 3] {
        let [a, b, c] = self.corners(face);
        cross(sub(b, a), sub(c, a))
    }

    /// How many parts `p` is inside of, where none is inside out. In O(faces along the ray).
    pub fn winding_number(&self, p: [f64; 3]) -> i32 {
        // The faces in the cell of `p`, among them all whose box it is in.
        let [row, column] = [0, 1].map(|k| self.axes[k].cell(p[k + 1]));
        let faces = self.cells.row(row * self.axes[1].count + column);
        faces.iter().map(|&face| self.turns(self.faces[face as usize], p)).sum()
    }

    /// 1 where the ray from `p` leaves through `face`, −1 where it enters, 0 where it misses.
    fn turns(&self, face: [u32; 3], p: [f64; 3]) -> i32 {
        let corners = self.corners(face);
        // The winding number of the projected triangle: its edges past y = p.y, seen from p.
        let turns: i32 = (0..3)
            .map(|e| {
                let (a, b) = (corners[e], corners[(e + 1) % 3]);
                match (a[1] <= p[1], b[1] <= p[1]) {
                    (true, false) => i32::from(is_left(a, b, p)),
                    (false, true) => -i32::from(is_left(b, a, p)),
                    _ => 0,
                }
            })
            .sum();
        if turns == 0 {
            return 0;
        }
        let normal = self.normal(face);
        let ahead = dot(normal, sub(corners[0], p)) * normal[0] > 0.0;
        if ahead { turns } else { 0 }
    }
}

/// Whether `p` lies left of the line from `a` to `b` in the plane of y and z.
fn is_left(a: [f64; 3], b: [f64; 3], p: [f64; 3]) -> bool {
    (b[1] - a[1]) * (p[2] - a[2]) - (p[1] - a[1]) * (b[2] - a[2]) > 0.0
}

/// One side of the grid.
#[derive(Clone, Copy, Debug)]
struct GridAxis {
    low: f64,
    high: f64,
    count: usize,
}

impl GridAxis {
    /// The cell of `x`, ascending with it whatever the rounding; the first or last one outside.
    fn cell(&self, x: f64) -> usize {
        // The cast takes what is negative, or no number, to 0.
        let at = (x - self.low) / (self.high - self.low) * self.count as f64;
        (at as usize).min(self.count - 1)
    }
}

/// The faces of every cell; `ranges`: first and last cell of every face along both axes.
fn filled(
    axes: &[GridAxis; 2],
    ranges: impl Iterator<Item = [[usize; 2]; 2]> + Clone,
) -> CompressedRows<u32> {
    let wide = axes[1].count;
    let cells = |[[low, high], [left, right]]: [[usize; 2]; 2]| {
        (low..=high).flat_map(move |row| (left..=right).map(move |column| row * wide + column))
    };
    let keyed = (0u32..).zip(ranges).flat_map(|(face, range)| cells(range).map(move |cell| (cell, face)));
    CompressedRows::grouped(axes[0].count * wide, keyed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;
    use crate::mesh::shapes::{self, SplitMix};
    use crate::query::brute_force;

    fn rays(mesh: &TriMesh) -> RayIntersections {
        RayIntersections::new(mesh.positions().to_vec(), mesh.faces().to_vec())
    }

    fn at(mesh: TriMesh, by: [f64; 3]) -> TriMesh {
        shapes::mapped(&mesh, |p| crate::vec3::add(p, by))
    }

    #[test]
    fn they_give_the_winding_number() {
        let mesh = shapes::overlapping_balls();
        let rays = rays(&mesh);
        let (points, mut seen) = (SplitMix::new(3).points(500, 0.9), [0; 4]);
        // Few random points lie in three balls at once.
        for p in points.into_iter().chain([[0.1; 3], [0.12, 0.09, 0.1]]) {
            let expected = brute_force::winding_number(mesh.positions(), mesh.faces(), p).round() as i32;
            assert_eq!(rays.winding_number(p), expected);
            seen[expected as usize] += 1;
        }
        assert!(seen.iter().all(|&n| n > 0), "{seen:?}");
    }

    /// Where every test is a tie.
    #[test]
    fn a_ray_through_a_vertex_counts_once() {
        let octahedron = shapes::icosphere(0.5, 0);
        let rays = rays(&octahedron);
        for p in octahedron.positions() {
            assert_eq!(rays.winding_number([-2.0, p[1], p[2]]), 0);
            assert_eq!(rays.winding_number([0.01, 0.3 * p[1], 0.3 * p[2]]), 1);
        }
    }

    /// Tiny faces ask for a fine grid, of which every large face would fill most cells.
    #[test]
    fn large_faces_do_not_fill_memory() {
        let mut parts: Vec<TriMesh> =
            (0..400).map(|i| at(shapes::icosphere(5.0 + 0.01 * f64::from(i), 0), [0.0; 3])).collect();
        parts.push(at(shapes::icosphere(0.01, 4), [0.3, 0.2, 0.1]));
        let mesh = shapes::union(&parts.iter().collect::<Vec<_>>());
        let rays = rays(&mesh);
        assert_eq!(rays.winding_number([0.3, 0.2, 0.1]), 401);
        assert_eq!(rays.winding_number([0.3, 0.2, 0.2]), 400);
        assert_eq!(rays.winding_number([100.0, 0.2, 0.1]), 0);
        let cells = &rays.cells;
        assert!(cells.range(cells.len() - 1).end <= ENTRIES_PER_FACE * mesh.faces().len());
    }

    #[test]
    fn flat_empty_and_far_surfaces_enclose_nothing() {
        let flat = shapes::grid(1.0, 1.0, 3, 3);
        for mesh in
            [shapes::mapped(&flat, |[x, y, _]| [x, y, 0.0]), shapes::mapped(&flat, |[x, y, _]| [x, 0.0, y])]
        {
            assert_eq!(rays(&mesh).winding_number([0.2, 0.3, -0.1]), 0);
        }
        let none = RayIntersections::new(vec![[0.0; 3]], Vec::new());
        assert_eq!((none.winding_number([0.0; 3]), none.winding_number([f64::NAN; 3])), (0, 0));
    }
}
