//! The number of threads leaves no trace.

use super::scenes::{body, garment, paper_weights, scene_of};
use crate::energy::{EnergySettings, SceneValue};
use crate::real::Real;

fn with_threads<T: Real>(threads: usize) -> SceneValue<T> {
    // Above the grain of every loop, so that work is really shared.
    let rest = vec![garment(0.121, 60, 40, 1), garment(0.123, 50, 44, 2), garment(0.125, 55, 30, 3)];
    let scene = scene_of::<T>(rest, &body(1), EnergySettings::default(), paper_weights(), 0.002, 1);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    pool.install(|| scene.energy.evaluate(&scene.posed, &scene.canonical))
}

#[test]
fn values_and_gradients_are_bit_identical_for_any_number_of_threads() {
    let (single, double) = (with_threads::<f32>(1), with_threads::<f64>(1));
    assert!(single.layers.iter().all(|raw| raw.iter().any(|(_, v)| v.is_some_and(|v| v > 0.0))));
    for threads in [2, 4] {
        // Equality of every value and coordinate; none is NaN or a signed zero that could hide a difference.
        assert!(with_threads::<f32>(threads) == single, "{threads} threads, f32");
        assert!(with_threads::<f64>(threads) == double, "{threads} threads, f64");
    }
}
