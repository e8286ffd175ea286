//! `losses.single_garments`: losses of single garments count besides those of the outfit, where all networks are trained.

use clothcombo_physics::energy::SceneEnergy;
use clothcombo_tests::{Untrained, tiny_config};
use clothcombo_trainer::config::Trains;
use clothcombo_trainer::training::schedule::Schedule;
use std::sync::Arc;

#[test]
fn losses_of_single_garments_are_added_where_all_networks_are_trained() {
    let folder = tempfile::tempdir().unwrap();
    // Gradients that are compared as they are: those of scenes are not clipped where the mean is.
    let run = Untrained::new(folder.path(), &["losses.single_garments=0.5", "optimizer.clip=step"]);
    let silent = tiny_config(folder.path(), &["optimizer.clip=step"]);
    let schedule = Schedule::new(&run.config);
    let mut stages = run.config.stages.iter().zip(schedule.boundaries());
    let (_, first) = stages.find(|(stage, _)| stage.trains == Trains::All).unwrap();
    let step = run.step_with_contacts(first);

    let of = |config, trains| run.loss_and_gradient(&run.scenes_with(config, step)[..1], trains);
    let both = of(&run.config, Trains::All);
    let outfit = of(&silent, Trains::All);
    let mut without_pairs = run.scenes_with(&silent, step);
    for body in &mut without_pairs[0].bodies {
        body.energy = Arc::new(SceneEnergy { layers: Vec::new(), ..(*body.energy).clone() });
    }
    let single = run.loss_and_gradient(&without_pairs[..1], Trains::Single);

    assert!((both.0 - outfit.0 - 0.5 * single.0).abs() <= 1e-6 * both.0.abs());
    let largest = both.1.iter().fold(0.0_f32, |m, g| m.max(g.abs()));
    assert!(largest > 0.0 && both.1 != outfit.1);
    for ((both, outfit), single) in both.1.iter().zip(&outfit.1).zip(&single.1) {
        assert!((both - outfit - 0.5 * single).abs() <= 1e-5 * largest, "{both} {outfit} {single}");
    }
    // The untangling network changes nothing of single garments.
    assert_eq!(of(&run.config, Trains::Untangling), of(&silent, Trains::Untangling));
}
