//! Rest shapes and topologies that a garment should not have, and files in the wrong unit.

use super::case::DegenerateCase;
use super::fixture::{Fixture, below, cloth, with_vertex};
use super::scene::{CaseError, CaseScene};
use clothcombo_physics::mesh::shapes::{mapped, union};
use clothcombo_physics::{TriMesh, vec3};

/// An interior vertex of the piece of cloth, and the one beside it.
pub(super) const MIDDLE: usize = 24;
pub(super) const BESIDE: usize = 25;

pub(super) const CASES: &[DegenerateCase] = &[
    DegenerateCase::bounded(
        "plain sheet",
        "A piece of cloth through the chest, stretched by 5 %: nothing hard, for comparison.",
        |w| stretched(w, w.sheet()),
    ),
    DegenerateCase::bounded(
        "zero-area rest triangles",
        "Two neighbouring vertices share one place in the rest shape and nearly so in the drape.",
        |w| {
            let sheet = w.sheet();
            stretched(w, with_vertex(&sheet, MIDDLE, sheet.positions()[BESIDE])?)
        },
    ),
    DegenerateCase::bounded(
        "zero-area rest triangles, opened",
        "The same rest shape, draped as if its triangles had their full area.",
        |w| {
            let sheet = w.sheet();
            let rest = with_vertex(&sheet, MIDDLE, sheet.positions()[BESIDE])?;
            w.two_layers(rest, sheet.positions().to_vec())
        },
    ),
    DegenerateCase::bounded(
        "one needle rest triangle",
        "A rest vertex a nanometre beside its neighbour, draped with full triangles.",
        |w| {
            let sheet = w.sheet();
            let beside = vec3::add(sheet.positions()[BESIDE], [0.0, 1e-9, 0.0]);
            w.two_layers(with_vertex(&sheet, MIDDLE, beside)?, sheet.positions().to_vec())
        },
    ),
    DegenerateCase::bounded(
        "needle rest triangles",
        "Every rest triangle is a million times wider than high, the drape is an ordinary sheet.",
        |w| {
            let sheet = w.sheet();
            let [_, y, z] = w.before_chest([0.0; 3]);
            let needles = mapped(&sheet, |p| [p[0], y + 1e-6 * (p[1] - y), z]);
            w.two_layers(needles, sheet.positions().to_vec())
        },
    ),
    DegenerateCase::bounded("non-manifold edge", "Three faces meet at one edge.", |w| {
        let sheet = w.sheet();
        let mut positions = sheet.positions().to_vec();
        positions.push(w.before_chest([0.0, 0.03, 0.02]));
        let last = positions.len() as u32 - 1;
        let [a, b, _] = sheet.faces()[20];
        let faces = sheet.faces().iter().copied().chain([[b, a, last]]).collect();
        stretched(w, TriMesh::new(positions, faces)?)
    }),
    DegenerateCase::bounded("flipped face", "One face is oriented against its neighbours.", |w| {
        let sheet = w.sheet();
        let mut faces = sheet.faces().to_vec();
        faces[20].swap(0, 1);
        stretched(w, TriMesh::new(sheet.positions().to_vec(), faces)?)
    }),
    DegenerateCase::bounded("isolated vertex", "A vertex that no face uses.", |w| {
        let sheet = w.sheet();
        let mut positions = sheet.positions().to_vec();
        positions.push(w.before_chest([0.01, 0.02, 0.003]));
        stretched(w, TriMesh::new(positions, sheet.faces().to_vec())?)
    }),
    DegenerateCase::bounded("many components", "Every face is a component of its own.", |w| {
        let sheet = w.sheet();
        let single =
            (0..sheet.face_count()).map(|f| TriMesh::new(sheet.corners(f).to_vec(), vec![[0, 1, 2]]));
        let single = single.collect::<Result<Vec<_>, _>>()?;
        let rest = union(&single.iter().collect::<Vec<_>>());
        // Apart, so that corners that were one vertex do not coincide.
        let posed = rest
            .positions()
            .iter()
            .enumerate()
            .map(|(v, p)| vec3::add(*p, [1e-3 * (v / 3 % 5) as f64, 1e-3 * (v / 3 % 7) as f64, 0.0]));
        let posed = posed.collect();
        w.two_layers(rest, posed)
    }),
    DegenerateCase::bounded(
        "one triangle",
        "The smallest garment: no hinge, and no two vertices without an edge.",
        |w| {
            let corners = [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.02, 0.0]].map(|p| w.before_chest(p));
            stretched(w, TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?)
        },
    ),
    DegenerateCase::bounded(
        "rest a thousand times too large",
        "The rest shape was read in millimetres, the drape is in metres.",
        |w| {
            let sheet = w.sheet();
            w.two_layers(mapped(&sheet, |p| vec3::scale(p, 1e3)), sheet.positions().to_vec())
        },
    ),
    DegenerateCase::bounded(
        "rest a thousand times too small",
        "The rest shape was divided by a thousand once too often, the drape is in metres.",
        |w| {
            let sheet = w.sheet();
            w.two_layers(mapped(&sheet, |p| vec3::scale(p, 1e-3)), sheet.positions().to_vec())
        },
    ),
    DegenerateCase::bounded(
        "garment in millimetres",
        "Rest shape and drape are both in millimetres, on a body in metres.",
        |w| {
            let large = mapped(&w.sheet(), |p| vec3::scale(p, 1e3));
            stretched(w, large)
        },
    ),
];

/// Two layers of `rest`, stretched by 5 % about its place before the chest.
pub(super) fn stretched(w: &Fixture<'_>, rest: TriMesh) -> Result<CaseScene, CaseError> {
    let centre = w.before_chest([0.0; 3]);
    let posed = mapped(&rest, |p| vec3::add_scaled(centre, 1.05, vec3::sub(p, centre))).positions().to_vec();
    let inner = cloth("inner", rest, posed);
    let outer = below(&inner);
    w.scene(vec![inner, outer])
}
