//! Polygon soup of a game asset → one oriented manifold sheet, or the reason why not.

use super::reference_surface::boundary_edges;
use clothcombo_data::mesh::{
    LabelledTriangles, SplitMesh, clean_faces, join_faces, orient, outwardness, split_fans, weld,
};
use clothcombo_physics::query::Surface;
use clothcombo_physics::vec3::{add, norm, scale, sub};
use std::collections::HashMap;

/// Vertices closer than this are one (m).
const WELD_DISTANCE: f64 = 1e-4;

/// Faces of less than half this area (m²) are dropped.
const LEAST_CROSS: f64 = 1e-10;

/// Holes with a shorter rim are filled (m): button holes and modelling slips.
const SMALL_HOLE: f64 = 0.06;

/// What was changed, in words.
pub(super) type Repairs = Vec<String>;

/// Welds, drops degenerate and repeated faces, cuts at non-manifold edges, orients outward, removes linings folded to the
/// inside, keeps the largest piece, fills small holes.
pub(super) fn repair(
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    body: &Surface<f64>,
) -> Result<(LabelledTriangles, Repairs), String> {
    let mut repairs = Repairs::new();
    let mut repaired = |count: usize, text: String| {
        if count > 0 {
            repairs.push(text);
        }
    };
    let welded = weld(positions, WELD_DISTANCE);
    repaired(welded.merged.len(), format!("welded {} vertices", welded.merged.len()));
    let renumbered: Vec<[u32; 3]> = faces.iter().map(|f| f.map(|v| welded.number[v as usize])).collect();
    let clean = clean_faces(&welded.positions, &renumbered, LEAST_CROSS);
    let dropped = clean.degenerate.len() + clean.repeated.len();
    repaired(dropped, format!("dropped {dropped} degenerate or repeated faces"));
    let mut faces: Vec<[u32; 3]> = clean.kept.iter().map(|f| renumbered[*f as usize]).collect();
    if faces.is_empty() {
        return Err("no face has an area".into());
    }
    let (joined, crowded) = join_faces(&welded.positions, &faces);
    repaired(crowded.len(), format!("cut at {} non-manifold edges", crowded.len()));
    let turned = orient(&mut faces, &joined).len();
    repaired(turned, format!("turned {turned} faces"));
    let mut sheet = unlabelled(split_fans(&welded.positions, &faces, &joined));
    sheet = outermost_piece(sheet, &mut repairs)?;
    turn_outward(&mut sheet, body);
    if boundary_edges(&sheet.faces).is_empty() {
        return Err("closed shell without an opening".into());
    }
    peel_lining(&mut sheet, body, &mut repairs)?;
    fill_small_holes(&mut sheet, &mut repairs);
    Ok((sheet, repairs))
}

fn unlabelled(sheet: SplitMesh) -> LabelledTriangles {
    LabelledTriangles {
        labels: vec![0; sheet.positions.len()],
        positions: sheet.positions,
        faces: sheet.faces,
    }
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

fn turn_outward(sheet: &mut LabelledTriangles, body: &Surface<f64>) {
    let sum: f64 = outwardness(&sheet.positions, &sheet.faces, body).iter().map(|(d, area)| d * area).sum();
    if sum < 0.0 {
        sheet.faces.iter_mut().for_each(|f| f.swap(1, 2));
    }
}

/// Removes faces that look at the body and hang on the rim through such faces: hems folded inwards and linings.
fn peel_lining(
    sheet: &mut LabelledTriangles,
    body: &Surface<f64>,
    repairs: &mut Repairs,
) -> Result<(), String> {
    let facing = outwardness(&sheet.positions, &sheet.faces, body);
    let total: f64 = facing.iter().map(|(_, a)| a).sum();
    // At the rim, or beside a face that is gone.
    let (joined, _) = join_faces(&sheet.positions, &sheet.faces);
    let mut gone = vec![false; sheet.faces.len()];
    let mut stack: Vec<usize> = (0..joined.len()).filter(|f| joined[*f].contains(&None)).collect();
    while let Some(f) = stack.pop() {
        if facing[f].0 < -0.15 && !std::mem::replace(&mut gone[f], true) {
            stack.extend(joined[f].iter().flatten().map(|g| *g as usize));
        }
    }
    let area: f64 = gone.iter().zip(&facing).filter(|(g, _)| **g).map(|(_, (_, a))| a).sum();
    if area == 0.0 {
        return Ok(());
    }
    if area > 0.55 * total {
        return Err(format!("{:.0} % of its area faces the body", 100.0 * area / total));
    }
    let faces: Vec<[u32; 3]> = sheet.faces.iter().zip(&gone).filter(|(_, g)| !**g).map(|(f, _)| *f).collect();
    // Removing faces may leave vertices that two fans share.
    let (joined, _) = join_faces(&sheet.positions, &faces);
    *sheet = unlabelled(split_fans(&sheet.positions, &faces, &joined)).largest_component();
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
        // Turned outward, however it came.
        let flipped: Vec<[u32; 3]> = mesh.faces().iter().map(|f| [f[0], f[2], f[1]]).collect();
        for faces in [mesh.faces(), &flipped] {
            let (sheet, _) = run(mesh.positions(), faces).unwrap();
            let out: f64 =
                outwardness(&sheet.positions, &sheet.faces, &ball()).iter().map(|(d, a)| d * a).sum();
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
    fn small_holes_are_filled() {
        let mesh = tube(0.2, 0.3, 96, 24);
        let faces: Vec<[u32; 3]> =
            mesh.faces().iter().enumerate().filter(|(n, _)| *n != 500).map(|(_, f)| *f).collect();
        let (sheet, repairs) = run(mesh.positions(), &faces).unwrap();
        assert!(repairs.iter().any(|r| r.contains("filled 1")), "{repairs:?}");
        assert_eq!(boundary_loops(&sheet.faces).len(), 2);
    }
}
