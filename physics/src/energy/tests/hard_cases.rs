//! Meshes and positions that break naive energies: values and gradients stay finite and bounded.

use super::scenes::{Scene, largest, paper_weights, scene_of};
use crate::energy::{EnergySettings, TermMap};
use crate::mesh::{TriMesh, shapes};
use crate::real::Real;
use crate::vec3;

/// A garment at rest and posed.
pub struct HardCase {
    pub name: &'static str,
    pub rest: TriMesh,
    pub posed: TriMesh,
}

fn sheet() -> TriMesh {
    let flat = shapes::irregular_grid(0.2, 0.2, 6, 6, 0.25, 9);
    // Through the side of the body.
    shapes::mapped(&flat, |[x, y, z]| [x - 0.1, y - 0.1, z + 0.14])
}

fn case(name: &'static str, rest: TriMesh, posed: impl Fn([f64; 3]) -> [f64; 3]) -> HardCase {
    let posed = shapes::mapped(&rest, posed);
    HardCase { name, rest, posed }
}

/// The rest mesh with one vertex replaced.
fn with_vertex(mesh: &TriMesh, v: usize, p: [f64; 3]) -> TriMesh {
    let mut positions = mesh.positions().to_vec();
    positions[v] = p;
    mesh.with_positions(positions).expect("finite")
}

/// The suite.
pub fn hard_cases() -> Vec<HardCase> {
    let sheet = sheet();
    let neighbour = sheet.positions()[25];
    let fold = |angle: f64| {
        move |[x, y, z]: [f64; 3]| {
            let (s, c) = angle.sin_cos();
            if x > 0.0 { [x * c, y, z + x * s] } else { [x, y, z] }
        }
    };
    let hinge = TriMesh::new(
        vec![[0.0, -0.02, 0.14], [0.0, 0.02, 0.14], [-0.03, 0.0, 0.14], [0.03, 0.0, 0.14]],
        vec![[0, 1, 2], [1, 0, 3]],
    )
    .expect("two triangles");
    let isolated = {
        let mut positions = sheet.positions().to_vec();
        positions.push([0.0, 0.05, 0.15]);
        TriMesh::new(positions, sheet.faces().to_vec()).expect("an extra vertex")
    };
    let non_manifold = {
        let mut positions = sheet.positions().to_vec();
        positions.push([0.0, 0.05, 0.16]);
        let last = positions.len() as u32 - 1;
        let [a, b, _] = sheet.faces()[20];
        let mut faces = sheet.faces().to_vec();
        faces.push([b, a, last]);
        TriMesh::new(positions, faces).expect("a fin")
    };
    let flipped = {
        let mut faces = sheet.faces().to_vec();
        faces[20].swap(0, 1);
        TriMesh::new(sheet.positions().to_vec(), faces).expect("a flipped face")
    };
    let one_triangle =
        TriMesh::new(vec![[0.0, 0.0, 0.14], [0.02, 0.0, 0.14], [0.0, 0.02, 0.14]], vec![[0, 1, 2]])
            .expect("one");
    vec![
        case("plain", sheet.clone(), |p| vec3::scale(p, 1.05)),
        case("zero-area rest triangles", with_vertex(&sheet, 24, neighbour), |p| vec3::scale(p, 1.05)),
        HardCase {
            name: "zero-area rest triangles, opened",
            rest: with_vertex(&sheet, 24, neighbour),
            posed: sheet.clone(),
        },
        case("needle rest triangles", shapes::mapped(&sheet, |[x, y, z]| [x, 1e-6 * y, z]), |[x, y, z]| {
            [x, 1e6 * y, z]
        }),
        case("inverted triangles", sheet.clone(), |[x, y, z]| [-x, y, z]),
        case("collapsed to a line", sheet.clone(), |[x, _, z]| [x, 0.0, z]),
        case("collapsed to a point, coincident vertices", sheet.clone(), |_| [0.0, 0.0, 0.14]),
        HardCase {
            name: "two coincident vertices",
            rest: sheet.clone(),
            posed: with_vertex(&sheet, 10, sheet.positions()[38]),
        },
        HardCase {
            name: "one collapsed edge",
            rest: sheet.clone(),
            posed: with_vertex(&sheet, 24, neighbour),
        },
        case("hinge angle 0", hinge.clone(), |p| p),
        case("hinge angle π", hinge.clone(), |[x, y, z]| [x.abs(), y, z]),
        case("hinge angle just below π", hinge.clone(), fold(std::f64::consts::PI - 1e-3)),
        case("collapsed hinge edge", hinge, |[x, _, z]| [x, 0.0, z]),
        case("folded in the middle", sheet.clone(), fold(std::f64::consts::PI)),
        case("isolated vertex", isolated, |p| vec3::scale(p, 1.05)),
        case("non-manifold edge", non_manifold, |p| vec3::scale(p, 1.05)),
        case("flipped face", flipped, |p| vec3::scale(p, 1.05)),
        case("one triangle", one_triangle, |p| vec3::scale(p, 1.05)),
        case("millimetres", shapes::mapped(&sheet, |p| vec3::scale(p, 1e-3)), |p| vec3::scale(p, 1e3)),
        case("inside the body", sheet.clone(), |[x, y, z]| [0.3 * x, 0.3 * y, z - 0.14]),
        case("far away", sheet.clone(), |[x, y, z]| [x + 1e4, y, z]),
        case("huge", sheet, |p| vec3::scale(p, 1e4)),
    ]
}

/// The case as two layers of the same garment on the body; `None` where `T` cannot hold it.
pub fn case_scene<T: Real>(rest: &TriMesh, posed: &TriMesh, weights: TermMap<f64>) -> Option<Scene<T>> {
    let settings = EnergySettings { layer_gate: None, ..EnergySettings::default() };
    let garments = vec![rest.clone(), rest.clone()];
    let mut scene = scene_of::<T>(garments, &super::scenes::body(4), settings, weights, 0.0, 1);
    let (first, second) = scene.posed.split_at_mut(rest.vertex_count());
    for v in 0..rest.vertex_count() {
        first[v] = vec3::from_f64(posed.positions()[v]);
        // The outer layer a millimetre below the inner one.
        second[v] = vec3::from_f64(vec3::sub(posed.positions()[v], [0.0, 0.0, 1e-3]));
    }
    scene.posed.iter().all(|p| vec3::is_finite(*p)).then_some(scene)
}

fn check<T: Real>(case: &HardCase) {
    let Some(scene) = case_scene::<T>(&case.rest, &case.posed, paper_weights()) else { return };
    let value = scene.energy.evaluate(&scene.posed, &scene.canonical);
    for raw in value.garments.iter().chain(&value.layers) {
        for (term, raw) in raw.iter() {
            assert!(raw.is_none_or(f64::is_finite), "{}: {term} is {raw:?}", case.name);
        }
    }
    assert!(value.total.is_finite(), "{}: total {}", case.name, value.total);
    let gradients = [&value.posed_gradient, &value.canonical_gradient];
    for gradient in gradients {
        assert!(gradient.as_flattened().iter().all(|g| g.is_finite()), "{}: gradient", case.name);
    }
    // Bounded: strain grows with the cube of the stretch, which is the physics; all else is far below this.
    let extent = case.posed.positions().as_flattened().iter().fold(1.0, |m, x| f64::max(m, x.abs()));
    let stretch = extent / case.rest.median_edge_length().min(0.03) * 0.03;
    let bound = 1e6 * stretch.powi(3);
    let steepest = largest(&value.posed_gradient);
    println!("{:<44} total {:>12.4e} steepest {:>10.3e}", case.name, value.total, steepest);
    assert!(steepest <= bound, "{}: {steepest:e} > {bound:e}", case.name);
}

#[test]
fn values_and_gradients_stay_finite_and_bounded() {
    for case in hard_cases() {
        check::<f64>(&case);
        check::<f32>(&case);
    }
}

#[test]
fn a_diverged_garment_shows_as_nan_and_does_not_panic() {
    let mut scene = super::scenes::scene::<f32>(EnergySettings::default(), paper_weights(), 1);
    scene.posed[5] = [f32::NAN, 0.0, 0.0];
    scene.posed[9] = [f32::INFINITY, 0.0, 0.0];
    assert!(scene.energy.evaluate(&scene.posed, &scene.canonical).total.is_nan());
}
