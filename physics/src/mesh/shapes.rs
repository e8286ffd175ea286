//! Analytic meshes for tests, benches and examples: their area, normals, topology and spectra are known.

use std::f64::consts::TAU;

use crate::mesh::TriMesh;
use crate::vec3;

/// A flat rectangle in the plane `z = 0` with normals along `+z`, corners at the origin and `(width, height)` (m).
///
/// `columns × rows` cells of two triangles each (both at least 1); the diagonal alternates from cell to cell, so that no
/// direction is preferred. `(columns + 1)(rows + 1)` vertices, row by row.
pub fn grid(width: f64, height: f64, columns: usize, rows: usize) -> TriMesh {
    let (columns, rows) = (columns.max(1), rows.max(1));
    let mut positions = Vec::with_capacity((columns + 1) * (rows + 1));
    for row in 0..=rows {
        for column in 0..=columns {
            positions.push([width * column as f64 / columns as f64, height * row as f64 / rows as f64, 0.0]);
        }
    }
    let mut faces = Vec::with_capacity(2 * columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let a = (row * (columns + 1) + column) as u32;
            let (b, c, d) = (a + 1, a + columns as u32 + 2, a + columns as u32 + 1);
            if (row + column) % 2 == 0 {
                faces.extend([[a, b, c], [a, c, d]]);
            } else {
                faces.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    built(positions, faces)
}

/// [`grid`] with interior vertices moved inside the plane by up to `jitter` cell sizes per axis (0.3 keeps every triangle
/// upright). The same `seed` gives the same mesh.
pub fn irregular_grid(
    width: f64,
    height: f64,
    columns: usize,
    rows: usize,
    jitter: f64,
    seed: u64,
) -> TriMesh {
    let (columns, rows) = (columns.max(1), rows.max(1));
    let regular = grid(width, height, columns, rows);
    let cell = [width / columns as f64, height / rows as f64];
    let mut positions = regular.positions().to_vec();
    let mut random = SplitMix::new(seed);
    for row in 1..rows {
        for column in 1..columns {
            let position = &mut positions[row * (columns + 1) + column];
            for axis in 0..2 {
                position[axis] += jitter * cell[axis] * random.symmetric();
            }
        }
    }
    built(positions, regular.faces().to_vec())
}

/// A sphere about the origin: an icosahedron with every triangle split in four `subdivisions` times and projected.
///
/// `10·4^subdivisions + 2` vertices, normals outwards. Keep `subdivisions` ≤ 8.
pub fn icosphere(radius: f64, subdivisions: usize) -> TriMesh {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let mut positions: Vec<[f64; 3]> = Vec::with_capacity(12);
    for (long, short) in [(golden, 1.0), (golden, -1.0), (-golden, 1.0), (-golden, -1.0)] {
        positions.extend([[0.0, short, long], [short, long, 0.0], [long, 0.0, short]].map(vec3::normalized));
    }
    let mut faces = icosahedron_faces(&positions);
    for _ in 0..subdivisions {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push(vec3::normalized(vec3::add(positions[a as usize], positions[b as usize])));
                (positions.len() - 1) as u32
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    for position in &mut positions {
        *position = vec3::scale(*position, radius);
    }
    built(positions, faces)
}

/// An open tube about the `y` axis from `y = 0` to `y = height`, normals outwards: a sleeve, a skirt, a trunk.
///
/// `around ≥ 3` vertices per ring, `along ≥ 1` bands, `around·(along + 1)` vertices, ring by ring. Rings are turned by half
/// a cell from one to the next.
pub fn tube(radius: f64, height: f64, around: usize, along: usize) -> TriMesh {
    let (around, along) = (around.max(3), along.max(1));
    let mut positions = Vec::with_capacity(around * (along + 1));
    for ring in 0..=along {
        for step in 0..around {
            let angle = TAU * (step as f64 + 0.5 * (ring % 2) as f64) / around as f64;
            positions.push([radius * angle.sin(), height * ring as f64 / along as f64, radius * angle.cos()]);
        }
    }
    let mut faces = Vec::with_capacity(2 * around * along);
    for ring in 0..along {
        for step in 0..around {
            let next = (step + 1) % around;
            let at = |ring: usize, step: usize| (ring * around + step) as u32;
            let (a, b, c, d) = (at(ring, step), at(ring, next), at(ring + 1, next), at(ring + 1, step));
            // The shorter diagonal; odd rings lead even rings by half a cell.
            if ring % 2 == 0 {
                faces.extend([[a, b, d], [b, c, d]]);
            } else {
                faces.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    built(positions, faces)
}

/// A regular tetrahedron with unit circumradius about the origin, normals outwards: the smallest closed mesh.
pub fn tetrahedron() -> TriMesh {
    let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let positions = corners.map(vec3::normalized).to_vec();
    built(positions, vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
}

/// Several meshes side by side in one, in order; components are not joined.
pub fn union(meshes: &[&TriMesh]) -> TriMesh {
    let mut positions = Vec::new();
    let mut faces = Vec::new();
    for mesh in meshes {
        let offset = positions.len() as u32;
        positions.extend_from_slice(mesh.positions());
        faces.extend(mesh.faces().iter().map(|face| face.map(|v| v + offset)));
    }
    built(positions, faces)
}

/// The mesh with every vertex moved by `f`, which must return finite positions.
pub fn mapped(mesh: &TriMesh, f: impl Fn([f64; 3]) -> [f64; 3]) -> TriMesh {
    built(mesh.positions().iter().map(|p| f(*p)).collect(), mesh.faces().to_vec())
}

/// The 20 triangles of an icosahedron: all triples of vertices one edge apart, turned outwards.
fn icosahedron_faces(positions: &[[f64; 3]]) -> Vec<[u32; 3]> {
    let near = |a: usize, b: usize| vec3::dot(positions[a], positions[b]) > 0.4;
    let mut faces = Vec::with_capacity(20);
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let side = vec3::dot(positions[a], vec3::cross(positions[b], positions[c]));
                    faces.push(if side > 0.0 {
                        [a as u32, b as u32, c as u32]
                    } else {
                        [a as u32, c as u32, b as u32]
                    });
                }
            }
        }
    }
    faces
}

/// Three balls, each in each other, and a small one wholly inside.
#[cfg(test)]
pub(crate) fn overlapping_balls() -> TriMesh {
    let ball = |radius, at: [f64; 3]| mapped(&icosphere(radius, 3), |p| vec3::add(p, at));
    let parts =
        [ball(0.5, [0.0; 3]), ball(0.4, [0.4, 0.05, 0.02]), ball(0.3, [0.1, 0.5, 0.1]), ball(0.1, [0.1; 3])];
    union(&parts.each_ref())
}

fn built(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> TriMesh {
    TriMesh::new(positions, faces).expect("analytic shapes need finite dimensions")
}

/// A small deterministic generator (Steele, Lea and Flood 2014), so that shapes need no random-number crate.
pub(crate) struct SplitMix(u64);

impl SplitMix {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [−1, 1).
    pub(crate) fn symmetric(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Points uniform in [−extent, extent)³.
    #[cfg(test)]
    pub(crate) fn points(mut self, count: usize, extent: f64) -> Vec<[f64; 3]> {
        (0..count).map(|_| std::array::from_fn(|_| extent * self.symmetric())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Topology;
    use std::f64::consts::PI;

    #[test]
    fn areas_approach_the_smooth_shapes() {
        assert!((grid(0.4, 0.7, 5, 9).area() - 0.28).abs() < 1e-12);
        assert!((irregular_grid(0.4, 0.7, 5, 9, 0.3, 4).area() - 0.28).abs() < 1e-12);
        assert!((icosphere(0.5, 4).area() / PI - 1.0).abs() < 5e-3);
        assert!((tube(0.2, 1.0, 64, 20).area() / (0.4 * PI) - 1.0).abs() < 5e-3);
    }

    #[test]
    fn topologies_are_as_promised() {
        let sphere = icosphere(1.0, 3);
        assert_eq!((sphere.vertex_count(), sphere.face_count()), (642, 1280));
        assert!(Topology::new(&sphere).boundary_loops.is_empty());
        assert_eq!(Topology::new(&tube(0.1, 0.3, 12, 5)).boundary_loops.len(), 2);
        assert_eq!(Topology::new(&grid(1.0, 1.0, 3, 4)).boundary_loops.len(), 1);
        assert!(Topology::new(&tetrahedron()).boundary_loops.is_empty());
    }

    #[test]
    fn faces_look_outwards() {
        for mesh in [icosphere(1.0, 1), tetrahedron()] {
            for face in 0..mesh.face_count() {
                let [a, b, c] = mesh.corners(face);
                assert!(vec3::dot(a, vec3::cross(vec3::sub(b, a), vec3::sub(c, a))) > 0.0);
            }
        }
        let tube = tube(0.1, 0.3, 12, 5);
        for face in 0..tube.face_count() {
            let [a, b, c] = tube.corners(face);
            let radial = [a[0] + b[0] + c[0], 0.0, a[2] + b[2] + c[2]];
            assert!(vec3::dot(radial, vec3::cross(vec3::sub(b, a), vec3::sub(c, a))) > 0.0);
        }
    }
}
