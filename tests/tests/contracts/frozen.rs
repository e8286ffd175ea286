//! Stages that freeze networks: only what they train gets a gradient.

use burn::module::Module;
use clothcombo_tests::Untrained;
use clothcombo_trainer::config::Trains;

#[test]
fn the_untangling_stage_has_a_gradient_of_the_untangling_networks_only() {
    let folder = tempfile::tempdir().unwrap();
    let run = Untrained::new(folder.path(), &[]);
    let scene = &run.scenes(run.step_with_contacts(20))[..1];
    let (_, gradient) = run.loss_and_gradient(scene, Trains::Untangling);
    // The last parameters.
    let (frozen, own) = gradient.split_at(gradient.len() - run.model.untangling.num_params());
    assert!(frozen.iter().all(|g| *g == 0.0) && own.iter().any(|g| *g != 0.0));
    let (_, all) = run.loss_and_gradient(scene, Trains::All);
    assert_eq!(all.len(), gradient.len());
    assert!(all[..frozen.len()].iter().any(|g| *g != 0.0));
}
