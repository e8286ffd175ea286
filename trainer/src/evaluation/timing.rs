//! Wall-clock time of something that can be repeated.

use crate::run::spread::Spread;
use std::hint::black_box;
use std::time::Instant;

/// Repetitions of something fast last this long (s).
pub const REPETITION_SECONDS: f64 = 0.05;

/// Median time (ms) of `run` over at least 3 and about `seconds` of repetitions, after one to warm up.
///
/// # Errors
/// The first error of `run`.
pub fn median_ms<R, E>(seconds: f64, mut run: impl FnMut() -> Result<R, E>) -> Result<f64, E> {
    black_box(run()?);
    let (start, mut times) = (Instant::now(), Vec::new());
    while times.len() < 3 || start.elapsed().as_secs_f64() < seconds {
        let before = Instant::now();
        black_box(run()?);
        times.push(1e3 * before.elapsed().as_secs_f64());
    }
    Ok(Spread::of(times).median)
}
