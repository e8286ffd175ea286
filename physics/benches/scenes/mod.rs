//! Garments on a body for benches and examples: analytic, so that any size can be made from nothing.
//!
//! The body is an ellipsoidal torso with four limbs (12,810 vertices, about as many as a real body model). The garment is a
//! shirt-like tube around the torso, folded and partly inside the body. Everything is a function of the vertex count.

#![allow(dead_code)] // Each bench and example uses its part.

use std::f64::consts::TAU;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use clothcombo_physics::energy::{GarmentEnergies, LayerGate, SceneEnergy, SceneGarment, SceneLayers};
use clothcombo_physics::mesh::shapes;
use clothcombo_physics::{EnergySettings, Surface, Term, TermMap, Topology, TriMesh};

/// The sizes that benches run through.
pub const SIZES: [usize; 6] = [1_000, 2_000, 5_000, 8_000, 20_000, 50_000];

/// Vertices of a garment of 1 m² whose edges have the length kept by [`Growth::FixedEdge`] (12 mm).
pub const REFERENCE_VERTICES: usize = 8_000;

/// Area of the garment of [`REFERENCE_VERTICES`] vertices is 1 m²: circumference times height.
const HEIGHT: f64 = 0.88;
const RADIUS: f64 = 1.0 / (TAU * HEIGHT);
const TORSO: [f64; 3] = [0.20, 0.60, 0.16];

/// Height of the middle of the torso over the origin (m): heights must not cancel in the gravity.
const MIDDLE: f64 = 0.3;

/// What stays the same when a garment gets more vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Growth {
    /// The garment: it is resolved more finely.
    FixedArea,
    /// The length of its edges: garment and body become larger.
    FixedEdge,
}

/// Rest shape and pose of a garment around the body of [`body`].
#[derive(Debug, Clone)]
pub struct Dressed {
    pub rest: TriMesh,
    pub posed: Vec<[f64; 3]>,
}

fn scale(vertices: usize, growth: Growth) -> f64 {
    match growth {
        Growth::FixedArea => 1.0,
        Growth::FixedEdge => (vertices as f64 / REFERENCE_VERTICES as f64).sqrt(),
    }
}

/// The body for a garment of `vertices` vertices.
pub fn body(vertices: usize, growth: Growth) -> TriMesh {
    let ellipsoid = |subdivisions: usize, axes: [f64; 3], centre: [f64; 3]| {
        shapes::mapped(&shapes::icosphere(1.0, subdivisions), |p| {
            std::array::from_fn(|k| centre[k] + axes[k] * p[k])
        })
    };
    let torso = ellipsoid(5, TORSO, [0.0; 3]);
    let limbs = [
        ellipsoid(3, [0.33, 0.05, 0.05], [0.45, 0.35, 0.0]),
        ellipsoid(3, [0.33, 0.05, 0.05], [-0.45, 0.35, 0.0]),
        ellipsoid(3, [0.08, 0.45, 0.08], [0.1, -0.8, 0.0]),
        ellipsoid(3, [0.08, 0.45, 0.08], [-0.1, -0.8, 0.0]),
    ];
    let scale = scale(vertices, growth);
    let all = shapes::union(&[&torso, &limbs[0], &limbs[1], &limbs[2], &limbs[3]]);
    shapes::mapped(&all, |[x, y, z]| [x, y + MIDDLE, z].map(|x| scale * x))
}

/// A garment of about `vertices` vertices, `offset` (m) farther out than one that touches the body.
pub fn garment(vertices: usize, growth: Growth, offset: f64) -> Dressed {
    let scale = scale(vertices, growth);
    // Equilateral triangles: an area of √3/2 e² per vertex.
    let edge = (TAU * RADIUS * HEIGHT / (vertices as f64 * 0.75f64.sqrt())).sqrt();
    let around = (TAU * RADIUS / edge).round() as usize;
    let along = (vertices as f64 / around as f64).round() as usize - 1;
    let tube = shapes::tube(RADIUS, HEIGHT, around, along);
    let rest = shapes::mapped(&tube, |p| p.map(|x| scale * x));
    let posed = tube
        .positions()
        .iter()
        .map(|&[x, y, z]| {
            let angle = x.atan2(z);
            let height = y - 0.5 * HEIGHT;
            let width = (1.0 - (height / TORSO[1]).powi(2)).sqrt();
            // Folds of 12 mm, at their deepest 3 mm inside the body.
            let away = offset / scale + 0.003 + 0.006 * (7.0 * angle + 9.0 * height).sin();
            let (wide, deep) = (TORSO[0] * width + away, TORSO[2] * width + away);
            [wide * angle.sin(), height + MIDDLE, deep * angle.cos()].map(|x| scale * x)
        })
        .collect();
    Dressed { rest, posed }
}

/// Milliseconds since this was called.
pub fn wall_ms() -> impl Fn() -> f64 {
    let start = Instant::now();
    move || 1e3 * start.elapsed().as_secs_f64()
}

/// Median time (ms) of `run` by `clock` over about `seconds`, at least 5 times, after one run to warm up.
pub fn median_ms<R>(seconds: f64, clock: impl Fn() -> f64, mut run: impl FnMut() -> R) -> f64 {
    black_box(run());
    let (start, mut times) = (Instant::now(), Vec::new());
    while times.len() < 5 || start.elapsed().as_secs_f64() < seconds {
        let before = clock();
        black_box(run());
        times.push(clock() - before);
    }
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Positions in the scalar of training.
pub fn narrowed(positions: &[[f64; 3]]) -> Vec<[f32; 3]> {
    positions.iter().map(|p| p.map(|x| x as f32)).collect()
}

/// The weights that make `terms`, and nothing else, be evaluated.
pub fn only(terms: &[Term]) -> TermMap<f64> {
    let mut weights = TermMap::filled(0.0);
    for &term in terms {
        weights[term] = 1.0;
    }
    weights
}

/// The terms of one garment.
pub fn single_terms() -> Vec<Term> {
    Term::ALL.into_iter().filter(|term| !term.is_layer_term()).collect()
}

/// The terms between two garments.
pub fn layer_terms() -> Vec<Term> {
    Term::ALL.into_iter().filter(|term| term.is_layer_term()).collect()
}

/// A scene with everything but its weights.
pub struct Scene {
    pub dressed: Vec<Dressed>,
    energies: Vec<Arc<GarmentEnergies<f32>>>,
    body: Arc<Surface<f32>>,
    settings: EnergySettings,
    /// Posed positions of all garments.
    pub posed: Vec<[f32; 3]>,
    /// Canonical positions: the rest shape, sagged by up to 2 cm.
    pub canonical: Vec<[f32; 3]>,
}

impl Scene {
    /// One garment, or an inner and an outer one.
    pub fn new(vertices: usize, growth: Growth, layers: usize, subset: Option<usize>) -> Self {
        let settings = EnergySettings {
            repulsion_subset: subset,
            layer_gate: Some(LayerGate::default()),
            ..EnergySettings::default()
        };
        // The outer garment hangs 1.5 mm off, less than the margin of 2 mm.
        let dressed: Vec<Dressed> =
            (0..layers).map(|layer| garment(vertices, growth, 0.0015 * layer as f64)).collect();
        let energies = dressed
            .iter()
            .map(|d| {
                let topology = Topology::new(&d.rest);
                Arc::new(GarmentEnergies::new(&d.rest, &topology, &settings, true).expect("valid"))
            })
            .collect();
        let posed = dressed.iter().flat_map(|d| narrowed(&d.posed)).collect();
        let sag = |p: &[f64; 3]| [p[0] as f32, (p[1] - 0.02 * (9.0 * p[0]).cos().abs()) as f32, p[2] as f32];
        let canonical = dressed.iter().flat_map(|d| d.rest.positions().iter().map(sag)).collect();
        let body = Arc::new(Surface::from_mesh(&body(vertices, growth)));
        Self { dressed, energies, body, settings, posed, canonical }
    }

    /// The scene with weight 1 on `terms` and 0 on all others. The outer garment of two has the layer terms only.
    pub fn energy(&self, terms: &[Term]) -> SceneEnergy<f32> {
        let weights = only(terms);
        let garments = self
            .energies
            .iter()
            .zip(&self.dressed)
            .map(|(energies, dressed)| SceneGarment {
                energies: energies.clone(),
                holding_reference: narrowed(dressed.rest.positions()),
                thickness_below: Vec::new(),
                pull_back: None,
                weights,
            })
            .collect();
        let layers =
            (1..self.energies.len()).map(|outer| SceneLayers { inner: outer - 1, outer, weights }).collect();
        SceneEnergy { body: self.body.clone(), garments, layers, settings: self.settings }
    }
}
