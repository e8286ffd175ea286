//! Every gradient against central differences in `f64`.
//!
//! Nearest vertices, the pairs within the repulsion radius and the layer gate change in jumps: there is no derivative there.
//! A coordinate is left out when such an assignment differs between its two ends, found by brute force; that must stay rare.

use super::scenes::{Scene, only, random, scene};
use crate::energy::{EnergySettings, LayerGate, Term};
use crate::query::{Distance, brute_force};
use crate::vec3;
use rand::RngExt;

/// Step [m] of the difference quotients in ordinary scenes.
const STEP: f64 = 1e-6;
/// Coordinates per ordinary scene.
const COORDINATES: usize = 150;

/// Coordinates per hard case.
const HARD_COORDINATES: usize = 40;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Space {
    Posed,
    Canonical,
}

/// The assignments that a term makes at `posed`, by all pairs.
fn assignments(term: Term, scene: &Scene<f64>, posed: &[[f64; 3]]) -> Vec<u64> {
    let settings = &scene.energy.settings;
    let first = scene.rest[0].vertex_count();
    match term {
        Term::BodyCollision | Term::LayerDistance => {
            let body = &scene.energy.body;
            let gaps = posed.iter().map(|p| body.gap(*p, settings.distance));
            gaps.flat_map(|g| [u64::from(g.vertex), u64::from(g.gap < settings.layer_distance_radius)])
                .collect()
        }
        Term::Repulsion => {
            let squared = settings.repulsion_radius.powi(2);
            let close = |a: usize, b: usize| vec3::distance_squared(posed[a], posed[b]) < squared;
            (0..posed.len())
                .flat_map(|a| (0..a).filter(move |&b| close(a, b)).map(move |b| (a << 32 | b) as u64))
                .collect()
        }
        Term::LayerCollision => {
            let (inner, outer) = posed.split_at(first);
            let normals = crate::mesh::vertex_normals(inner, scene.rest[0].faces());
            let edge = scene.rest[0].median_edge_length();
            let of = |p: &[f64; 3]| {
                let v = brute_force::nearest(inner, *p).0 as usize;
                let offset = vec3::sub(*p, inner[v]);
                let gap = vec3::dot(offset, normals[v]);
                let aside = (vec3::norm_squared(offset) - gap * gap).max(0.0).sqrt();
                let open = settings
                    .layer_gate
                    .is_none_or(|g| gap.abs() <= g.depth && aside <= g.tangential_edges * edge);
                [v as u64, u64::from(open)]
            };
            outer.iter().flat_map(of).collect()
        }
        _ => Vec::new(),
    }
}

/// How well a gradient and its difference quotients agree over random coordinates.
struct Agreement {
    /// Norm of the difference, relative to that of the quotients.
    error: f64,
    /// What the rounding of the values alone contributes to it.
    rounding: f64,
    /// Coordinates left out.
    left_out: usize,
}

fn agreement(term: Term, scene: &Scene<f64>, step: f64, coordinates: usize, seed: u64) -> Agreement {
    let value = scene.energy.evaluate(&scene.posed, &scene.canonical);
    assert!(value.total != 0.0, "{term} is silent in the random scene");
    let (space, gradient) = if term.is_canonical() {
        assert_eq!(super::scenes::largest(&value.posed_gradient), 0.0);
        (Space::Canonical, &value.canonical_gradient)
    } else {
        assert_eq!(super::scenes::largest(&value.canonical_gradient), 0.0);
        (Space::Posed, &value.posed_gradient)
    };
    let mut rng = random(seed);
    // Half of the coordinates from those with a gradient, so that a sparse term is tested where it acts.
    let alive: Vec<usize> = (0..3 * gradient.len()).filter(|&c| gradient[c / 3][c % 3] != 0.0).collect();
    let (mut error, mut norm, mut left_out) = (0.0, 0.0, 0);
    for k in 0..coordinates {
        let c = if k % 2 == 0 {
            alive[rng.random_range(0..alive.len())]
        } else {
            rng.random_range(0..3 * gradient.len())
        };
        let (v, axis) = (c / 3, c % 3);
        let moved = |steps: f64| {
            let (mut posed, mut canonical) = (scene.posed.clone(), scene.canonical.clone());
            match space {
                Space::Posed => posed[v][axis] += steps * step,
                Space::Canonical => canonical[v][axis] += steps * step,
            }
            (posed, canonical)
        };
        if assignments(term, scene, &moved(-2.0).0) != assignments(term, scene, &moved(2.0).0) {
            left_out += 1;
            continue;
        }
        let at = |steps: f64| {
            let (posed, canonical) = moved(steps);
            scene.energy.value(&posed, &canonical).total
        };
        // The four-point quotient: its error is of fourth order in the step.
        let expected = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step);
        error += (gradient[v][axis] - expected).powi(2);
        norm += expected.powi(2);
    }
    let rounding = f64::EPSILON * value.total.abs() / step * (coordinates as f64 / norm).sqrt();
    Agreement { error: (error / norm).sqrt(), rounding, left_out }
}

fn check(term: Term, settings: EnergySettings, seed: u64, what: &str) {
    let scene = scene::<f64>(settings, only(term), seed);
    let Agreement { error, left_out, .. } = agreement(term, &scene, STEP, COORDINATES, seed + 7);
    println!("{term:>16} {what:<24} relative gradient error {error:.2e}, {left_out} kinks left out");
    assert!(error <= 1e-6, "{term} {what}: {error:e}");
    assert!(left_out * 20 <= COORDINATES, "{term} {what}: {left_out} coordinates left out");
}

#[test]
fn every_gradient_is_the_derivative_of_its_value() {
    for term in Term::ALL {
        for seed in [1, 2] {
            check(term, EnergySettings::default(), seed, "default");
        }
    }
}

#[test]
fn so_it_is_with_every_switch() {
    let default = EnergySettings::default();
    let closest_point = EnergySettings { distance: Distance::ClosestPoint, ..default };
    check(Term::BodyCollision, closest_point, 3, "closest point");
    check(Term::LayerDistance, closest_point, 3, "closest point");
    check(Term::LayerCollision, EnergySettings { layer_gate: None, ..default }, 3, "no gate");
    let gate = Some(LayerGate { tangential_edges: 0.4, depth: 0.004 });
    check(Term::LayerCollision, EnergySettings { layer_gate: gate, ..default }, 3, "narrow gate");
    check(Term::Repulsion, EnergySettings { repulsion_normalised: false, ..default }, 3, "as printed");
    check(Term::Repulsion, EnergySettings { repulsion_subset: Some(16), ..default }, 3, "random subset");
    check(Term::Holding, EnergySettings { holding_fraction: 0.4, ..default }, 3, "40 % held");
}

/// The regularised forms are derivatives too: needle rest triangles, collapsed triangles, pairs inside the contact distance.
#[test]
fn so_it_is_where_forms_are_regularised() {
    use super::hard_cases::{HardCase, hard_cases};
    for HardCase { name, rest, posed } in hard_cases() {
        for term in Term::ALL {
            let Some(mut scene) = super::hard_cases::case_scene::<f64>(&rest, &posed, only(term)) else {
                continue;
            };
            // Off the kinks, by less than what makes the case hard.
            let mut rng = random(5);
            for x in scene.posed.as_flattened_mut() {
                *x += 1e-5 * rng.random_range(-1.0..1.0);
            }
            // Silent here, up to the rounding of sums that cancel.
            if scene.energy.value(&scene.posed, &scene.canonical).total.abs() < 1e-14 {
                continue;
            }
            // Singular forms vary over micrometres; far from the origin a step must exceed the spacing of the numbers.
            let extent = scene.posed.as_flattened().iter().fold(1.0, |m, x| f64::max(m, x.abs()));
            let step = (0.05 * STEP).max(1e-9 * extent);
            let Agreement { error, rounding, left_out } = agreement(term, &scene, step, HARD_COORDINATES, 11);
            println!(
                "{term:>16} {name:<42} {error:.2e} (rounding {rounding:.0e}), {left_out} kinks left out"
            );
            assert!(error <= 1e-6 + rounding, "{term} {name}: {error:e}");
        }
    }
}
