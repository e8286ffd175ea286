//! What fitting assumed and changed, element by element.

use super::from_body::SourcePlacement;
use super::placement::{FileOrigin, Placement};
use super::sitting::Sitting;
use crate::asset::Category;
use crate::mesh::{MeshMeasures, Seam};
use clothcombo_physics::{Topology, TriMesh};
use serde::Serialize;
use std::fmt;

/// A kind of repair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RepairKind {
    /// Vertices no face uses, or only faces that were dropped, were left out.
    DroppedIsolatedVertices,
    /// Vertices far from all others, with their faces.
    DroppedFarVertices,
    /// Vertices at the place of another one became that one.
    WeldedVertices,
    /// Faces with more than three corners were cut into triangles.
    TriangulatedFaces,
    /// Faces without area were dropped.
    DroppedDegenerateFaces,
    /// Faces with the corners of an earlier one were dropped.
    DroppedRepeatedFaces,
    /// Edges with more than two faces were cut so that at most two stay joined.
    CutNonManifoldEdges,
    /// Vertices where pieces touch without an edge were given to each piece.
    SplitVertices,
    /// Edges were cut because the surface has only one side (a Möbius band).
    CutOneSidedEdges,
    /// Faces of the inner sheet and the rims of thick cloth were dropped.
    DroppedInnerSheet,
    /// Faces of all pieces but the largest were dropped.
    DroppedPieces,
    /// Vertices of borders that run along each other were joined.
    JoinedSeams,
    /// Faces were turned, to agree with their neighbours and to face away from the body.
    TurnedFaces,
    /// Vertices were moved out of the body, or away from it to the least distance.
    PushedOut,
}

impl RepairKind {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Self::DroppedFarVertices => "dropped vertices far from all others",
            Self::DroppedIsolatedVertices => "dropped isolated vertices",
            Self::WeldedVertices => "welded duplicate vertices",
            Self::TriangulatedFaces => "triangulated faces",
            Self::DroppedDegenerateFaces => "dropped degenerate faces",
            Self::DroppedRepeatedFaces => "dropped repeated faces",
            Self::CutNonManifoldEdges => "cut non-manifold edges",
            Self::SplitVertices => "split vertices that only touch",
            Self::CutOneSidedEdges => "cut edges of a one-sided surface",
            Self::DroppedInnerSheet => "dropped the inner sheet and rims of thick cloth",
            Self::DroppedPieces => "dropped all pieces but the largest",
            Self::JoinedSeams => "joined vertices of open seams",
            Self::TurnedFaces => "turned faces",
            Self::PushedOut => "pushed vertices out of the body",
        }
    }
}

/// Elements of the file, counted from 0 in the order the file has them.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Elements {
    /// Vertices.
    Vertices(Vec<u32>),
    /// Faces (polygons).
    Faces(Vec<u32>),
    /// Edges, by their vertices.
    Edges(Vec<[u32; 2]>),
}

impl Elements {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::Vertices(list) | Self::Faces(list) => list.len(),
            Self::Edges(list) => list.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl fmt::Display for Elements {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN_ELEMENTS: usize = 8;
        let (what, shown): (_, Vec<String>) = match self {
            Self::Vertices(list) => {
                ("vertex", list.iter().take(SHOWN_ELEMENTS).map(u32::to_string).collect())
            }
            Self::Faces(list) => ("face", list.iter().take(SHOWN_ELEMENTS).map(u32::to_string).collect()),
            Self::Edges(list) => {
                ("edge", list.iter().take(SHOWN_ELEMENTS).map(|[a, b]| format!("{a}–{b}")).collect())
            }
        };
        write!(f, "{what} {}", shown.join(", "))?;
        match self.len() {
            n if n > SHOWN_ELEMENTS => write!(f, " and {} more", n - SHOWN_ELEMENTS),
            _ => Ok(()),
        }
    }
}

/// One repair.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repair {
    /// What was done.
    pub kind: RepairKind,
    /// To how many elements.
    pub count: usize,
    /// To which.
    pub elements: Elements,
}

/// A connected piece of the fitted garment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshPiece {
    /// Vertices.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Area (m²).
    pub area: f64,
    /// Boundary curves; none means a closed piece, such as a button.
    pub boundary_loops: usize,
}

impl MeshPiece {
    /// All connected pieces of a mesh, by their number in `topology`.
    pub(super) fn all(mesh: &TriMesh, topology: &Topology) -> Vec<Self> {
        let empty = Self { vertices: 0, triangles: 0, area: 0.0, boundary_loops: 0 };
        let mut pieces = vec![empty; topology.component_count];
        let piece = |v: u32| topology.component_of_vertex[v as usize] as usize;
        topology.component_of_vertex.iter().for_each(|c| pieces[*c as usize].vertices += 1);
        for (f, face) in mesh.faces().iter().enumerate() {
            pieces[piece(face[0])].triangles += 1;
            pieces[piece(face[0])].area += mesh.face_area(f);
        }
        topology.boundary_loops.iter().for_each(|l| pieces[piece(l[0])].boundary_loops += 1);
        pieces
    }
}

impl fmt::Display for MeshPiece {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { vertices, triangles, area, boundary_loops } = self;
        write!(f, "{vertices} vertices, {triangles} triangles, {area:.4} m², ")?;
        match boundary_loops {
            0 => write!(f, "closed"),
            1 => write!(f, "1 boundary loop"),
            n => write!(f, "{n} boundary loops"),
        }
    }
}

/// Two borders of the file that run along each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SeamReport {
    /// Whether they were joined.
    pub joined: bool,
    /// Length (mm).
    pub length_mm: f64,
    /// Median distance between the borders (mm).
    pub gap_mm: f64,
    /// Largest distance between them (mm).
    pub widest_mm: f64,
    /// First and last vertex of one of the borders in the file, counted from 0.
    pub vertices: [u32; 2],
}

impl SeamReport {
    /// `metres` of the file's unit; the ends are vertices of the file.
    pub(super) fn new(seam: &Seam, metres: f64, joined: bool) -> Self {
        let [length_mm, gap_mm, widest_mm] =
            [seam.length, seam.gap, seam.widest].map(|length| 1e3 * metres * length);
        Self { joined, length_mm, gap_mm, widest_mm, vertices: seam.ends }
    }
}

/// Where the fitted garment and the body meet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct BodyContact {
    /// Vertices inside the body before pushing out.
    pub inside_before: usize,
    /// Deepest of them (mm).
    pub depth_before_mm: f64,
    /// Vertices inside the body after it.
    pub inside_after: usize,
    /// Least distance of a vertex to the body after it (mm).
    pub least_distance_mm: f64,
    /// Largest move of a vertex (mm).
    pub largest_move_mm: f64,
    /// Garment and body triangles that intersect afterwards (exact).
    pub body_triangle_pairs: usize,
    /// Triangles of the garment that intersect each other (exact).
    pub self_triangle_pairs: usize,
}

/// What speaks against a garment at rest whose vertices lie inside the body, or whose triangles intersect it or each other.
pub fn contact_warnings(inside: usize, body_pairs: usize, self_pairs: usize) -> Vec<String> {
    let body =
        || format!("{inside} vertices inside the body at rest, {body_pairs} intersecting triangle pairs");
    let own = || format!("{self_pairs} self-intersecting triangle pairs");
    let of_body = (inside > 0 || body_pairs > 0).then(body);
    of_body.into_iter().chain((self_pairs > 0).then(own)).collect()
}

/// What speaks against a file of which this many connected pieces are worn on their own.
pub fn outfit_warning(worn_pieces: usize) -> Option<String> {
    (worn_pieces > 1).then(|| {
        format!(
            "{worn_pieces} of its pieces would be worn without the others: for an outfit, export one file per garment"
        )
    })
}

/// Everything that was assumed, repaired and measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitReport {
    /// Vertices in the file.
    pub file_vertices: usize,
    /// Faces in the file.
    pub file_faces: usize,
    /// Unit, axes, origin and arm pose.
    pub placement: Placement,
    /// Through which body it was placed, if through one.
    pub from_body: Option<SourcePlacement>,
    /// How the garment sat there before anything was pushed.
    pub sitting: Sitting,
    /// What speaks against the placement: readings nearly as good, each with the flags that settle it.
    pub doubts: Vec<String>,
    /// All repairs, in the order they were made.
    pub repairs: Vec<Repair>,
    /// Seams that were joined, and those that stay open.
    pub seams: Vec<SeamReport>,
    /// Pieces that were left out on request, the largest first.
    pub dropped_pieces: Vec<MeshPiece>,
    /// Edges that still have more than two faces, by vertices of the file.
    pub unrepaired_edges: Vec<[u32; 2]>,
    /// Connected pieces, the largest first.
    pub pieces: Vec<MeshPiece>,
    /// Category, given or guessed from the shape.
    pub category: Category,
    /// Whether it lies wholly below the collarbone, so that its rim is held.
    pub holding: bool,
    /// The fitted mesh.
    pub mesh: MeshMeasures,
    /// Contact with the body.
    pub contact: BodyContact,
}

/// A garment of which a larger share lies inside the body, and deeper than [`MISFIT_DEPTH_MM`], lies wrongly on it.
const MISFIT_INSIDE: f64 = 0.1;
/// See [`MISFIT_INSIDE`].
const MISFIT_DEPTH_MM: f64 = 30.0;

impl FitReport {
    /// Why the garment does not lie on the body as clothes do; `None` if it does.
    pub fn misfit(&self) -> Option<String> {
        let BodyContact { inside_before, depth_before_mm, .. } = self.contact;
        let inside = inside_before as f64 / self.mesh.vertices.max(1) as f64;
        (inside > MISFIT_INSIDE && depth_before_mm > MISFIT_DEPTH_MM).then(|| {
            format!(
                "{:.0} % of it lay inside the body, up to {depth_before_mm:.0} mm deep: is it of another size, upside down or turned?",
                100.0 * inside
            )
        })
    }

    /// Everything that should be looked at; the last ones are those of `check` about the fitted mesh.
    pub fn warnings(&self) -> Vec<String> {
        let c = &self.contact;
        let edges =
            self.unrepaired_edges.iter().map(|[a, b]| format!("edge {a}–{b} still has more than two faces"));
        let defects = self.mesh.defects.counts().into_iter().map(|(count, name)| format!("{count} {name}"));
        let contact = contact_warnings(c.inside_after, c.body_triangle_pairs, c.self_triangle_pairs);
        edges.chain(self.doubts.iter().cloned()).chain(self.misfit()).chain(defects).chain(contact).collect()
    }

    /// The assumptions in words, one a line.
    pub fn assumptions(&self) -> Vec<String> {
        let p = &self.placement;
        let [x, y, z] = p.translation.map(|t| 1e3 * t);
        let origin = match p.origin {
            FileOrigin::Pelvis => "the file's origin is the pelvis of the body".to_string(),
            FileOrigin::Floor => {
                format!("the file's origin is on the floor below the pelvis (moved by {y:.0} mm)")
            }
            FileOrigin::SourceBody => self.from_body.as_ref().map(SourcePlacement::text).unwrap_or_default(),
            FileOrigin::Elsewhere => {
                format!("the file's origin is not the body's: moved by {x:.0}, {y:.0}, {z:.0} mm")
            }
        };
        let arms = match p.arm_angle_degrees {
            0.0 => "T-pose".to_string(),
            a => format!("A-pose: the arms hang {a:.0}° below the horizontal; raised to the T-pose"),
        };
        let legs = match p.leg_angle_degrees {
            0.0 => None,
            apart => Some(format!("each leg is turned outwards by {apart:.0}°; brought to the rest pose")),
        };
        let facing = match p.turn_degrees {
            0.0 => "front".to_string(),
            turn => format!("turned by {turn}° about the vertical"),
        };
        let lines = [
            format!("unit {} (1 = {} m)", p.unit, p.unit.metres()),
            format!("up axis {}, {facing}", p.up),
            origin,
            arms,
            format!("category {}", self.category),
        ];
        lines.into_iter().chain(legs).collect()
    }
}

impl fmt::Display for FitReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "read      {} vertices, {} faces", self.file_vertices, self.file_faces)?;
        for line in self.assumptions() {
            writeln!(f, "assumed   {line}")?;
        }
        writeln!(
            f,
            "sits      {:.1} mm from the body on average, {:.1} % of it inside, cloth in {:.0} % of the directions around the trunk",
            1e3 * self.sitting.mean_distance,
            100.0 * self.sitting.inside,
            100.0 * self.sitting.wrap
        )?;
        if self.repairs.is_empty() {
            writeln!(f, "repaired  nothing")?;
        }
        for repair in &self.repairs {
            writeln!(f, "repaired  {}: {} ({})", repair.kind.text(), repair.count, repair.elements)?;
        }
        write_seams(f, &self.seams, true)?;
        write_seams(f, &self.seams, false)?;
        for piece in &self.dropped_pieces {
            writeln!(f, "dropped   {piece}")?;
        }
        for (number, piece) in self.pieces.iter().enumerate() {
            writeln!(f, "piece {number:<3} {piece}")?;
        }
        let (m, c) = (&self.mesh, &self.contact);
        writeln!(
            f,
            "result    {} vertices, {} triangles, edges {:.1} mm ({:.1}–{:.1})",
            m.vertices, m.triangles, m.edge_median_mm, m.edge_min_mm, m.edge_max_mm
        )?;
        for warning in self.warnings() {
            writeln!(f, "warning   {warning}")?;
        }
        writeln!(
            f,
            "contact   {} vertices were inside the body (up to {:.1} mm); now {}, closest {:.1} mm, {} triangle pairs intersect \
             the body, {} each other",
            c.inside_before,
            c.depth_before_mm,
            c.inside_after,
            c.least_distance_mm,
            c.body_triangle_pairs,
            c.self_triangle_pairs
        )?;
        write!(f, "holding   {}", if self.holding { "yes: it lies below the collarbone" } else { "no" })
    }
}

/// Seams in the report: how many of them are named one by one.
const SHOWN_SEAMS: usize = 8;

/// The joined or the open ones of `seams` in words; nothing if there are none.
fn write_seams(f: &mut fmt::Formatter<'_>, seams: &[SeamReport], joined: bool) -> fmt::Result {
    let found: Vec<&SeamReport> = seams.iter().filter(|seam| seam.joined == joined).collect();
    if found.is_empty() {
        return Ok(());
    }
    let count = if found.len() == 1 { "1 seam".to_owned() } else { format!("{} seams", found.len()) };
    let (head, verb) = if joined { ("repaired  joined", "ran") } else { ("open     ", "run") };
    writeln!(f, "{head} {count}: borders that {verb} along each other")?;
    for seam in found.iter().take(SHOWN_SEAMS) {
        let [first, last] = seam.vertices;
        writeln!(
            f,
            "          {:.0} mm long, {:.2} mm apart, between vertices {first} and {last}",
            seam.length_mm, seam.gap_mm
        )?;
    }
    if found.len() > SHOWN_SEAMS {
        writeln!(f, "          and {} more", found.len() - SHOWN_SEAMS)?;
    }
    let widest = found.iter().map(|seam| seam.widest_mm).fold(0.0, f64::max);
    match joined {
        true => Ok(()),
        false => {
            writeln!(f, "          join them with --join-seams {:.0}mm", (1.05 * widest).ceil().max(1.0))
        }
    }
}
