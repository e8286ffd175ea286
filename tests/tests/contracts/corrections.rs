//! Correction networks: what their stage trains, and what becomes of their results.

use burn::module::Module;
use clothcombo_model::ClothCombo;
use clothcombo_tests::{loss_and_gradient, tiny_config};
use clothcombo_trainer::config::{Config, Trains};
use clothcombo_trainer::dataset::{Dataset, PreparedScene, SceneSample, prepare};
use clothcombo_trainer::inference::descent::Descent;
use clothcombo_trainer::inference::networks::{Networks, TensorStore};
use clothcombo_trainer::system::device::Backend;
use clothcombo_trainer::training::learner::{Learner, new_optimizer};
use clothcombo_trainer::training::process_group::RankPartition;
use clothcombo_trainer::training::scenes::prepare_step;
use clothcombo_trainer::training::schedule::Schedule;
use std::sync::Arc;

/// A dataset, an untrained model with two corrections, and a scene of garments that can touch.
fn setting(folder: &std::path::Path) -> (Config, Arc<Dataset>, TensorStore, ClothCombo, PreparedScene) {
    let config = tiny_config(folder, &["model.corrections=2", "model.correction_width=16"]);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let device = Backend::preferred().device().autodiff();
    let dimensions = dataset.dimensions();
    let tensors = TensorStore::new(dataset.clone(), dimensions, &device);
    let model = ClothCombo::new(&config.model, &dimensions, config.seed, &device).unwrap();
    let schedule = Schedule::new(&config);
    let scene_of =
        |step| prepare_step(&dataset, &config, &schedule, step, RankPartition::WHOLE).unwrap().remove(0);
    let scene = (20..).map(scene_of).find(|scene| !scene.contacts.is_empty()).unwrap();
    (config, dataset, tensors, model, scene)
}

#[test]
fn their_stage_trains_nothing_else_and_lowers_the_loss() {
    let folder = tempfile::tempdir().unwrap();
    let (config, _, tensors, model, scene) = setting(folder.path());
    let parameters = |model: &ClothCombo| {
        let (phases, skinning) =
            ([&model.draping.displacement, &model.untangling.displacement], &model.skinning);
        let weights = phases.map(|siren| siren.output.weight.val().to_data().try_to_vec::<f32>().unwrap());
        (weights, skinning.output.weight.val().to_data().try_to_vec::<f32>().unwrap())
    };
    let others = parameters(&model);
    let mut learner = Learner::new(model.clone(), new_optimizer(&config.optimizer), &config.optimizer);
    let (first, gradient) = {
        let learner = Learner::new(model.clone(), new_optimizer(&config.optimizer), &config.optimizer);
        loss_and_gradient(learner, &tensors, std::slice::from_ref(&scene), Trains::Corrections)
    };
    let own: usize = model.corrections.iter().map(Module::num_params).sum();
    let (of_others, of_corrections) = gradient.split_at(gradient.len() - own);
    assert!(of_others.iter().all(|g| *g == 0.0));
    assert!(of_corrections.iter().any(|g| *g != 0.0));
    let mut last = first;
    for _ in 0..40 {
        let outcome =
            learner.step(&tensors, std::slice::from_ref(&scene), Trains::Corrections, 1e-3, false).unwrap();
        last = outcome.loss;
    }
    assert!(last < 0.9 * first, "{first} → {last}");
    assert_eq!(parameters(learner.model()), others);
}

#[test]
fn what_has_no_less_energy_is_not_taken() {
    let folder = tempfile::tempdir().unwrap();
    let (_, _, tensors, model, scene) = setting(folder.path());
    let energy = |model: &ClothCombo| {
        let networks = Networks::new(model.valid(), &tensors);
        let [together, apart] = [networks.drape(&scene), networks.drape_alone(&scene)].map(Result::unwrap);
        let alone = scene.bodies[0].energy.without_layers();
        (
            scene.bodies[0].energy.value(&together.posed, &together.canonical).total,
            alone.value(&apart.posed, &apart.canonical).total,
        )
    };
    let uncorrected = energy(&model.clone().with_correction_steps(0));
    // Corrections that know nothing and move everything.
    let found = energy(&wild(model));
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
    let (config, dataset, tensors, model, _) = setting(folder.path());
    let schedule = Schedule::new(&config);
    let mut moved = 0;
    for (name, model) in [("untrained", model.clone()), ("wild", wild(model))] {
        let networks = Networks::new(model.valid().with_correction_steps(20), &tensors);
        for step in 20..44 {
            let scene =
                prepare_step(&dataset, &config, &schedule, step, RankPartition::WHOLE).unwrap().remove(0);
            let energies = networks.energies(&scene).unwrap();
            for (before, after) in energies.iter().zip(&energies[1..]) {
                assert!(
                    after.iter().zip(before).all(|(after, before)| after <= before),
                    "{name} {energies:?}"
                );
                moved += usize::from(after != before);
            }
            // What `drape` returns is the last of these states, which begin with skinning.
            let energy = scene.bodies[0].energy.as_ref().clone().continuous();
            let energy = energy.pulled_back(&scene.skinning_transforms());
            let of_drape = Descent::new(&energy, networks.drape(&scene).unwrap()).energies().to_vec();
            assert_eq!(&of_drape, energies.last().unwrap());
            assert_eq!(Descent::new(&energy, networks.skin(&scene).unwrap()).energies(), energies[0]);
        }
    }
    assert!(moved > 20, "{moved}");
}

#[test]
fn a_garment_drapes_in_an_outfit_that_it_does_not_touch_as_it_does_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (config, dataset, tensors, model, scene) = setting(folder.path());
    let networks = Networks::new(wild(model).valid(), &tensors);
    let draw = |garments: &[usize]| {
        let draw = SceneSample { garments: garments.to_vec(), ..scene.sample.clone() };
        let mut scene = prepare(&dataset, &config.losses, draw, 1.0).unwrap();
        // Without an edge nothing presses and nothing is judged together.
        scene.contacts.clear();
        let apart = scene.bodies[0].energy.without_layers();
        scene.bodies[0].energy = Arc::new(apart);
        scene
    };
    let pair = &scene.sample.garments[..2];
    let together = networks.drape(&draw(pair)).unwrap();
    let rows = dataset.garments.garment(pair[0]).unwrap().vertex_count();
    for (garment, rows) in pair.iter().zip([0..rows, rows..together.posed.len()]) {
        let alone = networks.drape(&draw(&[*garment])).unwrap();
        let largest = |a: &[[f32; 3]], b: &[[f32; 3]]| {
            let pairs = a.as_flattened().iter().zip(b.as_flattened());
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        assert!(largest(&alone.posed, &together.posed[rows]) < 1e-5);
    }
}
