//! Scenes of a step that are computed beside each other give what they give one after the other.

use clothcombo_model::ClothCombo;
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

/// Loss and gradient of `scenes` with a pool of `threads` threads.
fn gradient(
    learner: &(impl Fn() -> Learner + Sync),
    tensors: &TensorStore,
    scenes: &[PreparedScene],
    trains: Trains,
    threads: usize,
) -> (f64, Vec<f32>) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| loss_and_gradient(learner(), tensors, scenes, trains))
}

#[test]
fn gradients_do_not_depend_on_what_is_computed_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let several: Vec<String> = (0..3).map(|i| format!("stages.{i}.accumulate=3")).collect();
    let config = tiny_config(folder.path(), &several.iter().map(String::as_str).collect::<Vec<_>>());
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let device = Backend::preferred().device().autodiff();
    let dimensions = dataset.dimensions();
    let tensors = TensorStore::new(dataset.clone(), dimensions, &device);
    let learner = || {
        let model = ClothCombo::new(&config.model, &dimensions, config.seed, &device).unwrap();
        Learner::new(model, new_optimizer(&config.optimizer), &config.optimizer)
    };
    let schedule = Schedule::new(&config);
    for (first, stage) in schedule.boundaries().into_iter().zip(&config.stages) {
        let scenes = prepare_step(&dataset, &config, &schedule, first, RankPartition::WHOLE).unwrap();
        let of = |threads| gradient(&learner, &tensors, &scenes, stage.trains, threads);
        let (loss, one_by_one) = of(1);
        let largest = one_by_one.iter().fold(0.0_f32, |m, g| m.max(g.abs()));
        assert!(loss.is_finite() && largest > 0.0, "{}: nothing to compare", stage.name);
        // Two at once and one more; three at once, on one thread each and on two.
        for threads in [2, 3, 6] {
            let (at_once_loss, at_once) = of(threads);
            assert!((loss - at_once_loss).abs() <= 1e-6 * loss.abs(), "{loss} {at_once_loss}");
            for (a, b) in one_by_one.iter().zip(&at_once) {
                assert!((a - b).abs() <= 1e-5 * largest, "{}, {threads} threads: {a} {b}", stage.name);
            }
            assert!(of(threads) == (at_once_loss, at_once), "not the same from run to run");
        }
    }
}
