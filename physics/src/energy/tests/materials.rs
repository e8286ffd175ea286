//! Garments of different materials in one scene.

use super::scenes::{Scene, only, scene};
use crate::energy::{EnergySettings, GarmentEnergies, LayerContact, Material, Term};
use crate::mesh::Topology;
use std::sync::Arc;

/// The scene with garments of these thicknesses (m); the settings of the scene know nothing of it.
fn of_thickness(settings: EnergySettings, term: Term, thickness: [f64; 2]) -> Scene<f64> {
    let mut scene = scene(settings, only(term), 5);
    for ((garment, rest), thickness) in scene.energy.garments.iter_mut().zip(&scene.rest).zip(thickness) {
        let material = Material { thickness, ..settings.material };
        let settings = EnergySettings { material, ..settings };
        let energies = GarmentEnergies::new(rest, &Topology::new(rest), &settings, true).unwrap();
        garment.energies = Arc::new(energies);
    }
    scene
}

#[test]
fn thick_cloth_keeps_half_its_thickness_off_the_body_and_off_other_cloth() {
    let settings = EnergySettings::default();
    let wider = EnergySettings { body_collision_epsilon: 0.004, layer_collision_epsilon: 0.006, ..settings };
    for contact in [LayerContact::NearestVertex, LayerContact::ClosestPoint] {
        let by = |settings| EnergySettings { layer_contact: contact, ..settings };
        for (term, thickness) in
            [(Term::BodyCollision, [0.008, 0.008]), (Term::LayerCollision, [0.002, 0.010])]
        {
            let thick = of_thickness(by(settings), term, thickness);
            let thin = scene::<f64>(by(wider), only(term), 5);
            let [found, expected] =
                [&thick, &thin].map(|scene| scene.energy.evaluate(&scene.posed, &scene.canonical));
            assert!(expected.total > 0.0, "{term:?}");
            assert_eq!(found.total, expected.total, "{term:?}");
            assert_eq!(found.posed_gradient, expected.posed_gradient, "{term:?}");
        }
    }
}

#[test]
fn cloth_thinner_than_the_margins_is_as_in_the_paper() {
    let settings = EnergySettings::default();
    for term in [Term::BodyCollision, Term::LayerCollision] {
        let [thin, thinner] = [[0.001; 2], [1e-4; 2]].map(|thickness| {
            let scene = of_thickness(settings, term, thickness);
            scene.energy.evaluate(&scene.posed, &scene.canonical).total
        });
        assert_eq!(thin, thinner);
    }
}

#[test]
fn every_garment_weighs_and_strains_by_its_own_material() {
    let settings = EnergySettings::default();
    for term in [Term::Strain, Term::Gravity] {
        let energies = |thickness| {
            let scene = of_thickness(settings, term, thickness);
            let value = scene.energy.evaluate(&scene.posed, &scene.canonical);
            [0, 1].map(|garment| value.garments[garment][term].unwrap())
        };
        let ([one, two], [same, thrice]) = (energies([1e-3, 1e-3]), energies([1e-3, 3e-3]));
        assert_eq!(one, same);
        assert!((thrice / two - 3.0).abs() < 1e-12, "{term:?}");
    }
}
