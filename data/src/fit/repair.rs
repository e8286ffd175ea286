//! Repairs that need no body: from the polygons of a file to triangles of manifold pieces that agree on a direction.

use super::error::FitError;
use super::report::{Elements, Repair, RepairKind};
use super::settings::{MAX_VERTICES, MIN_TRIANGLES};
use crate::format::PolygonMesh;
use crate::mesh::{
    AREA_SHARE, WELD_SHARE, clean_faces, diagonal, join_faces, orient, outward_area, split_fans, triangulate,
    weld,
};
use clothcombo_physics::{Surface, Topology};

/// Repaired faces in the file's coordinates, each vertex and face with its number in the file.
pub(super) struct Repaired {
    pub positions: Vec<[f64; 3]>,
    pub vertex_origin: Vec<u32>,
    /// The inverse: see [`Fitted::vertex_of_file`].
    pub vertex_of_file: Vec<Option<u32>>,
    pub faces: Vec<[u32; 3]>,
    pub face_origin: Vec<u32>,
    /// Faces turned so far.
    pub turned: Vec<bool>,
    pub repairs: Vec<Repair>,
}

impl Repaired {
    /// Adds a repair of some elements, if there are any.
    pub fn note(&mut self, kind: RepairKind, elements: Elements) {
        let elements = match elements {
            Elements::Vertices(mut list) => {
                list.sort_unstable();
                list.dedup();
                Elements::Vertices(list)
            }
            Elements::Faces(mut list) => {
                list.sort_unstable();
                list.dedup();
                Elements::Faces(list)
            }
            Elements::Edges(list) => Elements::Edges(list),
        };
        if !elements.is_empty() {
            self.repairs.push(Repair { kind, count: elements.len(), elements });
        }
    }
}

/// Everything that needs no body: weld, triangulate, drop, cut, orient each piece.
pub(super) fn repair(file: &PolygonMesh) -> Result<Repaired, FitError> {
    let mut used = vec![false; file.positions.len()];
    file.polygons().flatten().for_each(|v| used[*v as usize] = true);
    let used_vertices: Vec<u32> = (0..used.len() as u32).filter(|v| used[*v as usize]).collect();
    let used_positions: Vec<[f64; 3]> = used_vertices.iter().map(|v| file.positions[*v as usize]).collect();
    let diagonal = diagonal(&used_positions);
    if !(diagonal > 0.0 && diagonal.is_finite()) {
        return Err(FitError::TooFewTriangles { triangles: 0 });
    }
    let welded = weld(&used_positions, WELD_SHARE * diagonal);
    if welded.positions.len() > MAX_VERTICES {
        return Err(FitError::TooManyVertices { vertices: welded.positions.len() });
    }
    let mut compact = vec![u32::MAX; file.positions.len()];
    used_vertices.iter().zip(&welded.number).for_each(|(v, w)| compact[*v as usize] = *w);

    let (file_faces, polygon_of) = triangulate(&file.positions, file.polygons());
    let renumbered: Vec<[u32; 3]> = file_faces.iter().map(|f| f.map(|v| compact[v as usize])).collect();
    let clean = clean_faces(&welded.positions, &renumbered, AREA_SHARE * diagonal * diagonal);
    if clean.kept.len() < MIN_TRIANGLES {
        return Err(FitError::TooFewTriangles { triangles: clean.kept.len() });
    }
    let mut faces: Vec<[u32; 3]> = clean.kept.iter().map(|f| renumbered[*f as usize]).collect();
    let face_origin: Vec<u32> = clean.kept.iter().map(|f| polygon_of[*f as usize]).collect();
    let (joined, crowded) = join_faces(&welded.positions, &faces);
    let turned_faces = orient(&mut faces, &joined);
    let split = split_fans(&welded.positions, &faces, &joined);

    let file_vertex = |w: u32| used_vertices[welded.origin[w as usize] as usize];
    let mut first_of_welded = vec![None; welded.positions.len()];
    for (v, w) in split.origin.iter().enumerate().rev() {
        first_of_welded[*w as usize] = Some(v as u32);
    }
    let mut turned = vec![false; faces.len()];
    turned_faces.iter().for_each(|f| turned[*f as usize] = true);
    let mut sheet = Repaired {
        vertex_origin: split.origin.iter().map(|w| file_vertex(*w)).collect(),
        vertex_of_file: compact.iter().map(|w| first_of_welded.get(*w as usize).copied().flatten()).collect(),
        positions: split.positions,
        faces: split.faces,
        face_origin,
        turned,
        repairs: Vec::new(),
    };
    let mut kept = vec![0u8; welded.positions.len()];
    split.origin.iter().for_each(|w| kept[*w as usize] = kept[*w as usize].saturating_add(1));
    let of_file = |e: &[u32; 2]| e.map(file_vertex);
    let unused = (0..used.len() as u32).filter(|v| !used[*v as usize]);
    let lost = (0..kept.len() as u32).filter(|w| kept[*w as usize] == 0).map(file_vertex);
    sheet.note(RepairKind::DroppedIsolatedVertices, Elements::Vertices(unused.chain(lost).collect()));
    let merged = welded.merged.iter().map(|v| used_vertices[*v as usize]).collect();
    sheet.note(RepairKind::WeldedVertices, Elements::Vertices(merged));
    let large = file.polygons().enumerate().filter(|(_, p)| p.len() > 3).map(|(i, _)| i as u32).collect();
    sheet.note(RepairKind::TriangulatedFaces, Elements::Faces(large));
    let polygons = |list: &[u32]| Elements::Faces(list.iter().map(|f| polygon_of[*f as usize]).collect());
    sheet.note(RepairKind::DroppedDegenerateFaces, polygons(&clean.degenerate));
    sheet.note(RepairKind::DroppedRepeatedFaces, polygons(&clean.repeated));
    sheet.note(RepairKind::CutNonManifoldEdges, Elements::Edges(crowded.iter().map(of_file).collect()));
    sheet.note(RepairKind::CutOneSidedEdges, Elements::Edges(split.twisted.iter().map(of_file).collect()));
    // Ends of edges that were cut are split as a matter of course.
    let mut at_cut = vec![false; kept.len()];
    crowded.iter().chain(&split.twisted).flatten().for_each(|w| at_cut[*w as usize] = true);
    let touching = (0..kept.len() as u32).filter(|w| kept[*w as usize] > 1 && !at_cut[*w as usize]);
    sheet.note(RepairKind::SplitVertices, Elements::Vertices(touching.map(file_vertex).collect()));
    Ok(sheet)
}

/// Turns every piece whose area faces the body more than away from it, and reports all faces that differ from the file.
pub(super) fn turn_outward(
    sheet: &mut Repaired,
    positions: &[[f64; 3]],
    topology: &Topology,
    body: &Surface<f64>,
) {
    let outward = outward_area(positions, &sheet.faces, topology, body);
    let piece = |f: &[u32; 3]| topology.component_of_vertex[f[0] as usize] as usize;
    for (f, turned) in sheet.faces.iter_mut().zip(&mut sheet.turned) {
        if outward[piece(f)] < 0.0 {
            f.swap(1, 2);
            *turned = !*turned;
        }
    }
    let turned = (0..sheet.faces.len()).filter(|f| sheet.turned[*f]).map(|f| sheet.face_origin[f]).collect();
    sheet.note(RepairKind::TurnedFaces, Elements::Faces(turned));
}
