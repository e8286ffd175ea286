//! Drapes of an ordinary rest shape that should not happen and do.

use super::case::{DegenerateCase, bounded};
use super::fixture::{BESIDE_MIDDLE, Fixture, MIDDLE, cloth};
use super::scene::{CaseError, CaseScene};
use clothcombo_physics::{TriMesh, vec3};
use std::f64::consts::PI;

pub(super) const POSE_CASES: &[DegenerateCase] = &[
    bounded("inverted triangles", "A vertex is pushed past the far edge of its triangles.", |w| {
        let [here, there] = [MIDDLE, BESIDE_MIDDLE].map(|v| w.sheet().positions()[v]);
        let past = vec3::add_scaled(here, 1.6, vec3::sub(there, here));
        w.two_layers(w.sheet(), &w.sheet_with_vertex(MIDDLE, past)?)
    }),
    bounded("mirrored garment", "Left and right are exchanged, every triangle is inverted.", |w| {
        w.draped(|p| [2.0 * w.chest[0] - p[0], p[1], p[2]])
    }),
    bounded("collapsed triangles", "Two neighbouring vertices of the drape share one place.", |w| {
        w.two_layers(w.sheet(), &w.sheet_with_joined_vertices(MIDDLE, BESIDE_MIDDLE)?)
    }),
    bounded("collapsed to a line", "All vertices lie on one straight line: no triangle has an area.", |w| {
        let [_, y, z] = w.before_chest([0.0; 3]);
        w.draped(|p| [p[0], y, z])
    }),
    bounded("collapsed to a point", "All vertices share one place.", |w| {
        let point = w.before_chest([0.0; 3]);
        w.draped(|_| point)
    }),
    bounded(
        "coincident vertices",
        "Two vertices that no edge joins share one place: the logarithm of zero.",
        |w| w.two_layers(w.sheet(), &w.sheet_with_joined_vertices(10, 38)?),
    ),
    bounded("hinge angle 0", "Two triangles in one plane.", |w| hinge(w, |p| p)),
    bounded(
        "hinge angle pi",
        "Two triangles folded flat onto each other, the free corners in one place.",
        |w| hinge(w, |[x, y, z]| [x.abs(), y, z]),
    ),
    bounded("hinge angle pi, uneven", "The same with free corners that do not coincide.", |w| {
        hinge(w, |[x, y, z]| [if x < 0.0 { -1.25 * x } else { x }, y, z])
    }),
    bounded("hinge angle just below pi", "Two triangles folded to within a milliradian of flat.", |w| {
        hinge(w, |[x, y, z]| if x > 0.0 { turned([x, y, z], PI - 1e-3) } else { [x, y, z] })
    }),
    bounded("collapsed hinge edge", "The edge about which two triangles fold has no length.", |w| {
        hinge(w, |[x, _, z]| [x, 0.0, z])
    }),
    bounded(
        "folded in half",
        "A sheet lies on itself: many hinges at an angle of pi, many vertex pairs close by.",
        |w| {
            let x = w.chest[0];
            w.draped(|p| if p[0] > x { [2.0 * x - p[0], p[1], p[2]] } else { p })
        },
    ),
    bounded(
        "two layers in one place",
        "The outer garment has exactly the positions of the inner one.",
        |w| w.scene(["inner", "outer"].map(|name| cloth(name, w.sheet(), &w.sheet())).into()),
    ),
];

/// Two triangles about an edge along y before the chest, moved by `f` in a frame with the edge through the origin.
fn hinge(w: &Fixture<'_>, f: impl Fn([f64; 3]) -> [f64; 3]) -> Result<CaseScene, CaseError> {
    let corners = [[0.0, -0.02, 0.0], [0.0, 0.02, 0.0], [-0.03, 0.0, 0.0], [0.03, 0.0, 0.0]];
    let rest = corners.map(|p| w.before_chest(p)).to_vec();
    let posed = corners.map(|p| w.before_chest(f(p))).to_vec();
    let rest = TriMesh::new(rest, vec![[0, 1, 2], [1, 0, 3]])?;
    let posed = rest.with_positions(posed)?;
    w.two_layers(rest, &posed)
}

/// Turned about the y axis, from x towards z.
fn turned([x, y, z]: [f64; 3], angle: f64) -> [f64; 3] {
    let (s, c) = angle.sin_cos();
    [x * c - z * s, y, x * s + z * c]
}
