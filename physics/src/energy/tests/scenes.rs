//! Random scenes: two irregular open tubes around a bumpy body, in contact with each other and with the body.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::energy::{EnergySettings, GarmentEnergies, SceneEnergy, SceneGarment, SceneLayers, Term, TermMap};
use crate::mesh::{Topology, TriMesh, shapes};
use crate::query::Surface;
use crate::real::Real;
use crate::vec3;

/// A scene with its positions.
pub struct Scene<T: Real> {
    pub energy: SceneEnergy<T>,
    pub rest: Vec<TriMesh>,
    pub posed: Vec<[T; 3]>,
    pub canonical: Vec<[T; 3]>,
}

pub fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Moves every vertex by up to `amount` (m) per axis.
pub fn jittered(mesh: &TriMesh, amount: f64, seed: u64) -> TriMesh {
    let mut rng = random(seed);
    let positions = mesh.positions().iter().map(|p| p.map(|x| x + amount * rng.random_range(-1.0..1.0)));
    mesh.with_positions(positions.collect()).expect("finite")
}

/// A trunk of 0.12 m radius whose vertices are irregular.
pub fn body(seed: u64) -> TriMesh {
    let sphere = shapes::icosphere(0.12, 3);
    jittered(&shapes::mapped(&sphere, |[x, y, z]| [x, 2.0 * y, 1.2 * z]), 0.002, seed)
}

/// An open tube of about `around × (along + 1)` vertices with irregular triangles, centred on the origin.
pub fn garment(radius: f64, around: usize, along: usize, seed: u64) -> TriMesh {
    let tube = shapes::mapped(&shapes::tube(radius, 0.3, around, along), |[x, y, z]| [x, y - 0.15, 1.2 * z]);
    jittered(&tube, 0.15 * 0.3 / along as f64, seed)
}

/// Two garments on the body with the given weights for all garments and pairs.
pub fn scene<T: Real>(settings: EnergySettings, weights: TermMap<f64>, seed: u64) -> Scene<T> {
    let rest = vec![garment(0.121, 17, 8, seed + 1), garment(0.122, 15, 9, seed + 2)];
    scene_of(rest, &body(seed), settings, weights, 0.008, seed)
}

/// A garment that is measured against its rest shape.
pub fn scene_garment<T: Real>(
    rest: &TriMesh,
    settings: &EnergySettings,
    weights: TermMap<f64>,
    is_held: bool,
) -> SceneGarment<T> {
    let energies =
        GarmentEnergies::new(rest, &Topology::new(rest), settings, is_held).expect("valid garment");
    SceneGarment {
        energies: Arc::new(energies),
        holding_reference: narrowed(rest),
        pull_back: None,
        thickness_below: Vec::new(),
        weights,
    }
}

/// Positions in the scalar of a scene.
pub fn narrowed<T: Real>(mesh: &TriMesh) -> Vec<[T; 3]> {
    mesh.positions().iter().map(|p| vec3::from_f64(*p)).collect()
}

/// A scene of `rest` garments, posed by random displacements of up to `amount` (m) per axis.
pub fn scene_of<T: Real>(
    rest: Vec<TriMesh>,
    body: &TriMesh,
    settings: EnergySettings,
    weights: TermMap<f64>,
    amount: f64,
    seed: u64,
) -> Scene<T> {
    let garments = rest.iter().map(|mesh| scene_garment(mesh, &settings, weights, true)).collect();
    let positions = |first: u64| {
        let garments = (seed + first..).zip(&rest);
        garments.flat_map(|(seed, mesh)| narrowed(&jittered(mesh, amount, seed))).collect()
    };
    let (posed, canonical) = (positions(100), positions(200));
    let pairs = (0..rest.len()).flat_map(|outer| (0..outer).map(move |inner| (inner, outer)));
    let layers = pairs.map(|(inner, outer)| SceneLayers { inner, outer, weights }).collect();
    let energy = SceneEnergy { body: Arc::new(Surface::from_mesh(body)), garments, layers, settings };
    energy.check().expect("consistent scene");
    Scene { energy, rest, posed, canonical }
}

/// The same scene with heights read off posed positions, pulled back by bones that bend more from vertex to vertex.
pub fn pulled_back(scene: Scene<f64>) -> Scene<f64> {
    let transform = |v: usize| {
        let (sin, cos) = (0.01 * v as f64).sin_cos();
        [[cos, -0.9 * sin, 0.1, 0.2], [sin, 0.9 * cos, -0.2, 0.1], [0.05, 0.2, 1.0, -0.3]]
    };
    let transforms: Vec<_> = (0..scene.posed.len()).map(transform).collect();
    Scene { energy: scene.energy.pulled_back(&transforms), ..scene }
}

/// Weight 1 for one term, 0 for the others.
pub fn only(term: Term) -> TermMap<f64> {
    TermMap::from_fn(|t| if t == term { 1.0 } else { 0.0 })
}

/// The paper's weights.
pub fn paper_weights() -> TermMap<f64> {
    TermMap::from_fn(|term| match term {
        Term::Strain | Term::Gravity => 1.0,
        Term::Bending => 5.0,
        Term::BodyCollision | Term::LayerCollision => 250.0,
        Term::Repulsion => 1e-3,
        Term::Holding => 100.0,
        Term::LayerDistance => 25000.0,
    })
}

/// Largest absolute entry of a gradient.
pub fn largest<T: Real>(gradient: &[[T; 3]]) -> f64 {
    gradient.as_flattened().iter().fold(0.0, |m, g| f64::max(m, (*g).to_f64().abs()))
}
