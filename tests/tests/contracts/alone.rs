//! `losses.alone`: garments draped alone count beside the outfit, where all networks are trained.

use clothcombo_model::ClothCombo;
use clothcombo_physics::energy::SceneEnergy;
use clothcombo_tests::{loss_and_gradient, tiny_config};
use clothcombo_trainer::config::Trains;
use clothcombo_trainer::dataset::{Dataset, PreparedScene};
use clothcombo_trainer::inference::networks::TensorStore;
use clothcombo_trainer::system::device::Backend;
use clothcombo_trainer::training::learner::{Learner, new_optimizer};
use clothcombo_trainer::training::process_group::RankPartition;
use clothcombo_trainer::training::scenes::prepare_step;
use clothcombo_trainer::training::schedule::Schedule;
use std::sync::Arc;

#[test]
fn the_losses_of_garments_alone_are_added_where_all_networks_are_trained() {
    let folder = tempfile::tempdir().unwrap();
    // Gradients that are compared as they are: those of scenes are not clipped where the mean is.
    let config = tiny_config(folder.path(), &["losses.alone=0.5", "optimizer.clip=step"]);
    let silent = tiny_config(folder.path(), &["optimizer.clip=step"]);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let device = Backend::preferred().device().autodiff();
    let dimensions = dataset.dimensions();
    let tensors = TensorStore::new(dataset.clone(), dimensions, &device);
    let model = ClothCombo::new(&config.model, &dimensions, config.seed, &device).unwrap();
    let of = |scene: PreparedScene, trains: Trains| {
        let learner = Learner::new(model.clone(), new_optimizer(&config.optimizer), &config.optimizer);
        loss_and_gradient(learner, &tensors, &[scene], trains)
    };
    let schedule = Schedule::new(&config);
    let mut stages = config.stages.iter().zip(schedule.boundaries());
    let (_, first) = stages.find(|(stage, _)| stage.trains == Trains::All).unwrap();
    // Steps until one has garments that can touch.
    let scene_of = |config, step| {
        prepare_step(&dataset, config, &schedule, step, RankPartition::WHOLE).unwrap().remove(0)
    };
    let step = (first..).find(|&step| !scene_of(&config, step).contacts.is_empty()).unwrap();

    let both = of(scene_of(&config, step), Trains::All);
    let outfit = of(scene_of(&silent, step), Trains::All);
    let mut without_pairs = scene_of(&silent, step);
    for body in &mut without_pairs.bodies {
        body.energy = Arc::new(SceneEnergy { layers: Vec::new(), ..(*body.energy).clone() });
    }
    let alone = of(without_pairs, Trains::Single);

    assert!((both.0 - outfit.0 - 0.5 * alone.0).abs() <= 1e-6 * both.0.abs());
    let largest = both.1.iter().fold(0.0_f32, |m, g| m.max(g.abs()));
    assert!(largest > 0.0 && both.1 != outfit.1);
    for ((both, outfit), alone) in both.1.iter().zip(&outfit.1).zip(&alone.1) {
        assert!((both - outfit - 0.5 * alone).abs() <= 1e-5 * largest, "{both} {outfit} {alone}");
    }
    // The untangling network changes nothing of garments alone.
    let untangling = |config| of(scene_of(config, step), Trains::Untangling);
    assert_eq!(untangling(&config), untangling(&silent));
}
