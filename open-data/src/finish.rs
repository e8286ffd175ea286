//! The last steps of an imported garment: even triangles, outside the body, checked.

use super::reference_surface::ReferenceSurface;
use super::sheet_repair::boundary_loops;
use clothcombo_data::mesh::{
    BodyClearance, EditableMesh, LabelledTriangles, Quality, compact, contact, push_out, remesh,
    smallest_sine,
};
use clothcombo_physics::query::Surface;
use clothcombo_physics::vec3::{add, dot, norm, normalized, scale, sub};
use clothcombo_physics::{Topology, TriMesh};

/// Wanted number of vertices of a garment, as far as the edge length allows.
const WANTED_VERTICES: f64 = 1500.0;

/// Shortest and longest mean edge (m).
const EDGE_LENGTHS: [f64; 2] = [0.008, 0.025];

/// Edge length (m) for a sheet of this area: a triangulation with edge length h has a vertex per h²·√3/2.
pub(super) fn edge_for(area: f64) -> f64 {
    (area / (WANTED_VERTICES * 0.75f64.sqrt())).sqrt().clamp(EDGE_LENGTHS[0], EDGE_LENGTHS[1])
}

/// Least distance between a garment vertex and the body at rest (m).
const GARMENT_CLEARANCE: f64 = 0.004;

/// Triangle limits a finished garment has to keep.
const QUALITY: Quality = Quality { angle: 15.0, edge_ratio: [0.4, 2.5] };

/// Angles below this refuse the garment (degrees): bending and strain become singular.
const SLIVER: f64 = 4.0;

/// A rim vertex where the rim turns by more than this is a corner and stays where it is (degrees).
const CORNER: f64 = 50.0;

/// Bits from here on tell neighbouring corners of one rim apart; the ones below are the rims'.
const FIRST_CORNER_BIT: u32 = 20;

/// Marks the rims of a sheet that has no labels yet: one bit per rim, a second one on corners. The rim is smoothed a little
/// first, since game assets have steps in it. Corners keep a distance of `edge` along the rim: the mesh cannot show more.
pub(super) fn label_rim(sheet: &mut LabelledTriangles, smoothing: usize, edge: f64) {
    for (number, chain) in boundary_loops(&sheet.faces).into_iter().enumerate() {
        let rim = 1 << (number as u32).min(FIRST_CORNER_BIT - 1);
        let mut corners = 0;
        let mut since_corner = f64::MAX;
        let n = chain.len();
        let corner_at = |positions: &[[f64; 3]], i: usize| {
            let [a, b, c] = [(i + n - 1) % n, i, (i + 1) % n].map(|k| positions[chain[k] as usize]);
            dot(normalized(sub(b, a)), normalized(sub(c, b))) < CORNER.to_radians().cos()
        };
        for _ in 0..smoothing {
            let old = sheet.positions.clone();
            for i in 0..n {
                if corner_at(&old, i) {
                    continue;
                }
                let [a, b, c] = [(i + n - 1) % n, i, (i + 1) % n].map(|k| old[chain[k] as usize]);
                sheet.positions[chain[i] as usize] = add(scale(b, 0.5), scale(add(a, c), 0.25));
            }
        }
        for i in 0..n {
            let mut label = rim;
            let here = sheet.positions[chain[i] as usize];
            since_corner += norm(sub(here, sheet.positions[chain[(i + n - 1) % n] as usize]));
            if corner_at(&sheet.positions, i) && since_corner > edge {
                since_corner = 0.0;
                // Two corners next to each other must share the rim's bit alone, or the edge between them would be one point.
                label |= 1 << (FIRST_CORNER_BIT + corners % (u32::BITS - FIRST_CORNER_BIT));
                corners += 1;
            }
            sheet.labels[chain[i] as usize] = label;
        }
    }
}

/// Remeshes a labelled sheet, pushes it out of the body and checks the result.
pub(super) fn finish(
    sheet: LabelledTriangles,
    body: &Surface<f64>,
) -> Result<(TriMesh, BodyClearance), String> {
    let edge = edge_for(sheet.area());
    let even = |sheet: LabelledTriangles, iterations: usize| {
        let target = ReferenceSurface::new(&sheet, edge);
        let mut editable = EditableMesh::new(sheet);
        remesh(&mut editable, &target, iterations, QUALITY);
        let (mut positions, mut faces) = editable.compact();
        trim_ears(&mut positions, &mut faces);
        (positions, faces)
    };
    let (mut positions, faces) = even(sheet, 8);
    let before = contact(&positions, body);
    push_out(&mut positions, &faces, body, GARMENT_CLEARANCE);
    // Pushing squeezes some triangles and removes steps of the rim: once more on the pushed sheet.
    let mut pushed = LabelledTriangles { labels: vec![0; positions.len()], positions, faces };
    label_rim(&mut pushed, 0, edge);
    let (mut positions, faces) = even(pushed, 4);
    push_out(&mut positions, &faces, body, GARMENT_CLEARANCE);
    let after = contact(&positions, body);
    if after.inside > 0 || after.least_gap < 0.0005 {
        return Err(format!(
            "{} vertices stay inside the body or touch it (closest {:.1} mm) after pushing out",
            after.inside.max(1),
            1e3 * after.least_gap
        ));
    }
    let mesh = TriMesh::new(positions, faces).map_err(|e| e.to_string())?;
    check(&mesh)?;
    Ok((mesh, before))
}

/// Removes flat triangles that hang on the sheet by one edge only: at a sharp rim no other triangulation exists.
fn trim_ears(positions: &mut Vec<[f64; 3]>, faces: &mut Vec<[u32; 3]>) {
    for _ in 0..8 {
        let mut uses = vec![0u32; positions.len()];
        faces.iter().flatten().for_each(|v| uses[*v as usize] += 1);
        let count = faces.len();
        faces.retain(|f| {
            let is_ear = f.iter().any(|v| uses[*v as usize] == 1);
            !is_ear || smallest_sine(f.map(|v| positions[v as usize])) > QUALITY.angle.to_radians().sin()
        });
        if faces.len() == count {
            break;
        }
    }
    let (used, compacted) = compact(faces.iter().copied(), positions.len());
    *positions = used.iter().map(|v| positions[*v as usize]).collect();
    *faces = compacted;
}

fn check(mesh: &TriMesh) -> Result<(), String> {
    let topology = Topology::new(mesh);
    if topology.component_count != 1 || !topology.non_manifold_edges.is_empty() {
        return Err(format!(
            "{} pieces and {} non-manifold edges after repair",
            topology.component_count,
            topology.non_manifold_edges.len()
        ));
    }
    let sharpest = (0..mesh.face_count())
        .map(|f| smallest_sine(mesh.corners(f)))
        .fold(1.0, f64::min)
        .asin()
        .to_degrees();
    if sharpest < SLIVER {
        return Err(format!("a triangle angle of {sharpest:.1}° remains"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_physics::mesh::shapes::{icosphere, tube};

    #[test]
    fn a_coarse_tube_becomes_an_even_sheet_outside_the_body_with_its_rims_in_place() {
        let body = Surface::from_mesh(&icosphere(0.2, 4));
        let mesh = tube(0.22, 0.3, 24, 3);
        let (positions, faces) = (mesh.positions().to_vec(), mesh.faces().to_vec());
        let mut sheet = LabelledTriangles { labels: vec![0; positions.len()], positions, faces };
        let edge = edge_for(sheet.area());
        label_rim(&mut sheet, 0, edge);
        let (result, _) = finish(sheet, &body).unwrap();
        assert!((1000..2200).contains(&result.vertex_count()), "{}", result.vertex_count());
        assert_eq!(contact(result.positions(), &body).inside, 0);
        let topology = Topology::new(&result);
        assert_eq!((topology.boundary_loops.len(), topology.component_count), (2, 1));
        let (low, high) = mesh.bounds();
        for rim in &topology.boundary_loops {
            for v in rim {
                let y = result.positions()[*v as usize][1];
                assert!((y - low[1]).abs() < 1e-3 || (y - high[1]).abs() < 1e-3, "{y}");
            }
        }
        let sharpest = (0..result.face_count()).map(|f| smallest_sine(result.corners(f))).fold(1.0, f64::min);
        assert!(sharpest > 20f64.to_radians().sin());
    }
}
