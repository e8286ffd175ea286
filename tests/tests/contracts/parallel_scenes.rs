//! Scenes of a step that are computed in parallel give what they give one after the other.

use clothcombo_tests::Untrained;
use clothcombo_trainer::training::schedule::Schedule;

#[test]
fn gradients_do_not_depend_on_what_is_computed_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let several: Vec<String> = (0..3).map(|i| format!("stages.{i}.accumulate=3")).collect();
    let run = Untrained::new(folder.path(), &several.iter().map(String::as_str).collect::<Vec<_>>());
    let schedule = Schedule::new(&run.config);
    for (first, stage) in schedule.boundaries().into_iter().zip(&run.config.stages) {
        let scenes = run.scenes(first);
        let of = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run.loss_and_gradient(&scenes, stage.trains))
        };
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
