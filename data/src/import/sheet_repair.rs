//! Polygon soup of a game asset → one oriented manifold sheet, or the reason why not.

use super::reference_surface::boundary_edges;
use crate::generate::sheet::LabelledTriangles;
use clothcombo_physics::query::{Distance, Surface};
use clothcombo_physics::vec3::{add, cross, dot, norm, norm_squared, normalized, scale, sub};
use std::collections::{HashMap, VecDeque};

/// Vertices closer than this are one [m].
const WELD_DISTANCE: f64 = 1e-4;

/// Holes with a shorter rim are filled [m]: button holes and modelling slips.
const SMALL_HOLE: f64 = 0.06;

/// What was changed, in words.
pub(super) type Repairs = Vec<String>;

/// Triangulated polygons: quads by the diagonal that leaves the larger smallest angle, others as fans.
pub(super) fn triangulate(positions: &[[f64; 3]], polygons: &[Vec<u32>]) -> Vec<[u32; 3]> {
    use crate::generate::sheet::smallest_sine;
    let sine = |f: [u32; 3]| smallest_sine(f.map(|v| positions[v as usize]));
    let mut faces = Vec::with_capacity(2 * polygons.len());
    for polygon in polygons {
        match polygon[..] {
            [a, b, c, d] => {
                let (one, two) = ([[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]);
                let worst = |pair: [[u32; 3]; 2]| sine(pair[0]).min(sine(pair[1]));
                faces.extend(if worst(one) >= worst(two) { one } else { two });
            }
            _ => faces.extend(polygon[1..].windows(2).map(|w| [polygon[0], w[0], w[1]])),
        }
    }
    faces
}

/// Welds, drops degenerate and repeated faces, cuts at non-manifold edges, orients outward, removes linings folded to the
/// inside, keeps the largest piece, fills small holes.
pub(super) fn repair(
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    body: &Surface<f64>,
) -> Result<(LabelledTriangles, Repairs), String> {
    let mut repairs = Repairs::new();
    let (positions, mut faces) = weld(positions, faces, &mut repairs);
    if faces.is_empty() {
        return Err("no face has an area".into());
    }
    let adjacency = join_faces(&positions, &faces, &mut repairs);
    orient(&mut faces, &adjacency, &mut repairs);
    let mut sheet = split_fans(&positions, &faces, &adjacency);
    sheet = outermost_piece(sheet, &mut repairs)?;
    turn_outward(&mut sheet, body);
    if boundary_edges(&sheet.faces).is_empty() {
        open_shell(&mut sheet, body, &mut repairs)?;
    }
    peel_lining(&mut sheet, body, &mut repairs)?;
    fill_small_holes(&mut sheet, &mut repairs);
    if boundary_edges(&sheet.faces).is_empty() {
        return Err("closed shell without an opening".into());
    }
    Ok((sheet, repairs))
}

fn weld(positions: &[[f64; 3]], faces: &[[u32; 3]], repairs: &mut Repairs) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let cell = |p: [f64; 3]| p.map(|x| (x / WELD_DISTANCE).floor() as i64);
    let mut grid: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut merged: Vec<[f64; 3]> = Vec::new();
    let number: Vec<u32> = positions
        .iter()
        .map(|p| {
            let c = cell(*p);
            let mut near = None;
            'search: for dx in -1..=1 {
                for dy in -1..=1 {
                    for dz in -1..=1 {
                        for v in grid.get(&[c[0] + dx, c[1] + dy, c[2] + dz]).into_iter().flatten() {
                            if norm_squared(sub(merged[*v as usize], *p)) < WELD_DISTANCE * WELD_DISTANCE {
                                near = Some(*v);
                                break 'search;
                            }
                        }
                    }
                }
            }
            near.unwrap_or_else(|| {
                merged.push(*p);
                grid.entry(c).or_default().push(merged.len() as u32 - 1);
                merged.len() as u32 - 1
            })
        })
        .collect();
    if merged.len() < positions.len() {
        repairs.push(format!("welded {} vertices", positions.len() - merged.len()));
    }
    let mut seen = std::collections::HashSet::new();
    let kept: Vec<[u32; 3]> = faces
        .iter()
        .map(|f| f.map(|v| number[v as usize]))
        .filter(|f| {
            let [a, b, c] = f.map(|v| merged[v as usize]);
            let mut key = *f;
            key.sort_unstable();
            f[0] != f[1]
                && f[1] != f[2]
                && f[0] != f[2]
                && norm(cross(sub(b, a), sub(c, a))) > 1e-10
                && seen.insert(key)
        })
        .collect();
    if kept.len() < faces.len() {
        repairs.push(format!("dropped {} degenerate or repeated faces", faces.len() - kept.len()));
    }
    (merged, kept)
}

/// Per face and side the face joined there. Where more than two faces meet, the two that continue each other most smoothly
/// stay joined and the others become edges of their own.
fn join_faces(positions: &[[f64; 3]], faces: &[[u32; 3]], repairs: &mut Repairs) -> Vec<[Option<u32>; 3]> {
    let mut sides: HashMap<[u32; 2], Vec<(u32, usize)>> = HashMap::new();
    for (f, face) in faces.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (face[i], face[(i + 1) % 3]);
            sides.entry([a.min(b), a.max(b)]).or_default().push((f as u32, i));
        }
    }
    let mut edges: Vec<_> = sides.into_iter().collect();
    edges.sort_unstable_by_key(|(e, _)| *e);
    let mut joined = vec![[None; 3]; faces.len()];
    let mut crowded = 0;
    for ([a, b], uses) in edges {
        if uses.len() < 2 {
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
        crowded += usize::from(uses.len() > 2);
        let ((f, i), (g, j)) = (uses[best.1], uses[best.2]);
        joined[f as usize][i] = Some(g);
        joined[g as usize][j] = Some(f);
    }
    if crowded > 0 {
        repairs.push(format!("cut at {crowded} non-manifold edges"));
    }
    joined
}

/// Gives all faces of a piece one orientation, that of the majority of its area being unknown here.
fn orient(faces: &mut [[u32; 3]], joined: &[[Option<u32>; 3]], repairs: &mut Repairs) {
    let mut state = vec![0u8; faces.len()];
    let mut flipped = 0;
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
                let same_way = (0..3).any(|j| original[g][j] == a && original[g][(j + 1) % 3] == b);
                state[g] = if same_way { 3 - state[f] } else { state[f] };
                piece.push(g);
                queue.push_back(g);
            }
        }
        // Turn the smaller part.
        let turned = piece.iter().filter(|f| state[**f] == 2).count();
        let turn = if 2 * turned > piece.len() { 1 } else { 2 };
        for f in piece {
            if state[f] == turn {
                faces[f].swap(1, 2);
                flipped += 1;
            }
        }
    }
    if flipped > 0 {
        repairs.push(format!("turned {flipped} faces"));
    }
}

/// One vertex per fan of joined faces, so that pieces meeting at an edge or a vertex come apart. Edges whose faces still run
/// the same way (a Möbius band) are left cut.
fn split_fans(positions: &[[f64; 3]], faces: &[[u32; 3]], joined: &[[Option<u32>; 3]]) -> LabelledTriangles {
    // Union-find over face corners.
    let mut root: Vec<u32> = (0..3 * faces.len() as u32).collect();
    fn find(root: &mut [u32], mut v: u32) -> u32 {
        while root[v as usize] != v {
            root[v as usize] = root[root[v as usize] as usize];
            v = root[v as usize];
        }
        v
    }
    let corner = |f: usize, v: u32| (0..3).find(|i| faces[f][*i] == v).map(|i| 3 * f as u32 + i as u32);
    for f in 0..faces.len() {
        for g in joined[f].iter().flatten().map(|g| *g as usize).filter(|g| *g > f) {
            let shared: Vec<u32> = faces[f].iter().copied().filter(|v| faces[g].contains(v)).collect();
            let [a, b] = shared[..] else { continue };
            let runs = |face: [u32; 3]| (0..3).any(|i| face[i] == a && face[(i + 1) % 3] == b);
            if runs(faces[f]) == runs(faces[g]) {
                continue;
            }
            for v in [a, b] {
                if let (Some(p), Some(q)) = (corner(f, v), corner(g, v)) {
                    let (p, q) = (find(&mut root, p), find(&mut root, q));
                    root[p.max(q) as usize] = p.min(q);
                }
            }
        }
    }
    let mut sheet = LabelledTriangles::default();
    let mut number = HashMap::new();
    for (f, face) in faces.iter().enumerate() {
        sheet.faces.push(std::array::from_fn(|i| {
            *number.entry(find(&mut root, (3 * f + i) as u32)).or_insert_with(|| {
                sheet.positions.push(positions[face[i] as usize]);
                sheet.positions.len() as u32 - 1
            })
        }));
    }
    sheet.labels = vec![0; sheet.positions.len()];
    sheet
}

/// The largest piece, if the others are trimmings.
fn outermost_piece(sheet: LabelledTriangles, repairs: &mut Repairs) -> Result<LabelledTriangles, String> {
    let total = sheet.area();
    let largest = sheet.largest_component();
    let dropped = sheet.faces.len() - largest.faces.len();
    if dropped == 0 {
        return Ok(largest);
    }
    let share = 1.0 - largest.area() / total;
    if share > 0.35 {
        return Err(format!(
            "falls into pieces of similar size ({:.0} % of its area is not in the largest one)",
            100.0 * share
        ));
    }
    repairs.push(format!("dropped {dropped} faces of loose pieces ({:.0} % of the area)", 100.0 * share));
    Ok(largest)
}

/// Area-weighted direction of every face against the direction away from the body, in [−1, 1].
fn outwardness(sheet: &LabelledTriangles, body: &Surface<f64>) -> Vec<(f64, f64)> {
    sheet
        .faces
        .iter()
        .map(|f| {
            let [a, b, c] = f.map(|v| sheet.positions[v as usize]);
            let normal = cross(sub(b, a), sub(c, a));
            let centre = scale(add(add(a, b), c), 1.0 / 3.0);
            let away = body.gap(centre, Distance::ClosestPoint).gradient;
            (dot(normalized(normal), away), 0.5 * norm(normal))
        })
        .collect()
}

fn turn_outward(sheet: &mut LabelledTriangles, body: &Surface<f64>) {
    let sum: f64 = outwardness(sheet, body).iter().map(|(d, area)| d * area).sum();
    if sum < 0.0 {
        sheet.faces.iter_mut().for_each(|f| f.swap(1, 2));
    }
}

/// A closed thick garment: keeps the outside only.
fn open_shell(
    sheet: &mut LabelledTriangles,
    body: &Surface<f64>,
    repairs: &mut Repairs,
) -> Result<(), String> {
    let facing = outwardness(sheet, body);
    let total = sheet.area();
    let faces = sheet.faces.iter().zip(&facing).filter(|(_, (d, _))| *d > 0.0).map(|(f, _)| *f).collect();
    let outside =
        LabelledTriangles { positions: sheet.positions.clone(), labels: sheet.labels.clone(), faces };
    let outside = outside.largest_component();
    let share = outside.area() / total;
    if !(0.3..0.75).contains(&share) {
        return Err(format!("closed shell whose outside ({:.0} % of it) is no sheet", 100.0 * share));
    }
    repairs.push(format!("took the outer layer of a closed shell ({:.0} % of its area)", 100.0 * share));
    *sheet = outside;
    Ok(())
}

/// Removes faces that look at the body and hang on the rim through such faces: hems folded inwards and linings.
fn peel_lining(
    sheet: &mut LabelledTriangles,
    body: &Surface<f64>,
    repairs: &mut Repairs,
) -> Result<(), String> {
    let facing = outwardness(sheet, body);
    let total: f64 = facing.iter().map(|(_, a)| a).sum();
    let mut of_edge: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
    for (f, face) in sheet.faces.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (face[i], face[(i + 1) % 3]);
            of_edge.entry([a.min(b), a.max(b)]).or_default().push(f as u32);
        }
    }
    let inward = |f: u32| facing[f as usize].0 < -0.15;
    let mut gone = vec![false; sheet.faces.len()];
    let mut queue: VecDeque<u32> = boundary_edges(&sheet.faces)
        .iter()
        .filter_map(|[a, b]| of_edge.get(&[*a.min(b), *a.max(b)])?.first().copied())
        .filter(|f| inward(*f))
        .collect();
    queue.iter().for_each(|f| gone[*f as usize] = true);
    while let Some(f) = queue.pop_front() {
        let face = sheet.faces[f as usize];
        for i in 0..3 {
            let (a, b) = (face[i], face[(i + 1) % 3]);
            for g in of_edge.get(&[a.min(b), a.max(b)]).into_iter().flatten() {
                if !gone[*g as usize] && inward(*g) {
                    gone[*g as usize] = true;
                    queue.push_back(*g);
                }
            }
        }
    }
    let area: f64 = gone.iter().zip(&facing).filter(|(g, _)| **g).map(|(_, (_, a))| a).sum();
    if area == 0.0 {
        return Ok(());
    }
    if area > 0.55 * total {
        return Err(format!("{:.0} % of its area faces the body", 100.0 * area / total));
    }
    let faces = sheet.faces.iter().zip(&gone).filter(|(_, g)| !**g).map(|(f, _)| *f).collect();
    let rest = LabelledTriangles { positions: sheet.positions.clone(), labels: sheet.labels.clone(), faces };
    // Removing faces may leave vertices that two fans share.
    let joined = join_faces(&rest.positions, &rest.faces, &mut Repairs::new());
    *sheet = split_fans(&rest.positions, &rest.faces, &joined).largest_component();
    repairs.push(format!(
        "removed {:.0} % of the area that was folded to the inside",
        100.0 * (1.0 - sheet.area() / total)
    ));
    Ok(())
}

/// Boundary edges chained into loops of vertices.
pub(super) fn boundary_loops(faces: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let edges = boundary_edges(faces);
    let next: HashMap<u32, u32> = edges.iter().map(|[a, b]| (*a, *b)).collect();
    let mut seen = std::collections::HashSet::new();
    let mut loops = Vec::new();
    for [start, _] in edges {
        let mut chain = Vec::new();
        let mut at = start;
        while seen.insert(at) {
            chain.push(at);
            match next.get(&at) {
                Some(n) => at = *n,
                None => break,
            }
        }
        if !chain.is_empty() {
            loops.push(chain);
        }
    }
    loops
}

fn fill_small_holes(sheet: &mut LabelledTriangles, repairs: &mut Repairs) {
    let loops = boundary_loops(&sheet.faces);
    let length = |chain: &[u32]| -> f64 {
        (0..chain.len())
            .map(|i| {
                let (a, b) = (chain[i] as usize, chain[(i + 1) % chain.len()] as usize);
                norm(sub(sheet.positions[a], sheet.positions[b]))
            })
            .sum()
    };
    let small: Vec<Vec<u32>> =
        loops.iter().filter(|l| l.len() >= 3 && length(l) < SMALL_HOLE).cloned().collect();
    if small.is_empty() || small.len() == loops.len() {
        return;
    }
    for chain in &small {
        let n = chain.len() as f64;
        let centre = chain.iter().fold([0.0; 3], |sum, v| add(sum, sheet.positions[*v as usize]));
        let v = sheet.positions.len() as u32;
        sheet.positions.push(scale(centre, 1.0 / n));
        sheet.labels.push(0);
        for i in 0..chain.len() {
            // The hole's edges run against the faces that are to fill it.
            sheet.faces.push([chain[(i + 1) % chain.len()], chain[i], v]);
        }
    }
    repairs.push(format!("filled {} small holes", small.len()));
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_physics::mesh::shapes::{icosphere, tube};

    fn ball() -> Surface<f64> {
        Surface::from_mesh(&icosphere(0.1, 3))
    }

    fn run(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Result<(LabelledTriangles, Repairs), String> {
        repair(positions, faces, &ball())
    }

    #[test]
    fn a_clean_tube_passes_unchanged_but_for_orientation() {
        let mesh = tube(0.2, 0.3, 24, 6);
        let (sheet, _) = run(mesh.positions(), mesh.faces()).unwrap();
        assert_eq!(sheet.faces.len(), mesh.face_count());
        assert_eq!(boundary_loops(&sheet.faces).len(), 2);
        // Turned outward whichever way it came.
        let flipped: Vec<[u32; 3]> = mesh.faces().iter().map(|f| [f[0], f[2], f[1]]).collect();
        for faces in [mesh.faces(), &flipped] {
            let (sheet, _) = run(mesh.positions(), faces).unwrap();
            let out: f64 = outwardness(&sheet, &ball()).iter().map(|(d, a)| d * a).sum();
            assert!(out > 0.0);
        }
    }

    #[test]
    fn seams_are_welded_single_faces_turned_and_fins_cut_off() {
        let mesh = tube(0.2, 0.3, 24, 6);
        // Every triangle its own vertices; each third one turned; a fin on an interior edge.
        let mut positions: Vec<[f64; 3]> = Vec::new();
        let mut faces = Vec::new();
        for (n, f) in mesh.faces().iter().enumerate() {
            let base = positions.len() as u32;
            positions.extend(f.map(|v| mesh.positions()[v as usize]));
            faces.push(if n % 3 == 0 { [base, base + 2, base + 1] } else { [base, base + 1, base + 2] });
        }
        let hinge = clothcombo_physics::Topology::new(&mesh).hinges[100];
        let [a, b] = hinge.edge.map(|v| mesh.positions()[v as usize]);
        let base = positions.len() as u32;
        positions.extend([a, b, scale(add(a, b), 0.9)]);
        faces.push([base, base + 1, base + 2]);
        let (sheet, repairs) = run(&positions, &faces).unwrap();
        assert_eq!(sheet.positions.len(), mesh.vertex_count());
        assert_eq!(sheet.faces.len(), mesh.face_count());
        for word in ["welded", "non-manifold", "turned", "loose"] {
            assert!(repairs.iter().any(|r| r.contains(word)), "{word}: {repairs:?}");
        }
        // Oriented: no directed edge twice.
        let mut seen = std::collections::HashSet::new();
        assert!(sheet.faces.iter().all(|f| (0..3).all(|i| seen.insert((f[i], f[(i + 1) % 3])))));
    }

    #[test]
    fn two_equal_pieces_and_closed_balls_are_refused_with_the_reason() {
        let mesh = tube(0.05, 0.1, 16, 4);
        let moved = |x: f64| mesh.positions().iter().map(move |p| [p[0] + x, p[1], p[2]]);
        let positions: Vec<[f64; 3]> = moved(-0.2).chain(moved(0.2)).collect();
        let n = mesh.vertex_count() as u32;
        let faces: Vec<[u32; 3]> =
            mesh.faces().iter().copied().chain(mesh.faces().iter().map(|f| f.map(|v| v + n))).collect();
        assert!(run(&positions, &faces).unwrap_err().contains("pieces of similar size"));
        let ball = icosphere(0.3, 2);
        assert!(run(ball.positions(), ball.faces()).unwrap_err().contains("closed shell"));
        assert!(run(&[[0.0; 3]; 3], &[[0, 1, 2]]).is_err());
    }

    #[test]
    fn quads_take_the_better_diagonal_and_small_holes_are_filled() {
        let positions = [[0.0, 0.0, 0.0], [1.0, -0.2, 0.0], [3.0, 0.0, 0.0], [1.0, 0.2, 0.0]];
        let faces = triangulate(&positions, &[vec![0, 1, 2, 3]]);
        assert_eq!(faces, [[0, 1, 3], [1, 2, 3]]);
        let mesh = tube(0.2, 0.3, 96, 24);
        let faces: Vec<[u32; 3]> =
            mesh.faces().iter().enumerate().filter(|(n, _)| *n != 500).map(|(_, f)| *f).collect();
        let (sheet, repairs) = run(mesh.positions(), &faces).unwrap();
        assert!(repairs.iter().any(|r| r.contains("filled 1")), "{repairs:?}");
        assert_eq!(boundary_loops(&sheet.faces).len(), 2);
    }
}
