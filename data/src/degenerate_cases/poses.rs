//! Drapes of an ordinary rest shape that should not happen and do.

use super::case::DegenerateCase;
use super::fixture::{Fixture, cloth, with_vertex};
use super::rest_shapes::{BESIDE, MIDDLE};
use super::scene::{CaseError, CaseScene};
use clothcombo_physics::mesh::shapes::mapped;
use clothcombo_physics::{TriMesh, vec3};
use std::f64::consts::PI;

pub(super) const CASES: &[DegenerateCase] = &[
    DegenerateCase::bounded(
        "inverted triangles",
        "A vertex is pushed past the far edge of its triangles.",
        |w| {
            let sheet = w.sheet();
            let [here, there] = [MIDDLE, BESIDE].map(|v| sheet.positions()[v]);
            let past = vec3::add_scaled(here, 1.6, vec3::sub(there, here));
            let posed = with_vertex(&sheet, MIDDLE, past)?;
            w.two_layers(sheet, posed.positions().to_vec())
        },
    ),
    DegenerateCase::bounded(
        "mirrored garment",
        "Left and right are exchanged, every triangle is inverted.",
        |w| {
            let x = w.chest[0];
            draped(w, |p| [2.0 * x - p[0], p[1], p[2]])
        },
    ),
    DegenerateCase::bounded(
        "collapsed triangles",
        "Two neighbouring vertices of the drape share one place.",
        |w| {
            let sheet = w.sheet();
            let posed = with_vertex(&sheet, MIDDLE, sheet.positions()[BESIDE])?;
            w.two_layers(sheet, posed.positions().to_vec())
        },
    ),
    DegenerateCase::bounded(
        "collapsed to a line",
        "All vertices lie on one straight line: no triangle has an area.",
        |w| {
            let [_, y, z] = w.before_chest([0.0; 3]);
            draped(w, |p| [p[0], y, z])
        },
    ),
    DegenerateCase::bounded("collapsed to a point", "All vertices share one place.", |w| {
        let point = w.before_chest([0.0; 3]);
        draped(w, |_| point)
    }),
    DegenerateCase::bounded(
        "coincident vertices",
        "Two vertices that no edge joins share one place: the logarithm of zero.",
        |w| {
            let sheet = w.sheet();
            let posed = with_vertex(&sheet, 10, sheet.positions()[38])?;
            w.two_layers(sheet, posed.positions().to_vec())
        },
    ),
    DegenerateCase::bounded("hinge angle 0", "Two triangles in one plane.", |w| hinge(w, |p| p)),
    DegenerateCase::bounded(
        "hinge angle pi",
        "Two triangles folded flat onto each other, the free corners in one place.",
        |w| hinge(w, |[x, y, z]| [x.abs(), y, z]),
    ),
    DegenerateCase::bounded(
        "hinge angle pi, uneven",
        "The same with free corners that do not coincide.",
        |w| hinge(w, |[x, y, z]| [if x < 0.0 { -1.25 * x } else { x }, y, z]),
    ),
    DegenerateCase::bounded(
        "hinge angle just below pi",
        "Two triangles folded to within a milliradian of flat.",
        |w| hinge(w, |[x, y, z]| if x > 0.0 { turned([x, y, z], PI - 1e-3) } else { [x, y, z] }),
    ),
    DegenerateCase::bounded(
        "collapsed hinge edge",
        "The edge about which two triangles fold has no length.",
        |w| hinge(w, |[x, _, z]| [x, 0.0, z]),
    ),
    DegenerateCase::bounded(
        "folded in half",
        "A sheet lies on itself: many hinges at an angle of pi, many vertex pairs close by.",
        |w| {
            let x = w.chest[0];
            draped(w, |p| if p[0] > x { [2.0 * x - p[0], p[1], p[2]] } else { p })
        },
    ),
    DegenerateCase::bounded(
        "two layers in one place",
        "The outer garment has exactly the positions of the inner one.",
        |w| {
            let sheet = w.sheet();
            let posed = sheet.positions().to_vec();
            w.scene(vec![cloth("inner", sheet.clone(), posed.clone()), cloth("outer", sheet, posed)])
        },
    ),
];

fn draped(w: &Fixture<'_>, f: impl Fn([f64; 3]) -> [f64; 3]) -> Result<CaseScene, CaseError> {
    let sheet = w.sheet();
    let posed = mapped(&sheet, f).positions().to_vec();
    w.two_layers(sheet, posed)
}

/// Two triangles about an edge along y before the chest, moved by `f` in a frame with the edge through the origin.
fn hinge(w: &Fixture<'_>, f: impl Fn([f64; 3]) -> [f64; 3]) -> Result<CaseScene, CaseError> {
    let corners = [[0.0, -0.02, 0.0], [0.0, 0.02, 0.0], [-0.03, 0.0, 0.0], [0.03, 0.0, 0.0]];
    let rest = corners.map(|p| w.before_chest(p)).to_vec();
    let posed = corners.map(|p| w.before_chest(f(p))).to_vec();
    w.two_layers(TriMesh::new(rest, vec![[0, 1, 2], [1, 0, 3]])?, posed)
}

/// Turned about the y axis, from x towards z.
fn turned([x, y, z]: [f64; 3], angle: f64) -> [f64; 3] {
    let (s, c) = angle.sin_cos();
    [x * c - z * s, y, x * s + z * c]
}
