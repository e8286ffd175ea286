//! Input that cannot be a garment: refused when it is loaded, with the element at fault by name.

use super::case::{DegenerateCase, Expectation};
use super::fixture::{Fixture, with_vertex};
use super::scene::{CaseError, CaseScene};
use clothcombo_physics::TriMesh;
use clothcombo_physics::mesh::shapes::mapped;

const fn refused(
    name: &'static str,
    description: &'static str,
    text: &'static str,
    build: fn(&Fixture<'_>) -> Result<CaseScene, CaseError>,
) -> DegenerateCase {
    DegenerateCase { name, description, expectation: Expectation::Refused(text), build }
}

pub(super) const CASES: &[DegenerateCase] = &[
    refused(
        "rest without area",
        "Every rest vertex lies on one line: nothing to measure strain by.",
        "all 72 faces",
        |w| {
            let [_, y, z] = w.before_chest([0.0; 3]);
            let sheet = w.sheet();
            let posed = sheet.positions().to_vec();
            w.two_layers(mapped(&sheet, |p| [p[0], y, z]), posed)
        },
    ),
    refused("vertex that is not a number", "A coordinate of the rest shape is NaN.", "vertex 24 ", |w| {
        let sheet = w.sheet();
        let rest = with_vertex(&sheet, 24, [0.0, f64::NAN, 0.0])?;
        w.two_layers(rest, sheet.positions().to_vec())
    }),
    refused("face with a repeated vertex", "A face names one vertex twice.", "face 20 uses vertex", |w| {
        let sheet = w.sheet();
        let mut faces = sheet.faces().to_vec();
        faces[20][1] = faces[20][0];
        let posed = sheet.positions().to_vec();
        w.two_layers(TriMesh::new(posed.clone(), faces)?, posed)
    }),
    refused(
        "face with a missing vertex",
        "A face names a vertex past the last one.",
        "face 20 uses vertex 49",
        |w| {
            let sheet = w.sheet();
            let mut faces = sheet.faces().to_vec();
            faces[20][1] = 49;
            let posed = sheet.positions().to_vec();
            w.two_layers(TriMesh::new(posed.clone(), faces)?, posed)
        },
    ),
];
