//! `model.graph`: what the untangling network does to a single garment, in training and at inference.

use clothcombo_model::ClothCombo;
use clothcombo_tests::{loss_and_gradient, tiny_config};
use clothcombo_trainer::config::Trains;
use clothcombo_trainer::dataset::Dataset;
use clothcombo_trainer::inference::networks::{Networks, TensorStore};
use clothcombo_trainer::system::device::Backend;
use clothcombo_trainer::training::learner::{Learner, new_optimizer};
use clothcombo_trainer::training::process_group::RankPartition;
use clothcombo_trainer::training::scenes::prepare_step;
use clothcombo_trainer::training::schedule::Schedule;
use std::sync::Arc;

/// Whether D_m moves a single garment, and whether the gradient of its loss trains D_m.
fn acts_on_a_single_garment(graph: &str) -> (bool, bool) {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny_config(folder.path(), &[&format!("model.graph={graph}")]);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let device = Backend::preferred().device().autodiff();
    let dimensions = dataset.dimensions();
    let tensors = TensorStore::new(dataset.clone(), dimensions, &device);
    let model = ClothCombo::new(&config.model, &dimensions, config.seed, &device).unwrap();
    let schedule = Schedule::new(&config);
    let scene = prepare_step(&dataset, &config, &schedule, 0, RankPartition::WHOLE).unwrap().remove(0);
    assert_eq!((scene.garments.len(), scene.contacts.len()), (1, 0));

    let networks = Networks::new(burn::module::Module::valid(&model), &tensors);
    let [drape, single] = [networks.drape(&scene), networks.drape_alone(&scene)].map(Result::unwrap);
    let learner = Learner::new(model, new_optimizer(&config.optimizer), &config.optimizer);
    let (_, gradient) = loss_and_gradient(learner, &tensors, &[scene], Trains::Untangling);
    (drape.canonical != single.canonical, gradient.iter().any(|g| *g != 0.0))
}

#[test]
fn the_full_graph_displaces_and_trains_a_single_garment_and_the_near_one_does_not() {
    assert_eq!(acts_on_a_single_garment("full"), (true, true));
    assert_eq!(acts_on_a_single_garment("near"), (false, false));
}
