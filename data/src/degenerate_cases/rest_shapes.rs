//! Rest shapes and topologies that a garment should not have, and files in the wrong unit.

use super::case::{DegenerateCase, bounded};
use super::fixture::{BESIDE_MIDDLE, Fixture, MIDDLE};
use super::scene::{CaseError, CaseScene};
use clothcombo_physics::mesh::shapes::{mapped, union};
use clothcombo_physics::{TriMesh, vec3};

pub(super) const REST_CASES: &[DegenerateCase] = &[
    bounded(
        "plain sheet",
        "A piece of cloth through the chest, stretched by 5 %: nothing hard, for comparison.",
        |w| stretched(w, w.sheet()),
    ),
    bounded(
        "zero-area rest triangles",
        "Two neighbouring vertices share one place in the rest shape and nearly so in the drape.",
        |w| stretched(w, w.sheet_with_joined_vertices(MIDDLE, BESIDE_MIDDLE)?),
    ),
    bounded(
        "zero-area rest triangles, opened",
        "The same rest shape, draped as if its triangles had their full area.",
        |w| w.with_rest(w.sheet_with_joined_vertices(MIDDLE, BESIDE_MIDDLE)?),
    ),
    bounded(
        "one needle rest triangle",
        "A rest vertex a nanometre beside its neighbour, draped with full triangles.",
        |w| {
            let beside = vec3::add(w.sheet().positions()[BESIDE_MIDDLE], [0.0, 1e-9, 0.0]);
            w.with_rest(w.sheet_with_vertex(MIDDLE, beside)?)
        },
    ),
    bounded(
        "needle rest triangles",
        "Every rest triangle is a million times wider than high, the drape is an ordinary sheet.",
        |w| {
            let [_, y, z] = w.before_chest([0.0; 3]);
            w.with_rest(mapped(&w.sheet(), |p| [p[0], y + 1e-6 * (p[1] - y), z]))
        },
    ),
    bounded("non-manifold edge", "Three faces meet at one edge.", |w| {
        let [a, b, _] = w.sheet().faces()[20];
        let last = w.sheet().vertex_count() as u32;
        stretched(w, with_more(w, [0.0, 0.03, 0.02], &[[b, a, last]])?)
    }),
    bounded("flipped face", "One face is oriented against its neighbours.", |w| {
        let mut faces = w.sheet().faces().to_vec();
        faces[20].swap(0, 1);
        stretched(w, TriMesh::new(w.sheet().positions().to_vec(), faces)?)
    }),
    bounded("isolated vertex", "A vertex that no face uses.", |w| {
        stretched(w, with_more(w, [0.01, 0.02, 0.003], &[])?)
    }),
    bounded("many components", "Every face is a component of its own.", |w| {
        let sheet = w.sheet();
        let single =
            (0..sheet.face_count()).map(|f| TriMesh::new(sheet.corners(f).to_vec(), vec![[0, 1, 2]]));
        let single = single.collect::<Result<Vec<_>, _>>()?;
        let rest = union(&single.iter().collect::<Vec<_>>());
        // Apart, so that corners that were one vertex do not coincide.
        let apart = |(v, p): (usize, &[f64; 3])| {
            vec3::add(*p, [1e-3 * (v / 3 % 5) as f64, 1e-3 * (v / 3 % 7) as f64, 0.0])
        };
        let posed = rest.with_positions(rest.positions().iter().enumerate().map(apart).collect())?;
        w.two_layers(rest, &posed)
    }),
    bounded("one triangle", "The smallest garment: no hinge, and no two vertices without an edge.", |w| {
        let corners = [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.02, 0.0]].map(|p| w.before_chest(p));
        stretched(w, TriMesh::new(corners.to_vec(), vec![[0, 1, 2]])?)
    }),
    bounded(
        "rest a thousand times too large",
        "The rest shape was read in millimetres, the drape is in metres.",
        |w| w.with_rest(mapped(&w.sheet(), |p| vec3::scale(p, 1e3))),
    ),
    bounded(
        "rest a thousand times too small",
        "The rest shape was divided by a thousand once too often, the drape is in metres.",
        |w| w.with_rest(mapped(&w.sheet(), |p| vec3::scale(p, 1e-3))),
    ),
    bounded(
        "garment in millimetres",
        "Rest shape and drape are both in millimetres, on a body in metres.",
        |w| stretched(w, mapped(&w.sheet(), |p| vec3::scale(p, 1e3))),
    ),
];

/// Two layers of `rest`, stretched by 5 % about its place before the chest.
fn stretched(w: &Fixture<'_>, rest: TriMesh) -> Result<CaseScene, CaseError> {
    let centre = w.before_chest([0.0; 3]);
    let posed = mapped(&rest, |p| vec3::add_scaled(centre, 1.05, vec3::sub(p, centre)));
    w.two_layers(rest, &posed)
}

/// The piece of cloth with another vertex, before the chest, and more `faces`.
fn with_more(w: &Fixture<'_>, vertex: [f64; 3], faces: &[[u32; 3]]) -> Result<TriMesh, CaseError> {
    let sheet = w.sheet();
    let positions = [sheet.positions(), &[w.before_chest(vertex)]].concat();
    Ok(TriMesh::new(positions, [sheet.faces(), faces].concat())?)
}
