//! Any garment on any body: a mesh file in any unit, with any axis up, in T- or A-pose, repaired and at rest on the zero body.
//!
//! Nothing is changed silently: [`FitReport`] lists what was assumed and every element that was touched.

mod anatomy;
mod as_given;
mod body_field;
mod category;
mod climb;
mod cloth;
mod coverage;
mod diagnosis;
mod error;
mod from_body;
pub mod hints;
mod judge;
mod likelihood;
mod limb_pose;
mod openings;
mod pieces;
mod placed;
mod placement;
mod readings;
mod repair;
mod report;
mod search;
mod settings;
mod sheet;
mod sitting;
mod verdict;

pub use coverage::off_trunk;
pub use error::{FitError, Size};
pub use from_body::{Carried, SourceBody, SourcePlacement};
pub use pieces::{StrayPiece, stray_pieces};
pub use placed::{PlacementCheck, is_on_body};
pub use placement::{FileOrigin, Placement, Unit, UpAxis};
pub(crate) use repair::is_double;
pub use repair::needs_repair;
pub use report::{
    BodyContact, Elements, FitReport, MeshPiece, Repair, RepairKind, SeamReport, contact_warnings,
    outfit_warning,
};
pub use settings::{FitSettings, Keep, MAX_GARMENT_VERTICES, MIN_TRIANGLES};
pub use sitting::Sitting;

use crate::asset::{Body, Garment};
use crate::format::{FileFace, PolygonMesh};
use crate::mesh::{Attachment, MeshMeasures, bounds, contact, join_seams, push_out};
use category::{contradiction, guessed};
use cloth::Cloth;
use clothcombo_physics::contact::{self_triangle_pairs, triangle_pairs};
use clothcombo_physics::mesh::vertex_normals;
use clothcombo_physics::vec3::{norm, sub};
use clothcombo_physics::{Topology, TriMesh};
use diagnosis::diagnosed;
use from_body::{POSE_BINDINGS, SameModel, SourceCloth};
use limb_pose::LimbPose;
use repair::{finish_seams, gaps, repair, turn_outward};
use search::{Search, SearchBody};
use settings::{LEAST_PIECE, MOST_STRETCH, MOST_STRETCHED};
use sheet::mesh_of;
use verdict::{ARMS_MISS, PlacementVerdict, verdict};

/// Least distance between a fitted vertex and the body (m): the ε of the paper's body collision loss.
const FIT_CLEARANCE: f64 = 0.002;

/// Widest open seam that does not keep panels from being placed, as a share of the garment's extent.
const SEAM_SHARE: f64 = 0.01;

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
    /// For every vertex of the file the place on the garment that it follows, dropped or not.
    pub follows: Vec<Attachment>,
    /// For every vertex of the garment the first vertex of the file that became it; ascending.
    pub vertex_origin: Vec<u32>,
    /// The garment's faces as polygons of the file where they still are, else as triangles; ascending by the file's face. As fans
    /// around their first corners they are the garment's triangles.
    pub file_faces: Vec<FileFace>,
}

impl Fitted {
    /// Positions of the file's vertices, in their order, when the garment's are at `positions` (m).
    pub fn in_file_order(&self, positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
        in_file_order(&self.follows, positions, self.garment.rest.faces())
    }
}

/// Positions (m) of the vertices of a file that follow a garment of `faces` at `positions`.
pub fn in_file_order(follows: &[Attachment], positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<[f64; 3]> {
    // Most garments have no vertex that needs them.
    let is_vertex = |place: &Attachment| place.offset == [0.0; 3];
    let normals = match follows.iter().all(is_vertex) {
        true => Vec::new(),
        false => vertex_normals(positions, faces),
    };
    follows.iter().map(|place| place.position(positions, &normals)).collect()
}

/// Fits a mesh to the zero body of `body`.
///
/// # Errors
/// [`FitError`] if the mesh is not a garment of this body, with the reason.
pub fn fit(file: &PolygonMesh, body: &Body, settings: &FitSettings) -> Result<Fitted, FitError> {
    let mut sheet = repair(file, settings)?;
    let mesh = sheet.mesh()?;
    let topology = Topology::new(&mesh);
    if topology.boundary_loops.is_empty() {
        return Err(FitError::Closed);
    }
    let (pieces_found, triangles) = (topology.component_count, mesh.face_count());
    if LEAST_PIECE * pieces_found > triangles {
        return Err(FitError::Scattered { pieces: pieces_found, triangles });
    }

    let measured = SearchBody::new(body)?;
    let search = Search { body, measured: &measured };
    let cloth = Cloth::new(&sheet.positions, &sheet.faces, &topology);
    if search.plausible_units(&cloth, settings).is_empty() {
        let too_large =
            FitError::Extent { extent: cloth.extent(), unit: settings.unit, reach: measured.reach };
        return Err(diagnosed(&search, &cloth, settings).unwrap_or(too_large));
    }
    let source = settings.from_body.as_deref().map(|b| b.aligned(body, settings)).transpose()?;
    let (placement, mut doubts) = match &source {
        Some(source) => (source.placement, Vec::new()),
        None => {
            let PlacementVerdict { placement, doubts, .. } = place(&search, &cloth, settings)?;
            (placement, doubts)
        }
    };
    let metres = placement.unit.metres();
    let borders = settings.join_seams.map(|_| sheet.borders(&topology));
    let mut seams = finish_seams(&mut sheet, file, settings, metres);
    let topology = Topology::new(&sheet.mesh()?);
    let placed = placement.apply(&sheet.positions);
    let (mut positions, from_body) = match &source {
        Some(source) => {
            let (carried, how) = source.carry(&sheet.positions, &sheet.faces, settings.category, body)?;
            (carried, Some(how))
        }
        None if placement.has_limbs_at_rest() => (placed, None),
        None => {
            let cloth = SourceCloth { positions: &placed, faces: &sheet.faces, category: settings.category };
            let straight = SameModel::posed(body, LimbPose::of(body, &placement))
                .and_then(|posed| posed.carry(&cloth, body, POSE_BINDINGS));
            (straight.map_err(FitError::Mesh)?, None)
        }
    };
    refuse_bodies(&positions, body)?;
    if let Some(place) = off_trunk(&positions, body) {
        if let Some(source) = &source {
            return Err(
                source.not_on_it(&format!("carried over, {}", place.replacen("it", "the garment", 1)))
            );
        }
        // Unit and axes alone do not make a hat a garment of the trunk.
        let is_said = settings.category.is_some() || settings.offset.is_some();
        take_or_refuse(is_said, FitError::OffTrunk { place }, &mut doubts)?;
    }
    let raised = Cloth::new(&positions, &sheet.faces, &topology);
    if let Some(source) = &source {
        match search.believed_as_given(&raised, &FitSettings::default()) {
            Err(odd) => doubts.push(source.doubt(&odd)),
            Ok(worn) if worn.piercing.arms > 0 => doubts.push(ARMS_MISS.into()),
            Ok(_) => {}
        }
    }
    let sitting = search.measured(&raised, &Placement::AS_GIVEN).0;
    let judge = search.judge(&raised, settings);
    let limbs = judge.limbs(&Placement::AS_GIVEN);
    if let Some(before) = borders {
        seams.extend(gaps(
            &sheet.borders(&topology),
            &before,
            &judge.is_linked(&Placement::AS_GIVEN),
            metres,
        ));
    }
    let rest_surface = search.surface();
    let worn = judge.worn_pieces(&Placement::AS_GIVEN);
    if let Some(piece) = stray_pieces(&positions, &topology, rest_surface, &worn).into_iter().next() {
        return Err(FitError::StrayPiece { piece });
    }

    turn_outward(&mut sheet, &positions, &topology, rest_surface);
    let follows = sheet.followed(file, metres);
    let before = contact(&positions, rest_surface);
    let unpushed = positions.clone();
    push_out(&mut positions, &sheet.faces, rest_surface, FIT_CLEARANCE);
    let share = stretched(&topology, &unpushed, &positions);
    if share > MOST_STRETCHED {
        take_or_refuse(settings.says_place(), FitError::Stretched { share }, &mut doubts)?;
    }
    let after = contact(&positions, rest_surface);
    let moves: Vec<f64> = positions.iter().zip(&unpushed).map(|(a, b)| norm(sub(*a, *b))).collect();
    let pushed = (0..moves.len()).filter(|v| moves[*v] > 0.0).map(|v| sheet.vertex_origin[v]).collect();
    sheet.note(RepairKind::PushedOut, Elements::Vertices(pushed));

    let rest = mesh_of(positions, sheet.faces.clone())?;
    // Faces have been turned.
    let topology = Topology::new(&rest);
    let category = settings.category.unwrap_or_else(|| guessed(&rest, body, limbs));
    doubts.extend(contradiction(category, limbs));
    let holding = Garment::needs_holding(&rest, body);
    let of_file = |e: &[u32; 2]| e.map(|v| sheet.vertex_origin[v as usize]);
    let dropped_pieces = sheet.dropped_pieces.iter();
    let dropped_pieces =
        dropped_pieces.map(|p| MeshPiece { area: p.area * metres * metres, ..p.clone() }).collect();
    let file_faces = sheet.file_faces(file);
    let mut pieces = MeshPiece::all(&rest, &topology);
    pieces.sort_by(|a, b| b.area.total_cmp(&a.area));
    let report = FitReport {
        file_vertices: file.positions.len(),
        file_faces: file.polygon_count(),
        placement,
        from_body,
        sitting,
        doubts,
        repairs: sheet.repairs,
        seams,
        dropped_pieces,
        unrepaired_edges: topology.non_manifold_edges.iter().map(of_file).collect(),
        pieces,
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
    let (vertex_of_file, vertex_origin) = (sheet.vertex_of_file, sheet.vertex_origin);
    Ok(Fitted { garment, report, vertex_of_file, follows, vertex_origin, file_faces })
}

/// Where the garment belongs: legs that stand apart are looked for, and open seams taken as sewn, only if it is worn nowhere else.
fn place(search: &Search, cloth: &Cloth, settings: &FitSettings) -> Result<PlacementVerdict, FitError> {
    let of = |cloth: &Cloth| verdict(&search.candidates(cloth, settings), search, cloth, settings);
    let as_given = of(cloth);
    let is_worn = match &as_given {
        Ok(verdict) => !verdict.is_odd,
        Err(error) => !matches!(error, FitError::Implausible { .. } | FitError::OffTrunk { .. }),
    };
    if is_worn {
        return as_given;
    }
    if settings.arms_lowered == Some(true) {
        // That says nothing about a garment that no arm passes through.
        let known = FitSettings { arms_lowered: None, ..settings.clone() };
        let found = place(search, cloth, &known);
        let judge = search.judge(cloth, &known);
        if let Some(verdict) = found.ok().filter(|v| !v.is_odd && !judge.limbs(&v.placement).arms) {
            return Ok(verdict);
        }
    }
    let apart = search.candidates_apart(cloth, settings);
    if let Some(verdict) = verdict(&apart, search, cloth, settings).ok().filter(|v| !v.is_odd) {
        return Ok(verdict);
    }
    let sewn = join_seams(cloth.positions, cloth.faces, Some(SEAM_SHARE * cloth.extent()));
    if let Some(mesh) = sewn.and_then(|sewn| TriMesh::new(sewn.positions, sewn.faces).ok()) {
        let topology = Topology::new(&mesh);
        let sewn = of(&Cloth::new(mesh.positions(), mesh.faces(), &topology));
        if let Some(verdict) = sewn.ok().filter(|v| !v.is_odd) {
            return Ok(verdict);
        }
    }
    as_given.map_err(|error| diagnosed(search, cloth, settings).unwrap_or(error))
}

/// Share of the edges that became longer than [`MOST_STRETCH`] times what they were.
fn stretched(topology: &Topology, before: &[[f64; 3]], after: &[[f64; 3]]) -> f64 {
    let is_long = |edge: &&[u32; 2]| {
        let [now, rest] = [after, before].map(|p| norm(sub(p[edge[1] as usize], p[edge[0] as usize])));
        now > MOST_STRETCH * rest
    };
    topology.edges.iter().filter(is_long).count() as f64 / topology.edges.len().max(1) as f64
}

/// What refuses a garment is a warning where hints say that it is worn so.
fn take_or_refuse(is_said: bool, error: FitError, doubts: &mut Vec<String>) -> Result<(), FitError> {
    match is_said {
        true => doubts.push(error.to_string()),
        false => return Err(error),
    }
    Ok(())
}

/// Refuses what reaches from the crown to the soles within 4 cm and to both hands within 10 cm.
fn refuse_bodies(positions: &[[f64; 3]], body: &Body) -> Result<(), FitError> {
    let (low, high) = body.zero_body().bounds();
    let [lowest, highest] = bounds(positions);
    let spans = |a: usize, slack: f64| lowest[a] < low[a] + slack && highest[a] > high[a] - slack;
    if spans(1, 0.04) && spans(0, 0.1) {
        return Err(FitError::Body);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
