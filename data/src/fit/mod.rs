//! Any garment on any body: a mesh file in any unit, with any axis up, in T- or A-pose, repaired and at rest on the zero body.
//!
//! Nothing is changed silently: [`FitReport`] lists what was assumed and every element that was touched.

mod arm_pose;
mod coverage;
mod error;
mod placed;
mod placement;
mod report;
mod search;
mod settings;
mod sitting;

pub use coverage::off_trunk;
pub use error::FitError;
pub use placed::is_on_body;
pub use placement::{Origin, Placement, Unit, UpAxis};
pub use report::{BodyContact, Elements, FitReport, MeshPiece, Repair, RepairKind};
pub use settings::{FitSettings, MAX_VERTICES, MIN_TRIANGLES};
pub use sitting::Sitting;

use crate::asset::{Body, Category, Garment};
use crate::format::PolygonMesh;
use crate::mesh::{
    AREA_SHARE, MeshMeasures, WELD_SHARE, bounds, clean_faces, contact, diagonal, join_faces, orient,
    outward_area, push_out, split_fans, triangulate, weld,
};
use arm_pose::ArmPose;
use clothcombo_physics::contact::{self_triangle_pairs, triangle_pairs};
use clothcombo_physics::vec3::{norm, sub};
use clothcombo_physics::{Topology, TriMesh};
use search::Search;
use settings::{MOST_STRETCH, MOST_STRETCHED};

/// Least distance between a fitted vertex and the body (m): the ε of the paper's body collision loss.
const CLEARANCE: f64 = 0.002;

/// A fitted garment and how it came about.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// At rest on the zero body in T-pose (m); name and source are the caller's.
    pub garment: Garment,
    /// What was assumed, repaired and measured.
    pub report: FitReport,
    /// For every vertex of the file the vertex it became; `None` for one that was dropped. A vertex that was split became
    /// several, of which this is the first.
    pub vertex_of_file: Vec<Option<u32>>,
}

/// Repaired faces in the file's coordinates, each vertex and face with its number in the file.
struct Repaired {
    positions: Vec<[f64; 3]>,
    vertex_origin: Vec<u32>,
    /// The inverse: see [`Fitted::vertex_of_file`].
    vertex_of_file: Vec<Option<u32>>,
    faces: Vec<[u32; 3]>,
    face_origin: Vec<u32>,
    /// Faces turned so far.
    turned: Vec<bool>,
    repairs: Vec<Repair>,
}

/// Fits a mesh to the zero body of `body`.
///
/// # Errors
/// [`FitError`] if the mesh is not a garment of this body, with the reason.
pub fn fit(file: &PolygonMesh, body: &Body, settings: &FitSettings) -> Result<Fitted, FitError> {
    let mut sheet = repair(file)?;
    let mesh = TriMesh::new(sheet.positions.clone(), sheet.faces.clone())
        .map_err(|e| FitError::Mesh(e.to_string()))?;
    let topology = Topology::new(&mesh);
    if topology.boundary_loops.is_empty() {
        return Err(FitError::Closed);
    }

    let search = Search::new(body, settings);
    let extent = mesh.extent();
    let units = settings.unit.map_or(Unit::ALL.to_vec(), |u| vec![u]);
    if !units.iter().any(|u| search.is_plausible_extent(extent * u.metres())) {
        return Err(FitError::Extent { extent, unit: settings.unit, reach: search.reach });
    }
    let (placement, sitting) = search.best(&sheet.positions, &sheet.faces, extent, settings)?;
    let placed = placement.apply(&sheet.positions);
    let arms = ArmPose::new(body, placement.arm_angle_degrees);
    let mut positions =
        arms.to_t_pose(&placed, &sheet.faces, settings.category, body).map_err(FitError::Mesh)?;
    refuse_other_things(&positions, body, &sitting)?;

    let rest_surface = ArmPose::new(body, 0.0).surface;
    turn_outward(&mut sheet, &positions, &topology, &rest_surface);
    let before = contact(&positions, &rest_surface);
    let unpushed = positions.clone();
    push_out(&mut positions, &sheet.faces, &rest_surface, CLEARANCE);
    let share = stretched(&topology, &unpushed, &positions);
    if share > MOST_STRETCHED {
        return Err(FitError::Stretched { share });
    }
    let after = contact(&positions, &rest_surface);
    let moves: Vec<f64> = positions.iter().zip(&unpushed).map(|(a, b)| norm(sub(*a, *b))).collect();
    let pushed = (0..moves.len()).filter(|v| moves[*v] > 0.0).map(|v| sheet.vertex_origin[v]).collect();
    sheet.note(RepairKind::PushedOut, Elements::Vertices(pushed));

    let rest = TriMesh::new(positions, sheet.faces.clone()).map_err(|e| FitError::Mesh(e.to_string()))?;
    // Faces have been turned.
    let topology = Topology::new(&rest);
    let category = settings.category.unwrap_or_else(|| Category::guess(&rest, body));
    let holding = Garment::needs_holding(&rest, body);
    let of_file = |e: &[u32; 2]| e.map(|v| sheet.vertex_origin[v as usize]);
    let report = FitReport {
        file_vertices: file.positions.len(),
        file_faces: file.polygon_count(),
        placement,
        sitting,
        repairs: sheet.repairs,
        unrepaired_edges: topology.non_manifold_edges.iter().map(of_file).collect(),
        pieces: pieces(&rest, &topology),
        category,
        holding,
        mesh: MeshMeasures::new(&rest, &topology),
        contact: BodyContact {
            inside_before: before.inside,
            depth_before_mm: (-1e3 * before.least_gap).max(0.0),
            inside_after: after.inside,
            least_distance_mm: 1e3 * after.least_gap,
            largest_move_mm: 1e3 * moves.into_iter().fold(0.0, f64::max),
            body_triangle_pairs: triangle_pairs(
                rest.positions(),
                rest.faces(),
                &rest_surface.positions,
                &rest_surface.faces,
            )
            .len(),
            self_triangle_pairs: self_triangle_pairs(rest.positions(), rest.faces()).len(),
        },
    };
    let garment = Garment { holding, ..Garment::new(category, rest) };
    Ok(Fitted { garment, report, vertex_of_file: sheet.vertex_of_file })
}

impl Repaired {
    fn note(&mut self, kind: RepairKind, elements: Elements) {
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
fn repair(file: &PolygonMesh) -> Result<Repaired, FitError> {
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
fn turn_outward(
    sheet: &mut Repaired,
    positions: &[[f64; 3]],
    topology: &Topology,
    body: &clothcombo_physics::Surface<f64>,
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

/// Share of the edges that became longer than [`MOST_STRETCH`] times what they were.
fn stretched(topology: &Topology, before: &[[f64; 3]], after: &[[f64; 3]]) -> f64 {
    let is_long = |edge: &&[u32; 2]| {
        let [now, rest] = [after, before].map(|p| norm(sub(p[edge[1] as usize], p[edge[0] as usize])));
        now > MOST_STRETCH * rest
    };
    topology.edges.iter().filter(is_long).count() as f64 / topology.edges.len().max(1) as f64
}

fn refuse_other_things(positions: &[[f64; 3]], body: &Body, sitting: &Sitting) -> Result<(), FitError> {
    let (low, high) = body.zero_body().bounds();
    let [lowest, highest] = bounds(positions);
    let spans = |a: usize, slack: f64| lowest[a] < low[a] + slack && highest[a] > high[a] - slack;
    if spans(1, 0.04) && spans(0, 0.1) {
        return Err(FitError::Body);
    }
    if let Some(place) = off_trunk(positions, body) {
        return Err(FitError::OffTrunk { place });
    }
    if sitting.wrap < 0.5 || sitting.mean_distance > 0.3 {
        return Err(FitError::OffBody { sitting: *sitting });
    }
    if sitting.inside > 0.45 {
        return Err(FitError::Inside { sitting: *sitting });
    }
    Ok(())
}

fn pieces(mesh: &TriMesh, topology: &Topology) -> Vec<MeshPiece> {
    let empty = MeshPiece { vertices: 0, triangles: 0, area: 0.0, boundary_loops: 0 };
    let mut pieces = vec![empty; topology.component_count];
    let piece = |v: u32| topology.component_of_vertex[v as usize] as usize;
    topology.component_of_vertex.iter().for_each(|c| pieces[*c as usize].vertices += 1);
    for (f, face) in mesh.faces().iter().enumerate() {
        pieces[piece(face[0])].triangles += 1;
        pieces[piece(face[0])].area += mesh.face_area(f);
    }
    topology.boundary_loops.iter().for_each(|l| pieces[piece(l[0])].boundary_loops += 1);
    pieces.sort_by(|a, b| b.area.total_cmp(&a.area));
    pieces
}

#[cfg(test)]
mod tests;
