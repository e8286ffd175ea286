//! Every gradient against difference quotients in `f64`, on random scenes and for every switch. The suite of degenerate
//! cases runs through the same check in the workspace's `tests` crate.

use super::scenes::{Scene, only, pulled_back, scene};
use crate::energy::gradient_bound::gradient_bound;
use crate::energy::gradient_check::{GradientCheck, check_gradient};
use crate::energy::{ContactSamples, EnergySettings, LayerContact, LayerGate, Term};
use crate::query::Distance;

fn check(term: Term, settings: EnergySettings, seed: u64, what: &str) {
    check_scene(scene(settings, only(term), seed), term, seed, what);
}

fn check_scene(scene: Scene<f64>, term: Term, seed: u64, what: &str) {
    let check = GradientCheck { coordinates: 100, directions: 6, seed: seed + 7 };
    let report = check_gradient(&scene.energy, term, &scene.posed, &scene.canonical, &check);
    let report = report.unwrap_or_else(|| panic!("{term} is not in the scene"));
    println!(
        "{term:>16} {what:<24} relative gradient error {:.2e}, {} nonsmooth lines",
        report.error, report.nonsmooth
    );
    assert!(report.largest > 0.0, "{term} is silent in the random scene");
    assert!(report.passes(), "{term} {what}: {report:?}");
    // In general position nonsmooth points are rare: the central check is the rule.
    assert!(report.nonsmooth * 20 <= report.lines, "{term} {what}: {report:?}");
    // Only the space that the term is about has a gradient.
    let value = scene.energy.evaluate(&scene.posed, &scene.canonical);
    let other =
        if scene.energy.needs_canonical() { &value.posed_gradient } else { &value.canonical_gradient };
    assert_eq!(super::scenes::largest(other), 0.0, "{term}");
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
    // By the closest point the same gate fades cloth out that is 2 to 4 mm deep.
    for gate in [default.layer_gate, gate] {
        let layer_contact = LayerContact::ClosestPoint;
        let settings = EnergySettings { layer_gate: gate, layer_contact, ..default };
        check(Term::LayerCollision, settings, 3, "closest point");
    }
    for samples in [ContactSamples::Faces, ContactSamples::FacesAndEdges] {
        let settings = EnergySettings { body_samples: samples, layer_samples: samples, ..default };
        let closest_point = EnergySettings { layer_contact: LayerContact::ClosestPoint, ..settings };
        check(Term::BodyCollision, settings, 3, "between vertices");
        check(Term::LayerCollision, settings, 3, "between vertices");
        check(Term::LayerDistance, settings, 3, "between vertices");
        check(Term::LayerCollision, closest_point, 3, "closest point, between");
    }
    check(Term::Repulsion, EnergySettings { repulsion_normalised: false, ..default }, 3, "as printed");
    check(Term::Repulsion, EnergySettings { repulsion_subset: Some(16), ..default }, 3, "random subset");
    check(Term::Holding, EnergySettings { holding_fraction: 0.4, ..default }, 3, "40 % held");
}

/// Garments below make the body thicker, by another amount at every vertex.
#[test]
fn cloth_over_other_garments_keeps_a_margin_that_has_grown() {
    for samples in [ContactSamples::Vertices, ContactSamples::FacesAndEdges] {
        let settings = EnergySettings { body_samples: samples, ..EnergySettings::default() };
        let over = |term: Term, thickness: &dyn Fn(usize) -> f64| {
            let mut scene: Scene<f64> = scene(settings, only(term), 3);
            for garment in &mut scene.energy.garments {
                garment.thickness_below = (0..garment.energies.vertex_count()).map(thickness).collect();
            }
            scene
        };
        let value = |scene: &Scene<f64>| scene.energy.evaluate(&scene.posed, &scene.canonical).total;
        let uneven = |v: usize| 1e-3 * (v % 5) as f64;
        check_scene(over(Term::BodyCollision, &uneven), Term::BodyCollision, 3, "garments below");
        // The same thickness everywhere is a larger margin.
        let margin = settings.body_collision_epsilon + 3e-3;
        let wider = EnergySettings { body_collision_epsilon: margin, ..settings };
        let wider = value(&scene(wider, only(Term::BodyCollision), 3));
        let even = value(&over(Term::BodyCollision, &|_| 3e-3));
        assert!(even > 0.0 && (even - wider).abs() < 1e-12 * wider, "{even} {wider}");
        // The layer distance reads which garment is over which off the body as it is.
        let bare = value(&over(Term::LayerDistance, &|_| 0.0));
        assert!(bare > 0.0 && value(&over(Term::LayerDistance, &uneven)) == bare);
    }
}

#[test]
fn holding_pulled_back_by_bent_skinning_has_its_gradient_at_posed_positions() {
    for seed in [1, 2] {
        let settings = EnergySettings { holding_fraction: 0.4, ..EnergySettings::default() };
        let scene = pulled_back(scene(settings, only(Term::Holding), seed));
        assert!(!scene.energy.needs_canonical());
        let rest: Vec<_> = scene.rest.iter().collect();
        let bound = gradient_bound(&scene.energy, &rest, Term::Holding, &scene.posed, &scene.canonical);
        let largest = scene.energy.evaluate(&scene.posed, &[]).posed_gradient;
        let largest = largest.iter().map(|g| crate::vec3::norm(*g)).fold(0.0, f64::max);
        // Vertices that are not held may be farther off.
        assert!(largest <= bound && bound < 100.0 * largest, "{largest} {bound}");
        check_scene(scene, Term::Holding, seed, "pulled back");
    }
}
