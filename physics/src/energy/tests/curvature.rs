//! Curvatures are positive semidefinite everywhere, and exact where the documentation of a term says that nothing is left
//! out.

use super::scenes::{Scene, only, random, scene};
use crate::energy::{ContactSamples, CurvatureSink, EnergySettings, LayerContact, Term};
use crate::mesh::shapes;
use crate::query::Distance;
use rand::RngExt;

/// The product with the curvature, block by block.
struct Product<'a> {
    x: &'a [[f64; 3]],
    result: Vec<[f64; 3]>,
}

impl CurvatureSink for Product<'_> {
    fn add(&mut self, i: usize, j: usize, block: [[f64; 3]; 3]) {
        for r in 0..3 {
            for c in 0..3 {
                self.result[i][r] += block[r][c] * self.x[j][c];
                if i != j {
                    self.result[j][c] += block[r][c] * self.x[i][r];
                }
            }
        }
    }
}

/// Curvature times `x`, taken as a displacement of posed and of canonical positions alike.
fn product(scene: &Scene<f64>, posed: &[[f64; 3]], x: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut product = Product { x, result: vec![[0.0; 3]; x.len()] };
    scene.energy.curvature(posed, &scene.canonical, &mut product, None);
    product.result
}

fn directions(count: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut rng = random(seed);
    (0..count).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect()
}

fn scalar(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
}

#[test]
fn never_negative() {
    let terms = [Term::Strain, Term::Bending, Term::BodyCollision, Term::Holding, Term::LayerCollision];
    let settings = EnergySettings { layer_contact: LayerContact::ClosestPoint, ..EnergySettings::default() };
    for term in terms {
        for seed in 0..4 {
            let scene = scene::<f64>(settings, only(term), seed);
            let mut largest = 0.0f64;
            for k in 0..40 {
                let x = directions(scene.posed.len(), 100 * seed + k);
                let curvature = scalar(&x, &product(&scene, &scene.posed, &x));
                largest = largest.max(curvature);
                assert!(curvature > -1e-12 * largest, "{term}");
            }
            assert!(largest > 0.0, "{term} has no curvature");
        }
    }
}

#[test]
fn exact_without_tension_without_folds_and_over_flat_ground() {
    let flat = shapes::irregular_grid(0.3, 0.3, 6, 6, 0.25, 1);
    let turned = |[x, y, z]: [f64; 3]| [0.6 * x + 0.8 * z, y, 0.6 * z - 0.8 * x];
    let ground = shapes::mapped(&shapes::grid(4.0, 4.0, 2, 2), |[x, y, z]| [x - 2.0, y - 2.0, z - 0.001]);
    let held = [(Term::Holding, false), (Term::Holding, true)];
    let others = [Term::Strain, Term::Bending, Term::BodyCollision].map(|term| (term, false));
    for (term, is_pulled_back) in others.into_iter().chain(held) {
        let settings = EnergySettings { distance: Distance::ClosestPoint, ..EnergySettings::default() };
        let scene = super::scenes::scene_of::<f64>(vec![flat.clone()], &ground, settings, only(term), 0.0, 1);
        let scene = if is_pulled_back { super::scenes::pulled_back(scene) } else { scene };
        let posed: Vec<[f64; 3]> = match term {
            // Turned, but without tension, of whose stiffness the curvature has a share only.
            Term::Strain => flat.positions().iter().map(|p| turned(*p)).collect(),
            _ => flat.positions().to_vec(),
        };
        let x = directions(posed.len(), 3);
        let step = 1e-7;
        let gradient = |sign: f64| {
            let moved = |p: &[[f64; 3]]| -> Vec<[f64; 3]> {
                p.iter().zip(&x).map(|(p, d)| crate::vec3::add_scaled(*p, sign * step, *d)).collect()
            };
            let value = scene.energy.evaluate(&moved(&posed), &moved(&scene.canonical));
            let sums = value.posed_gradient.iter().zip(&value.canonical_gradient);
            sums.map(|(a, b)| crate::vec3::add(*a, *b)).collect::<Vec<_>>()
        };
        let (plus, minus) = (gradient(1.0), gradient(-1.0));
        let found = product(&scene, &posed, &x);
        let size = scalar(&found, &found).sqrt();
        assert!(size > 0.0, "{term}");
        let error: f64 = found
            .as_flattened()
            .iter()
            .zip(plus.as_flattened().iter().zip(minus.as_flattened()))
            .map(|(h, (p, m))| (h - (p - m) / (2.0 * step)).powi(2))
            .sum();
        assert!(error.sqrt() < 1e-5 * size, "{term}: {} of {size}", error.sqrt());
    }
}

#[test]
fn between_vertices_contact_is_as_stiff_as_its_gradient_says() {
    let sheet = |size: f64, lift: f64, seed| {
        let flat = shapes::irregular_grid(size, size, 6, 6, 0.25, seed);
        // The smaller one over the middle of the larger one: on its border the contact has a kink.
        shapes::mapped(&flat, |[x, y, z]| [x - 0.5 * size, y - 0.5 * size, z + lift])
    };
    let ground = shapes::mapped(&shapes::grid(4.0, 4.0, 2, 2), |[x, y, z]| [x - 2.0, y - 2.0, z - 0.001]);
    for samples in [ContactSamples::Vertices, ContactSamples::Faces, ContactSamples::FacesAndEdges] {
        for term in [Term::BodyCollision, Term::LayerCollision] {
            let settings = EnergySettings {
                distance: Distance::ClosestPoint,
                layer_contact: LayerContact::ClosestPoint,
                body_samples: samples,
                layer_samples: samples,
                ..EnergySettings::default()
            };
            let rest = vec![sheet(0.3, 0.0, 1), sheet(0.2, 0.001, 2)];
            let scene = super::scenes::scene_of::<f64>(rest, &ground, settings, only(term), 0.0, 1);
            // Up and down: sheets that stay level have no other curvature.
            let x: Vec<[f64; 3]> =
                directions(scene.posed.len(), 3).into_iter().map(|[_, _, z]| [0.0, 0.0, z]).collect();
            let step = 1e-6;
            let slope = |sign: f64| {
                let moved =
                    scene.posed.iter().zip(&x).map(|(p, d)| crate::vec3::add_scaled(*p, sign * step, *d));
                let moved: Vec<[f64; 3]> = moved.collect();
                scalar(&scene.energy.evaluate(&moved, &scene.canonical).posed_gradient, &x)
            };
            let exact = (slope(1.0) - slope(-1.0)) / (2.0 * step);
            let found = scalar(&x, &product(&scene, &scene.posed, &x));
            assert!(exact > 0.0 && (found / exact - 1.0).abs() < 0.02, "{term} {samples:?}: {found} {exact}");
        }
    }
}
