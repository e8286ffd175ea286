//! Input that cannot be a garment: refused when it is loaded, with the element at fault by name.

use super::case::{DegenerateCase, refused};
use super::fixture::Fixture;
use super::scene::{CaseError, CaseScene};
use clothcombo_physics::TriMesh;
use clothcombo_physics::mesh::shapes::mapped;

pub(super) const BROKEN_CASES: &[DegenerateCase] = &[
    refused(
        "rest without area",
        "Every rest vertex lies on one line: nothing to measure strain by.",
        "all 72 faces",
        |w| {
            let [_, y, z] = w.before_chest([0.0; 3]);
            w.with_rest(mapped(&w.sheet(), |p| [p[0], y, z]))
        },
    ),
    refused("vertex that is not a number", "A coordinate of the rest shape is NaN.", "vertex 24 ", |w| {
        w.with_rest(w.sheet_with_vertex(24, [0.0, f64::NAN, 0.0])?)
    }),
    refused("face with a repeated vertex", "A face names one vertex twice.", "face 20 uses vertex", |w| {
        with_face(w, |face| face[1] = face[0])
    }),
    refused(
        "face with a missing vertex",
        "A face names a vertex past the last one.",
        "face 20 uses vertex 49",
        |w| with_face(w, |face| face[1] = 49),
    ),
];

/// The piece of cloth with another face 20.
fn with_face(w: &Fixture<'_>, change: impl Fn(&mut [u32; 3])) -> Result<CaseScene, CaseError> {
    let sheet = w.sheet();
    let mut faces = sheet.faces().to_vec();
    change(&mut faces[20]);
    w.with_rest(TriMesh::new(sheet.positions().to_vec(), faces)?)
}
