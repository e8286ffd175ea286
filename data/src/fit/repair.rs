//! Repairs that need no body: from the polygons of a file to triangles of manifold pieces that agree on a direction, of
//! one sheet, with their seams joined.

use super::error::FitError;
use super::report::{Elements, MeshPiece, RepairKind, SeamReport};
use super::settings::{FitSettings, Keep, MAX_GARMENT_VERTICES, MIN_TRIANGLES};
use super::sheet::{Corner, RepairSheet};
use crate::format::PolygonMesh;
use crate::mesh::{
    AREA_SHARE, JoinedSheet, Seam, WELD_SHARE, clean_faces, diagonal, join_faces, join_seams, open_seams,
    orient, outer_sheet, outward_area, sheets, split_fans, thickness, triangulate, weld,
};
use clothcombo_physics::mesh::is_inside_out;
use clothcombo_physics::vec3::{norm, sub};
use clothcombo_physics::{Surface, Topology, TriMesh};

/// Borders at most this far apart (m) are named as an open seam.
const OPEN_GAP: f64 = 0.01;
/// They are at least this long (m).
const OPEN_LENGTH: f64 = 0.06;
/// A vertex whose shortest edge is this many times the median one does not belong to the mesh.
const FAR_EDGES: f64 = 20.0;
/// Most such vertices.
const MOST_FAR: usize = 8;
/// The outer sheet of cloth with thickness has from one to the other share of the area.
const OUTER_SHARE: [f64; 2] = [0.3, 0.7];

/// Everything that needs neither body nor unit: weld, triangulate, drop, cut, orient each piece; keep what is asked for; join
/// borders that coincide.
pub(super) fn repair(file: &PolygonMesh, settings: &FitSettings) -> Result<RepairSheet, FitError> {
    let mut sheet = manifold(file)?;
    if settings.keep == Keep::Largest {
        keep_largest(&mut sheet, file);
    }
    match settings.keep {
        Keep::Outer => keep_outer(&mut sheet, file)?,
        Keep::All | Keep::Largest => refuse_thickness(&sheet)?,
    }
    if sheet.faces.len() < MIN_TRIANGLES {
        return Err(FitError::TooFewTriangles { triangles: sheet.faces.len() });
    }
    join(&mut sheet, file, None);
    Ok(sheet)
}

/// Whether a mesh that may lie on the body as it is should be fitted first: it has borders that coincide, or thickness.
pub fn needs_repair(mesh: &TriMesh) -> bool {
    let (positions, faces) = (mesh.positions(), mesh.faces());
    join_seams(positions, faces, None).is_some() || is_double(positions, faces)
}

/// Whether the cloth lies in two sheets, where a garment is one.
pub(crate) fn is_double(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> bool {
    thickness(positions, faces).or_else(|| sheets(positions, faces)).is_some()
}

fn manifold(file: &PolygonMesh) -> Result<RepairSheet, FitError> {
    let cut = triangulate(&file.positions, file.polygons());
    let far = far_vertices(&file.positions, &cut.faces);
    let is_near = |v: &u32| far.binary_search(v).is_err();
    let stays: Vec<usize> = (0..cut.faces.len()).filter(|f| cut.faces[*f].iter().all(is_near)).collect();
    let mut used = vec![false; file.positions.len()];
    let of_faces = stays.iter().flat_map(|f| &cut.faces[*f]).chain(file.polygons().flatten());
    of_faces.filter(|v| is_near(v)).for_each(|v| used[*v as usize] = true);
    let used_vertices: Vec<u32> = (0..used.len() as u32).filter(|v| used[*v as usize]).collect();
    let used_positions: Vec<[f64; 3]> = used_vertices.iter().map(|v| file.positions[*v as usize]).collect();
    let diagonal = diagonal(&used_positions);
    if !(diagonal > 0.0 && diagonal.is_finite()) {
        return Err(FitError::TooFewTriangles { triangles: 0 });
    }
    let welded = weld(&used_positions, WELD_SHARE * diagonal);
    if welded.positions.len() > MAX_GARMENT_VERTICES {
        return Err(FitError::TooManyVertices { vertices: welded.positions.len() });
    }
    let mut compact = vec![u32::MAX; file.positions.len()];
    used_vertices.iter().zip(&welded.number).for_each(|(v, w)| compact[*v as usize] = *w);

    let renumbered: Vec<[u32; 3]> =
        stays.iter().map(|f| cut.faces[*f].map(|v| compact[v as usize])).collect();
    let clean = clean_faces(&welded.positions, &renumbered, AREA_SHARE * diagonal * diagonal);
    if clean.kept.len() < MIN_TRIANGLES {
        return Err(FitError::TooFewTriangles { triangles: clean.kept.len() });
    }
    let faces: Vec<[u32; 3]> = clean.kept.iter().map(|f| renumbered[*f as usize]).collect();
    let corners = clean.kept.iter().map(|f| cut.corners[stays[*f as usize]].map(Corner::own)).collect();
    let of_polygons = |list: &[u32]| list.iter().map(|f| cut.polygon[stays[*f as usize]]).collect();
    let face_origin = of_polygons(&clean.kept);
    let turned = vec![false; faces.len()];
    let positions = welded.positions;
    let mut sheet = RepairSheet {
        positions,
        faces,
        face_origin,
        corners,
        turned,
        welded: compact,
        ..RepairSheet::default()
    };
    let made = oriented(&mut sheet);

    let file_vertex = |w: u32| used_vertices[welded.origin[w as usize] as usize];
    let mut kept = vec![0u8; welded.origin.len()];
    made.origin.iter().for_each(|w| kept[*w as usize] = kept[*w as usize].saturating_add(1));
    let of_file = |e: &[u32; 2]| e.map(file_vertex);
    let unused = (0..used.len() as u32).filter(|v| !used[*v as usize] && is_near(v));
    let lost = (0..kept.len() as u32).filter(|w| kept[*w as usize] == 0).map(file_vertex);
    sheet.note(RepairKind::DroppedFarVertices, Elements::Vertices(far.clone()));
    sheet.note(RepairKind::DroppedIsolatedVertices, Elements::Vertices(unused.chain(lost).collect()));
    let merged = welded.merged.iter().map(|v| used_vertices[*v as usize]).collect();
    sheet.note(RepairKind::WeldedVertices, Elements::Vertices(merged));
    let large = file.polygons().enumerate().filter(|(_, p)| p.len() > 3).map(|(i, _)| i as u32).collect();
    sheet.note(RepairKind::TriangulatedFaces, Elements::Faces(large));
    sheet.note(RepairKind::DroppedDegenerateFaces, Elements::Faces(of_polygons(&clean.degenerate)));
    sheet.note(RepairKind::DroppedRepeatedFaces, Elements::Faces(of_polygons(&clean.repeated)));
    let edges = |list: &[[u32; 2]]| Elements::Edges(list.iter().map(of_file).collect());
    sheet.note(RepairKind::CutNonManifoldEdges, edges(&made.crowded));
    sheet.note(RepairKind::CutOneSidedEdges, edges(&made.twisted));
    // Ends of edges that were cut are split as a matter of course.
    let mut at_cut = vec![false; kept.len()];
    made.crowded.iter().chain(&made.twisted).flatten().for_each(|w| at_cut[*w as usize] = true);
    let touching = (0..kept.len() as u32).filter(|w| kept[*w as usize] > 1 && !at_cut[*w as usize]);
    sheet.note(RepairKind::SplitVertices, Elements::Vertices(touching.map(file_vertex).collect()));
    sheet.number_as_file(file);
    Ok(sheet)
}

/// Vertices that no edge joins to the rest within [`FAR_EDGES`] median edges, ascending: slips of a modelling program. Where there are
/// more than a few, the mesh is coarse instead.
fn far_vertices(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<u32> {
    let mut shortest = vec![f64::INFINITY; positions.len()];
    let mut lengths = Vec::with_capacity(3 * faces.len());
    for [a, b, c] in faces {
        for [a, b] in [[a, b], [b, c], [c, a]] {
            let length = norm(sub(positions[*a as usize], positions[*b as usize]));
            lengths.push(length);
            for v in [a, b] {
                shortest[*v as usize] = length.min(shortest[*v as usize]);
            }
        }
    }
    lengths.sort_by(f64::total_cmp);
    let Some(median) = lengths.get(lengths.len() / 2) else { return Vec::new() };
    let is_far = |v: &u32| (FAR_EDGES * median..f64::INFINITY).contains(&shortest[*v as usize]);
    let far: Vec<u32> = (0..positions.len() as u32).filter(is_far).collect();
    if far.len() > MOST_FAR { Vec::new() } else { far }
}

/// What was done to make a sheet of manifold pieces; vertices as they were before.
struct Oriented {
    origin: Vec<u32>,
    crowded: Vec<[u32; 2]>,
    twisted: Vec<[u32; 2]>,
}

/// Cuts where more than two faces meet, gives each piece one direction and vertices of its own.
fn oriented(sheet: &mut RepairSheet) -> Oriented {
    let (joined, crowded) = join_faces(&sheet.positions, &sheet.faces);
    for f in orient(&mut sheet.faces, &joined) {
        sheet.corners[f as usize].swap(1, 2);
        sheet.turned[f as usize] ^= true;
    }
    let split = split_fans(&sheet.positions, &sheet.faces, &joined);
    (sheet.positions, sheet.faces) = (split.positions, split.faces);
    Oriented { origin: split.origin, crowded, twisted: split.twisted }
}

fn refuse_thickness(sheet: &RepairSheet) -> Result<(), FitError> {
    let share = |distance: f64| distance / diagonal(&sheet.positions);
    if let Some(thickness) = thickness(&sheet.positions, &sheet.outward_faces()) {
        return Err(FitError::Thickness { thickness, share: share(thickness) });
    }
    match sheets(&sheet.positions, &sheet.faces) {
        Some(distance) => Err(FitError::Sheets { distance, share: share(distance) }),
        None => Ok(()),
    }
}

/// Keeps the outer sheet of cloth with thickness, or the larger one of two pieces that lie in each other; cloth without either
/// stays as it is.
fn keep_outer(sheet: &mut RepairSheet, file: &PolygonMesh) -> Result<(), FitError> {
    let faces = sheet.outward_faces();
    if thickness(&sheet.positions, &faces).is_none() {
        if sheets(&sheet.positions, &faces).is_some() {
            keep_largest(sheet, file);
        }
        return Ok(());
    }
    let outer = outer_sheet(&sheet.positions, &faces);
    let mut is_outer = vec![false; faces.len()];
    outer.iter().for_each(|f| is_outer[*f as usize] = true);
    let areas: Vec<f64> = (0..faces.len()).map(|f| sheet.area(f)).collect();
    let all: f64 = areas.iter().sum();
    let kept: f64 =
        areas.iter().zip(&is_outer).filter(|(_, is_outer)| **is_outer).map(|(area, _)| area).sum();
    if !(OUTER_SHARE[0] * all..=OUTER_SHARE[1] * all).contains(&kept) {
        return Err(FitError::MixedSheets);
    }
    let dropped = sheet.drop_faces(|f| is_outer[f], file);
    sheet.note(RepairKind::DroppedInnerSheet, Elements::Faces(dropped));
    Ok(())
}

/// Keeps the connected piece with the largest area and lists the others.
fn keep_largest(sheet: &mut RepairSheet, file: &PolygonMesh) {
    let Ok(mesh) = sheet.mesh() else { return };
    let topology = Topology::new(&mesh);
    let mut pieces = MeshPiece::all(&mesh, &topology);
    let Some(largest) = (0..pieces.len()).max_by(|a, b| pieces[*a].area.total_cmp(&pieces[*b].area)) else {
        return;
    };
    let piece = |f: usize| topology.component_of_vertex[mesh.faces()[f][0] as usize] as usize;
    let dropped = sheet.drop_faces(|f| piece(f) == largest, file);
    sheet.note(RepairKind::DroppedPieces, Elements::Faces(dropped));
    pieces.remove(largest);
    pieces.sort_by(|a, b| b.area.total_cmp(&a.area));
    sheet.dropped_pieces = pieces;
}

/// Joins borders within `reach` (in the file's unit), without it those that coincide.
fn join(sheet: &mut RepairSheet, file: &PolygonMesh, reach: Option<f64>) {
    let Some(joined) = join_seams(&sheet.positions, &sheet.faces, reach) else { return };
    let JoinedSheet { positions, faces, parent, became, seams } = joined;
    let touched: Vec<u32> = (0..became.len() as u32).filter(|v| became[*v as usize] != *v).collect();
    let touched = touched.iter().flat_map(|v| [*v, became[*v as usize]]);
    let touched = touched.map(|v| sheet.vertex_origin[v as usize]).collect();
    sheet.note(RepairKind::JoinedSeams, Elements::Vertices(touched));
    let named: Vec<Seam> = seams.iter().filter(|s| s.is_joined).map(|s| sheet.named(s)).collect();
    sheet.seams.extend(named);
    sheet.split_faces(positions, faces, &parent, &became);
    oriented(sheet);
    sheet.number_as_file(file);
}

/// What needs the unit: joins borders within the distance that is asked for and lists the seams that stay open. `metres` of
/// the file's unit.
pub(super) fn finish_seams(
    sheet: &mut RepairSheet,
    file: &PolygonMesh,
    settings: &FitSettings,
    metres: f64,
) -> Vec<SeamReport> {
    if let Some(distance) = settings.join_seams {
        join(sheet, file, Some(distance / metres));
    }
    let open = open_seams(&sheet.positions, &sheet.faces, OPEN_GAP / metres, OPEN_LENGTH / metres);
    let open = open.iter().map(|seam| SeamReport::new(&sheet.named(seam), metres, false));
    sheet.seams.iter().map(|seam| SeamReport::new(seam, metres, true)).chain(open).collect()
}

/// Borders that are not among those of `before` and that no limb passes through: gaps in seams that were joined.
pub(super) fn gaps(
    borders: &[(Vec<u32>, Seam)],
    before: &[(Vec<u32>, Seam)],
    is_linked: &[bool],
    metres: f64,
) -> Vec<SeamReport> {
    let unlinked = borders.iter().zip(is_linked).filter(|(_, is_linked)| !**is_linked);
    let gaps = unlinked.filter(|((vertices, _), _)| before.iter().all(|(known, _)| known != vertices));
    gaps.map(|((_, seam), _)| SeamReport::new(seam, metres, false)).collect()
}

/// Turns every piece whose area faces the body more than away from it, and reports all faces that differ from the file.
pub(super) fn turn_outward(
    sheet: &mut RepairSheet,
    positions: &[[f64; 3]],
    topology: &Topology,
    body: &Surface<f64>,
) {
    let outward = outward_area(positions, &sheet.faces, topology, body);
    let piece = |f: &[u32; 3]| topology.component_of_vertex[f[0] as usize] as usize;
    for (f, face) in sheet.faces.iter_mut().enumerate() {
        if outward[piece(face)] < 0.0 {
            face.swap(1, 2);
            sheet.corners[f].swap(1, 2);
            sheet.turned[f] ^= true;
        }
    }
    let turned = (0..sheet.faces.len()).filter(|f| sheet.turned[*f]).map(|f| sheet.face_origin[f]).collect();
    sheet.note(RepairKind::TurnedFaces, Elements::Faces(turned));
}

impl RepairSheet {
    /// Faces with their front outside where they enclose something: behind them is the cloth.
    fn outward_faces(&self) -> Vec<[u32; 3]> {
        match self.mesh().is_ok_and(|mesh| is_inside_out(&mesh)) {
            true => self.faces.iter().map(|[a, b, c]| [*a, *c, *b]).collect(),
            false => self.faces.clone(),
        }
    }
}
