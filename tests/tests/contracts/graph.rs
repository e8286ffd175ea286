//! `model.graph`: what the untangling network does to a single garment, in training and at inference.

use burn::module::Module;
use clothcombo_model::Mode;
use clothcombo_tests::Untrained;
use clothcombo_trainer::config::Trains;
use clothcombo_trainer::inference::networks::Networks;

/// Whether D_m moves a single garment, and whether the gradient of its loss trains D_m.
fn acts_on_a_single_garment(graph: &str) -> (bool, bool) {
    let folder = tempfile::tempdir().unwrap();
    let run = Untrained::new(folder.path(), &[&format!("model.graph={graph}")]);
    let scene = &run.scenes(0)[..1];
    assert_eq!((scene[0].garments.len(), scene[0].contacts.len()), (1, 0));

    let networks = Networks::new(run.model.valid(), &run.tensors);
    let modes = [Mode::Layered, Mode::Single];
    let [drape, single] = modes.map(|mode| networks.forward(&scene[0], mode).unwrap());
    let (_, gradient) = run.loss_and_gradient(scene, Trains::Untangling);
    (drape.canonical != single.canonical, gradient.iter().any(|g| *g != 0.0))
}

#[test]
fn the_full_graph_displaces_and_trains_a_single_garment_and_the_near_one_does_not() {
    assert_eq!(acts_on_a_single_garment("full"), (true, true));
    assert_eq!(acts_on_a_single_garment("near"), (false, false));
}
