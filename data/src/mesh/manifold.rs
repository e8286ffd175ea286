//! Triangle soup → oriented manifold sheets: cut where more than two faces meet, turned to one orientation per piece.

use clothcombo_physics::Topology;
use clothcombo_physics::mesh::DisjointSets;
use clothcombo_physics::query::{Distance, Surface};
use clothcombo_physics::vec3::{add, cross, dot, norm, normalized, scale, sub};
use std::collections::{HashMap, VecDeque};

/// Per face and side the face that continues it there.
pub type Joined = Vec<[Option<u32>; 3]>;

/// An edge with more faces than this joins none of them: no surface looks like that, and comparing all pairs would not end.
const CROWDED_EDGE: usize = 32;

/// Joins faces along edges. Where more than two meet, the two that continue each other most smoothly stay joined and the others
/// get edges of their own; those crowded edges are returned, sorted.
pub fn join_faces(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> (Joined, Vec<[u32; 2]>) {
    let mut sides: HashMap<[u32; 2], Vec<(u32, usize)>> = HashMap::new();
    for (f, face) in faces.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (face[i], face[(i + 1) % 3]);
            sides.entry([a.min(b), a.max(b)]).or_default().push((f as u32, i));
        }
    }
    let mut joined = vec![[None; 3]; faces.len()];
    let mut crowded = Vec::new();
    for ([a, b], uses) in sides {
        if uses.len() > 2 {
            crowded.push([a, b]);
        }
        if uses.len() < 2 || uses.len() > CROWDED_EDGE {
            continue;
        }
        // Direction from the edge into each face; two faces continue each other when these are opposite.
        let axis = normalized(sub(positions[b as usize], positions[a as usize]));
        let into = |f: u32| {
            let face = faces[f as usize];
            let c = face[0] ^ face[1] ^ face[2] ^ a ^ b;
            let d = sub(positions[c as usize], positions[a as usize]);
            normalized(sub(d, scale(axis, dot(d, axis))))
        };
        let mut best = (f64::MAX, 0, 1);
        for i in 0..uses.len() {
            for j in i + 1..uses.len() {
                let fold = dot(into(uses[i].0), into(uses[j].0));
                if fold < best.0 {
                    best = (fold, i, j);
                }
            }
        }
        let ((f, i), (g, j)) = (uses[best.1], uses[best.2]);
        joined[f as usize][i] = Some(g);
        joined[g as usize][j] = Some(f);
    }
    crowded.sort_unstable();
    (joined, crowded)
}

/// Gives all faces of a piece one orientation, that of most of them; returns the faces that were turned, ascending.
pub fn orient(faces: &mut [[u32; 3]], joined: &Joined) -> Vec<u32> {
    let mut state = vec![0u8; faces.len()];
    let mut turned = Vec::new();
    let original: Vec<[u32; 3]> = faces.to_vec();
    for seed in 0..faces.len() {
        if state[seed] != 0 {
            continue;
        }
        state[seed] = 1;
        let mut piece = vec![seed];
        let mut queue = VecDeque::from([seed]);
        while let Some(f) = queue.pop_front() {
            for i in 0..3 {
                let Some(g) = joined[f][i].map(|g| g as usize) else { continue };
                if state[g] != 0 {
                    continue;
                }
                let (a, b) = (original[f][i], original[f][(i + 1) % 3]);
                let same_orientation = (0..3).any(|j| original[g][j] == a && original[g][(j + 1) % 3] == b);
                state[g] = if same_orientation { 3 - state[f] } else { state[f] };
                piece.push(g);
                queue.push_back(g);
            }
        }
        let other = piece.iter().filter(|f| state[**f] == 2).count();
        let turn = if 2 * other > piece.len() { 1 } else { 2 };
        for f in piece {
            if state[f] == turn {
                faces[f].swap(1, 2);
                turned.push(f as u32);
            }
        }
    }
    turned.sort_unstable();
    turned
}

/// A soup taken apart into fans.
#[derive(Debug, Default)]
pub struct SplitMesh {
    /// Vertices.
    pub positions: Vec<[f64; 3]>,
    /// Faces in the order they came in.
    pub faces: Vec<[u32; 3]>,
    /// For each vertex the one it was.
    pub origin: Vec<u32>,
    /// Edges cut because their faces have the same orientation there (a Möbius band), as they were numbered before.
    pub twisted: Vec<[u32; 2]>,
}

/// One vertex per fan of joined faces, so that pieces meeting at an edge or a vertex come apart.
pub fn split_fans(positions: &[[f64; 3]], faces: &[[u32; 3]], joined: &Joined) -> SplitMesh {
    let mut corners = DisjointSets::new(3 * faces.len());
    let corner = |f: usize, v: u32| (0..3).find(|i| faces[f][*i] == v).map(|i| 3 * f as u32 + i as u32);
    let mut sheet = SplitMesh::default();
    for f in 0..faces.len() {
        for g in joined[f].iter().flatten().map(|g| *g as usize).filter(|g| *g > f) {
            // By their vertices: the sides of a face that was turned have changed places.
            let Some(i) = (0..3)
                .find(|i| faces[g].contains(&faces[f][*i]) && faces[g].contains(&faces[f][(i + 1) % 3]))
            else {
                continue;
            };
            let (a, b) = (faces[f][i], faces[f][(i + 1) % 3]);
            let same_orientation = (0..3).any(|j| faces[g][j] == a && faces[g][(j + 1) % 3] == b);
            if same_orientation {
                sheet.twisted.push([a.min(b), a.max(b)]);
                continue;
            }
            for v in [a, b] {
                if let (Some(p), Some(q)) = (corner(f, v), corner(g, v)) {
                    corners.join(p, q);
                }
            }
        }
    }
    let mut number = HashMap::new();
    for (f, face) in faces.iter().enumerate() {
        sheet.faces.push(std::array::from_fn(|i| {
            *number.entry(corners.root((3 * f + i) as u32)).or_insert_with(|| {
                sheet.positions.push(positions[face[i] as usize]);
                sheet.origin.push(face[i]);
                sheet.positions.len() as u32 - 1
            })
        }));
    }
    sheet.twisted.sort_unstable();
    sheet
}

/// Per face the cosine between its normal and the direction away from the body, and its area (m²).
pub fn outwardness(positions: &[[f64; 3]], faces: &[[u32; 3]], body: &Surface<f64>) -> Vec<(f64, f64)> {
    faces
        .iter()
        .map(|f| {
            let [a, b, c] = f.map(|v| positions[v as usize]);
            let normal = cross(sub(b, a), sub(c, a));
            let centre = scale(add(add(a, b), c), 1.0 / 3.0);
            let away = body.gap(centre, Distance::ClosestPoint).gradient;
            (dot(normalized(normal), away), 0.5 * norm(normal))
        })
        .collect()
}

/// Per piece its area that faces away from the body less what faces towards it (m²).
pub fn outward_area(
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    topology: &Topology,
    body: &Surface<f64>,
) -> Vec<f64> {
    let mut outward = vec![0.0; topology.component_count];
    for (face, (cosine, area)) in faces.iter().zip(outwardness(positions, faces, body)) {
        outward[topology.component_of_vertex[face[0] as usize] as usize] += cosine * area;
    }
    outward
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_physics::TriMesh;
    use clothcombo_physics::mesh::shapes::tube;

    #[test]
    fn a_fin_comes_off_and_the_sheet_stays_whole() {
        let mesh = tube(0.2, 0.3, 24, 6);
        let hinge = Topology::new(&mesh).hinges[100];
        let mut positions = mesh.positions().to_vec();
        let [a, b] = hinge.edge.map(|v| positions[v as usize]);
        positions.push(scale(add(a, b), 0.9));
        let mut faces = mesh.faces().to_vec();
        faces.push([hinge.edge[0], hinge.edge[1], positions.len() as u32 - 1]);
        faces[7].swap(0, 1);
        let (joined, crowded) = join_faces(&positions, &faces);
        let [x, y] = hinge.edge;
        assert_eq!(crowded, [[x.min(y), x.max(y)]]);
        assert_eq!(orient(&mut faces, &joined), [7]);
        let sheet = split_fans(&positions, &faces, &joined);
        assert_eq!(sheet.positions.len(), positions.len() + 2);
        let whole = Topology::new(&TriMesh::new(sheet.positions, sheet.faces).unwrap());
        assert!(whole.non_manifold_edges.is_empty());
        assert_eq!(whole.component_count, 2);
    }

    #[test]
    fn a_moebius_band_is_cut_once_and_the_cut_is_named() {
        // A band of quads whose ends are glued with a half turn.
        let n = 12u32;
        let positions: Vec<[f64; 3]> = (0..n)
            .flat_map(|k| {
                let t = f64::from(k) / f64::from(n) * std::f64::consts::TAU;
                [-1.0, 1.0].map(|s| {
                    let r = 1.0 + 0.3 * s * (0.5 * t).cos();
                    [r * t.cos(), 0.3 * s * (0.5 * t).sin(), r * t.sin()]
                })
            })
            .collect();
        let mut faces: Vec<[u32; 3]> = (0..n)
            .flat_map(|k| {
                let (a, b) = (2 * k, 2 * k + 1);
                let (c, d) = if k + 1 < n { (2 * k + 2, 2 * k + 3) } else { (1, 0) };
                [[a, b, d], [a, d, c]]
            })
            .collect();
        let (joined, crowded) = join_faces(&positions, &faces);
        assert!(crowded.is_empty());
        orient(&mut faces, &joined);
        let sheet = split_fans(&positions, &faces, &joined);
        assert_eq!(sheet.twisted.len(), 1);
        let topology = Topology::new(&TriMesh::new(sheet.positions, sheet.faces).unwrap());
        assert_eq!((topology.component_count, topology.boundary_loops.len()), (1, 1));
    }
}
