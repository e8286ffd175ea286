//! Where a garment is, how large, and how many there are.

use super::case::{DegenerateCase, bounded};
use super::fixture::{Fixture, cloth};
use super::scene::{CaseError, CaseGarment};
use crate::mesh::compact;
use clothcombo_physics::mesh::shapes::{mapped, tube};
use clothcombo_physics::{TriMesh, vec3, vertex_normals};

/// Layers of the deepest outfit.
const STACKED_LAYERS: usize = 12;

pub(super) const PLACE_CASES: &[DegenerateCase] = &[
    bounded("inside the body", "The whole garment lies in the middle of the chest.", |w| {
        let middle = [w.chest[0], w.chest[1], 0.5 * w.chest[2]];
        let centre = w.before_chest([0.0; 3]);
        w.draped(|p| vec3::add_scaled(middle, 0.3, vec3::sub(p, centre)))
    }),
    bounded("far away", "The garment is 100 m from the body.", |w| {
        w.draped(|p| vec3::add(p, [60.0, 0.0, 80.0]))
    }),
    bounded("far behind", "The garment is 100 m behind the body.", |w| {
        w.draped(|p| vec3::add(p, [0.0, 0.0, -100.0]))
    }),
    bounded("exactly on the body", "A piece of the body's own surface: every distance is zero.", |w| {
        let skin = chest_skin(w)?;
        w.two_layers(skin.clone(), &skin)
    }),
    bounded("a million metres away", "Coordinates so large that f32 resolves six centimetres.", |w| {
        w.draped(|p| vec3::add(p, [1e6, 0.0, 0.0]))
    }),
    bounded(
        "stretched to a million metres",
        "An explosion: every vertex is a thousand kilometres from the next.",
        |w| w.draped(|p| vec3::scale(p, 5e6)),
    ),
    bounded(
        "50,000 vertices",
        "A cape from the trunk to metres around it, with a coarse garment over it.",
        |w| {
            // A cape: close to the trunk at the top, metres wide at the bottom.
            let around_trunk = |radius: f64, around, along| {
                mapped(&tube(1.0, 1.0, around, along), |[x, y, z]| {
                    let wide = radius + 1.4 * (1.0 - y);
                    [wide * x, 1.2 * y - 0.85, 0.75 * wide * z]
                })
            };
            let wavy = |mesh: &TriMesh| {
                let wave = |[x, y, z]: [f64; 3]| {
                    let ripple = 1.0 + 0.02 * (40.0 * y).sin() + 0.01 * (9.0 * x.atan2(z)).cos();
                    [ripple * x, y, ripple * z]
                };
                mapped(mesh, wave)
            };
            let (dense, coarse) = (around_trunk(0.15, 400, 124), around_trunk(0.149, 20, 10));
            let (dense_posed, coarse_posed) = (wavy(&dense), wavy(&coarse));
            w.scene(vec![cloth("dense", dense, &dense_posed), cloth("coarse", coarse, &coarse_posed)])
        },
    ),
    bounded(
        "12 layers",
        "Twelve T-shirts over each other, a millimetre apart, every other one in the wrong order.",
        |w| {
            let shirt = w.t_shirt();
            let normals = vertex_normals(&shirt.posed, shirt.garment.rest.faces());
            let layer = |i: usize| {
                // 1, 0, 3, 2, … mm.
                let distance = 1e-3 * (i ^ 1) as f64 - 4e-3;
                let moved = |p: &[[f64; 3]]| {
                    p.iter().zip(&normals).map(|(p, n)| vec3::add_scaled(*p, distance, *n)).collect()
                };
                let mut garment = shirt.garment.clone();
                garment.holding = true;
                CaseGarment { canonical: moved(&shirt.canonical), posed: moved(&shirt.posed), garment }
            };
            w.scene((0..STACKED_LAYERS).map(layer).collect())
        },
    ),
];

/// The faces of the zero body whose corners lie within 10 cm of the chest.
fn chest_skin(w: &Fixture<'_>) -> Result<TriMesh, CaseError> {
    let body = w.body.zero_body();
    let near = |v: u32| vec3::distance_squared(body.positions()[v as usize], w.chest) < 0.01;
    let faces = body.faces().iter().copied().filter(|face| face.iter().all(|v| near(*v)));
    let (used, faces) = compact(faces, body.vertex_count());
    let positions = used.iter().map(|v| body.positions()[*v as usize]).collect();
    Ok(TriMesh::new(positions, faces)?)
}
