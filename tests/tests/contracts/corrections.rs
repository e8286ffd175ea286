//! Correction networks: what their stage trains, and what becomes of their results.

use burn::module::Module;
use clothcombo_model::ClothCombo;
use clothcombo_tests::Untrained;
use clothcombo_trainer::config::Trains;
use clothcombo_trainer::dataset::{SceneSample, prepare};
use clothcombo_trainer::inference::descent::Descent;
use clothcombo_trainer::inference::networks::Networks;
use clothcombo_trainer::training::learner::StepInput;
use std::sync::Arc;

/// Untrained networks with two corrections.
fn untrained(folder: &std::path::Path) -> Untrained {
    Untrained::new(folder, &["model.corrections=2", "model.correction_width=16"])
}

#[test]
fn their_stage_trains_nothing_else_and_lowers_the_loss() {
    let folder = tempfile::tempdir().unwrap();
    let run = untrained(folder.path());
    let scene = &run.scenes(run.step_with_contacts(20))[..1];
    let parameters = |model: &ClothCombo| {
        let (phases, skinning) =
            ([&model.draping.displacement, &model.untangling.displacement], &model.skinning);
        let weights = phases.map(|siren| siren.output.weight.val().to_data().try_to_vec::<f32>().unwrap());
        (weights, skinning.output.weight.val().to_data().try_to_vec::<f32>().unwrap())
    };
    let others = parameters(&run.model);
    let (first, gradient) = run.loss_and_gradient(scene, Trains::Corrections);
    let own: usize = run.model.corrections.iter().map(Module::num_params).sum();
    let (of_others, of_corrections) = gradient.split_at(gradient.len() - own);
    assert!(of_others.iter().all(|g| *g == 0.0));
    assert!(of_corrections.iter().any(|g| *g != 0.0));
    let mut learner = run.learner();
    let input = StepInput::whole(&run.tensors, scene, Trains::Corrections);
    let mut last = first;
    for _ in 0..40 {
        last = learner.train_step(&input, 1e-3).unwrap().loss;
    }
    assert!(last < 0.9 * first, "{first} → {last}");
    assert_eq!(parameters(learner.model()), others);
}

#[test]
fn what_has_no_less_energy_is_not_taken() {
    let folder = tempfile::tempdir().unwrap();
    let run = untrained(folder.path());
    let scene = run.scenes(run.step_with_contacts(20)).remove(0);
    let energy = |model: &ClothCombo| {
        let networks = Networks::new(model.valid(), &run.tensors);
        let [together, apart] =
            [networks.drape(&scene), networks.drape_single_garments(&scene)].map(Result::unwrap);
        // In the form that is judged.
        let energy = scene.bodies[0].energy.as_ref().clone().continuous();
        let energy = energy.pulled_back(&scene.skinning_transforms());
        let without_layers = energy.without_layers();
        (Descent::new(&energy, together).total(), Descent::new(&without_layers, apart).total())
    };
    let uncorrected = energy(&run.model.clone().with_correction_steps(0));
    // Corrections that know nothing and move everything.
    let found = energy(&wild(run.model.clone()));
    assert!(found.0 <= uncorrected.0 * (1.0 + 1e-6), "{found:?} {uncorrected:?}");
    assert!(found.1 <= uncorrected.1 * (1.0 + 1e-6), "{found:?} {uncorrected:?}");
}

/// The model with corrections that know nothing and move everything.
fn wild(mut model: ClothCombo) -> ClothCombo {
    for correction in &mut model.corrections {
        let bias = correction.output.bias.val();
        correction.output.bias = burn::module::Param::from_tensor((bias + 0.7).detach());
    }
    model
}

#[test]
fn twenty_steps_never_raise_the_energy_of_any_garment_and_all_end_below_skinning() {
    let folder = tempfile::tempdir().unwrap();
    let run = untrained(folder.path());
    let mut moved = 0;
    for (name, model) in [("untrained", run.model.clone()), ("wild", wild(run.model.clone()))] {
        let networks = Networks::new(model.valid().with_correction_steps(20), &run.tensors);
        for step in 20..44 {
            let scene = run.scenes(step).remove(0);
            let energies = networks.energies(&scene).unwrap();
            for (before, after) in energies.iter().zip(&energies[1..]) {
                assert!(
                    after.iter().zip(before).all(|(after, before)| after <= before),
                    "{name} {energies:?}"
                );
                moved += usize::from(after != before);
            }
            // What `drape` returns is the last of these states, which begin with the better of two ways to skin; and so without
            // corrections.
            let energy = scene.bodies[0].energy.as_ref().clone().continuous();
            let energy = energy.pulled_back(&scene.skinning_transforms());
            let skinnings = [networks.skin(&scene), networks.skin_rest(&scene)].map(Result::unwrap);
            let totals = skinnings.each_ref().map(|state| Descent::new(&energy, state.clone()).total());
            assert_eq!(Descent::from_best(&energy, skinnings).energies(), energies[0]);
            let drape = Descent::new(&energy, networks.drape(&scene).unwrap());
            assert_eq!(drape.energies(), energies.last().unwrap());
            let uncorrected = networks.with_correction_steps(0).drape(&scene).unwrap();
            let uncorrected = Descent::new(&energy, uncorrected);
            assert!(totals.iter().all(|total| uncorrected.total() <= *total), "{name} {totals:?}");
            assert!(drape.total() <= uncorrected.total());
        }
    }
    assert!(moved > 20, "{moved}");
}

#[test]
fn a_garment_drapes_in_an_outfit_that_it_does_not_touch_as_a_single_garment_does() {
    let folder = tempfile::tempdir().unwrap();
    let run = untrained(folder.path());
    let scene = run.scenes(run.step_with_contacts(20)).remove(0);
    let networks = Networks::new(wild(run.model.clone()).valid(), &run.tensors);
    let outfit = |garments: &[usize]| {
        let sample = SceneSample { garments: garments.to_vec(), ..scene.sample.clone() };
        let mut scene = prepare(&run.dataset, &run.config.losses, sample, 1.0).unwrap();
        // Without an edge nothing presses and nothing is judged together.
        scene.contacts.clear();
        let apart = scene.bodies[0].energy.without_layers();
        scene.bodies[0].energy = Arc::new(apart);
        scene
    };
    let pair = &scene.sample.garments[..2];
    let together = networks.drape(&outfit(pair)).unwrap();
    let rows = run.dataset.garments.garment(pair[0]).unwrap().vertex_count();
    for (garment, rows) in pair.iter().zip([0..rows, rows..together.posed.len()]) {
        let single = networks.drape(&outfit(&[*garment])).unwrap();
        let largest = |a: &[[f32; 3]], b: &[[f32; 3]]| {
            let pairs = a.as_flattened().iter().zip(b.as_flattened());
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        assert!(largest(&single.posed, &together.posed[rows]) < 1e-5);
    }
}
