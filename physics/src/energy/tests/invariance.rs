//! What physics demands: rigid motions change nothing, a garment at rest is at rest, both precisions agree.

use super::scenes::{garment, jittered, only, paper_weights, scene};
use crate::energy::bending::Bending;
use crate::energy::repulsion::Repulsion;
use crate::energy::strain::Strain;
use crate::energy::{EnergySettings, Material, Term, Weighted};
use crate::mesh::{Topology, TriMesh, shapes};
use crate::vec3;

/// Value and gradient of the three internal energies.
fn internal(rest: &TriMesh, posed: &TriMesh) -> [(f64, Vec<[f64; 3]>); 3] {
    let topology = Topology::new(rest);
    let strain = Strain::new(rest, &Material::default(), 1e-2);
    let bending = Bending::new(rest, &topology.hinges, 1.0);
    let (repulsion, settings) = (Repulsion::new(&topology), EnergySettings::default());
    let evaluate = |f: &dyn Fn(Option<Weighted<'_, f64>>) -> f64| {
        let mut gradient = vec![[0.0; 3]; rest.vertex_count()];
        let value = f(Some(Weighted { weight: 1.0, gradient: &mut gradient }));
        (value, gradient)
    };
    let p = posed.positions();
    [
        evaluate(&|t| strain.evaluate(p, t)),
        evaluate(&|t| bending.evaluate(p, t)),
        evaluate(&|t| repulsion.evaluate(p, &settings, t)),
    ]
}

fn rotated([x, y, z]: [f64; 3]) -> [f64; 3] {
    let ((sa, ca), (sb, cb)) = (0.7f64.sin_cos(), 2.1f64.sin_cos());
    let [x, y, z] = [ca * x - sa * y, sa * x + ca * y, z];
    [cb * x + sb * z, y, -sb * x + cb * z]
}

#[test]
fn rigid_motions_change_neither_strain_nor_bending_nor_repulsion() {
    let rest = garment(0.12, 17, 8, 3);
    let posed = jittered(&rest, 0.01, 4);
    let moved = shapes::mapped(&posed, |p| vec3::add(rotated(p), [0.3, -1.2, 0.8]));
    for ((value, gradient), (moved_value, moved_gradient)) in
        internal(&rest, &posed).iter().zip(internal(&rest, &moved))
    {
        assert!(*value > 0.0);
        assert!((moved_value / value - 1.0).abs() < 1e-10, "{value} {moved_value}");
        let largest = super::scenes::largest(gradient);
        for (g, moved) in gradient.iter().zip(moved_gradient) {
            assert!(vec3::norm(vec3::sub(rotated(*g), moved)) < 1e-9 * largest);
        }
    }
}

#[test]
fn internal_forces_balance() {
    let rest = garment(0.12, 17, 8, 3);
    let posed = jittered(&rest, 0.01, 4);
    for (_, gradient) in internal(&rest, &posed) {
        let largest = super::scenes::largest(&gradient);
        let (mut force, mut torque) = (vec3::zero(), vec3::zero());
        for (g, p) in gradient.iter().zip(posed.positions()) {
            vec3::accumulate(&mut force, *g);
            vec3::accumulate(&mut torque, vec3::cross(*p, *g));
        }
        assert!(vec3::norm(force) < 1e-10 * largest && vec3::norm(torque) < 1e-10 * largest);
    }
}

#[test]
fn strain_is_zero_at_rest_even_for_needles() {
    let sheet = garment(0.12, 17, 8, 3);
    for rest in [sheet.clone(), shapes::mapped(&sheet, |[x, y, z]| [x, 1e-5 * y, z])] {
        let [(value, gradient), ..] = internal(&rest, &rest);
        assert!(value < 1e-20 && super::scenes::largest(&gradient) < 1e-8, "{value}");
    }
}

#[test]
fn a_uniformly_stretched_sheet_has_the_textbook_energy() {
    let rest = shapes::irregular_grid(0.3, 0.4, 8, 9, 0.3, 2);
    let (sx, sy) = (1.2, 0.9);
    let posed = shapes::mapped(&rest, |[x, y, z]| [sx * x, sy * y, z]);
    let (gx, gy) = (0.5 * (sx * sx - 1.0), 0.5 * (sy * sy - 1.0));
    let m = Material::default();
    let expected = 0.12 * m.thickness * (0.5 * m.lambda * (gx + gy).powi(2) + m.mu * (gx * gx + gy * gy));
    let value = Strain::new(&rest, &m, 1e-2).evaluate(posed.positions(), None);
    assert!((value / expected - 1.0).abs() < 1e-12, "{value} {expected}");
}

#[test]
fn a_bent_strip_has_the_sum_of_its_angles() {
    // A closed prism: every long edge turns by the exterior angle of its polygon, the diagonals of its sides not at all.
    let sides = 9;
    let positions = (0..2 * sides)
        .map(|k| {
            let angle = std::f64::consts::TAU * (k % sides) as f64 / sides as f64;
            [angle.sin(), (k / sides) as f64, angle.cos()]
        })
        .collect();
    let faces = (0..sides as u32).flat_map(|a| {
        let (b, n) = ((a + 1) % sides as u32, sides as u32);
        [[a, b, a + n], [b, b + n, a + n]]
    });
    let prism = TriMesh::new(positions, faces.collect()).expect("a prism");
    let bending = Bending::new(&prism, &Topology::new(&prism).hinges, 2.0);
    let expected = sides as f64 * (std::f64::consts::TAU / sides as f64).powi(2);
    let value = bending.evaluate(prism.positions(), None);
    assert!((value / expected - 1.0).abs() < 1e-7, "{value} {expected}");
}

#[test]
fn single_precision_agrees_with_double() {
    for term in Term::ALL {
        let single = scene::<f32>(EnergySettings::default(), only(term), 1);
        let mut double = scene::<f64>(EnergySettings::default(), only(term), 1);
        // The same positions, so that only the arithmetic differs.
        double.posed = single.posed.iter().map(|p| vec3::to_f64(*p)).collect();
        double.canonical = single.canonical.iter().map(|p| vec3::to_f64(*p)).collect();
        let a = single.energy.evaluate(&single.posed, &single.canonical);
        let b = double.energy.evaluate(&double.posed, &double.canonical);
        let value_error = (a.total / b.total - 1.0).abs();
        let difference = |x: &[[f32; 3]], y: &[[f64; 3]]| -> f64 {
            x.iter().zip(y).map(|(x, y)| vec3::distance_squared(vec3::to_f64(*x), *y)).sum()
        };
        let squared = difference(&a.posed_gradient, &b.posed_gradient)
            + difference(&a.canonical_gradient, &b.canonical_gradient);
        let norm = difference(&vec![[0.0; 3]; b.posed_gradient.len()], &b.posed_gradient)
            + difference(&vec![[0.0; 3]; b.posed_gradient.len()], &b.canonical_gradient);
        let gradient_error = (squared / norm).sqrt();
        println!("{term:>16} f32: value {value_error:.1e}, gradient {gradient_error:.1e}");
        assert!(value_error < 1e-4 && gradient_error < 1e-4, "{term}: {value_error:e} {gradient_error:e}");
    }
}

#[test]
fn the_total_is_the_weighted_sum_of_the_raw_values() {
    let weights = paper_weights();
    let scene = scene::<f64>(EnergySettings::default(), weights, 5);
    let value = scene.energy.evaluate(&scene.posed, &scene.canonical);
    let sum: f64 = value
        .garments
        .iter()
        .chain(&value.layers)
        .flat_map(|raw| raw.iter().filter_map(|(t, v)| v.map(|v| weights[t] * v)).collect::<Vec<_>>())
        .sum();
    assert!((value.total / sum - 1.0).abs() < 1e-12);
    assert_eq!(scene.energy.value(&scene.posed, &scene.canonical).total, value.total);
    // The raw values do not depend on the weights, and the gradient is linear in them.
    let silent = super::scenes::scene::<f64>(EnergySettings::default(), Default::default(), 5);
    let raw = silent.energy.raw(&silent.posed, &silent.canonical);
    assert_eq!((raw.garments, raw.layers, raw.total), (value.garments, value.layers, 0.0));
    let unheld = scene.energy.raw(&scene.posed, &[]);
    assert!(unheld.garments.iter().all(|raw| raw[Term::Holding].is_none() && raw[Term::Strain].is_some()));
    let nothing = silent.energy.evaluate(&silent.posed, &[]);
    assert!(nothing.garments.iter().chain(&nothing.layers).all(|raw| raw.iter().all(|(_, v)| v.is_none())));
    assert_eq!(super::scenes::largest(&nothing.posed_gradient), 0.0);
    let mut sum = vec![[0.0; 3]; scene.posed.len()];
    for term in Term::ALL {
        let one = super::scenes::scene::<f64>(EnergySettings::default(), only(term), 5);
        let one = one.energy.evaluate(&one.posed, &one.canonical);
        for (s, g) in sum.iter_mut().zip(one.posed_gradient) {
            vec3::axpy(s, weights[term], g);
        }
    }
    let largest = super::scenes::largest(&sum);
    for (s, g) in sum.iter().zip(&value.posed_gradient) {
        assert!(vec3::norm(vec3::sub(*s, *g)) < 1e-12 * largest);
    }
}

#[test]
fn inconsistent_scenes_are_refused() {
    use crate::energy::{EnergyError, GarmentEnergies, SceneLayers};
    let mut scene = scene::<f32>(EnergySettings::default(), paper_weights(), 1);
    scene.energy.layers.push(SceneLayers { inner: 1, outer: 1, weights: paper_weights() });
    assert!(matches!(
        scene.energy.check(),
        Err(EnergyError::LayerPair { pair: 1, inner: 1, outer: 1, garments: 2 })
    ));
    scene.energy.layers.pop();
    scene.energy.garments[1].holding_reference.pop();
    assert!(matches!(scene.energy.check(), Err(EnergyError::HoldingReference { garment: 1, .. })));
    let rest = garment(0.1, 8, 4, 1);
    let settings = EnergySettings::default();
    let other = Topology::new(&shapes::tetrahedron());
    let made = GarmentEnergies::<f32>::new(&rest, &other, &settings, false);
    assert!(matches!(made, Err(EnergyError::TopologyMismatch { .. })));
    let line = shapes::mapped(&rest, |[x, _, _]| [x, 0.0, 0.0]);
    let made = GarmentEnergies::<f32>::new(&line, &Topology::new(&line), &settings, false);
    assert!(matches!(made, Err(EnergyError::NoArea { .. })));
}

#[test]
fn a_diverged_garment_shows_as_nan_and_does_not_panic() {
    let mut scene = scene::<f32>(EnergySettings::default(), paper_weights(), 1);
    scene.posed[5] = [f32::NAN, 0.0, 0.0];
    scene.posed[9] = [f32::INFINITY, 0.0, 0.0];
    assert!(scene.energy.evaluate(&scene.posed, &scene.canonical).total.is_nan());
}
