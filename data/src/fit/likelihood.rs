//! How likely the gaps between cloth and body are for clothes that are worn.
//!
//! Cloth lies on the body at a distance that is about the same wherever it touches, hangs away from it elsewhere, and is hardly
//! ever inside. Every sample is drawn from a mixture of the three; the distance at which the cloth lies, its ease, is the most
//! likely one.

use super::body_field::BODY_PARTS;
use std::sync::LazyLock;

/// Distances at which cloth may begin to lie on the body, its ease (m).
const EASES: [f64; 12] =
    [0.001, 0.003, 0.005, 0.0075, 0.010, 0.0125, 0.015, 0.018, 0.021, 0.025, 0.030, 0.036];
/// How far beyond the ease it lies, on average (m).
const SPREADS: [f64; 4] = [0.002, 0.004, 0.008, 0.016];
const EASE_KINDS: usize = EASES.len() * SPREADS.len();
/// How much nearer than the ease some of it is, on average (m).
const NEARER: f64 = 0.0015;
/// Mean distance where it hangs (m).
const HANGING: f64 = 0.2;
/// Mean depth where it is inside (m).
const MEAN_DEPTH: f64 = 0.01;
/// Shares of what lies, hangs and is inside.
const MIXTURE: [f64; 3] = [0.54, 0.40, 0.06];
/// Scale of the prior on the ease (m): clothes are made to lie near.
const USUAL_EASE: f64 = 0.01;

/// Range and resolution of the tables (m).
const LEAST_TABLE_GAP: f64 = -0.25;
const LARGEST_TABLE_GAP: f64 = 0.25;
const TABLE_STEP: f64 = 0.001;
const TABLE_ROWS: usize = ((LARGEST_TABLE_GAP - LEAST_TABLE_GAP) / TABLE_STEP) as usize + 1;

/// Logarithms of the density of each gap for each ease and spread.
static SHARP_TABLE: LazyLock<Vec<[f32; EASE_KINDS]>> = LazyLock::new(|| {
    let density =
        |gap, kind| sharp_log_density(gap, EASES[kind % EASES.len()], SPREADS[kind / EASES.len()]) as f32;
    table(|gap| std::array::from_fn(|kind| density(gap, kind)))
});

/// The same for a garment some centimetres away from its place.
static ROUGH_TABLE: LazyLock<Vec<f32>> = LazyLock::new(|| table(|gap| rough_log_density(gap) as f32));

fn table<T>(of_gap: impl Fn(f64) -> T) -> Vec<T> {
    (0..TABLE_ROWS).map(|row| of_gap(LEAST_TABLE_GAP + row as f64 * TABLE_STEP)).collect()
}

fn row(gap: f64) -> usize {
    ((gap - LEAST_TABLE_GAP) / TABLE_STEP + 0.5).clamp(0.0, (TABLE_ROWS - 1) as f64) as usize
}

/// Logarithm of the density of a gap (1/m).
fn sharp_log_density(gap: f64, ease: f64, spread: f64) -> f64 {
    let beyond = gap - ease;
    let lying = (-beyond.max(0.0) / spread).exp() * (beyond.min(0.0) / NEARER).exp() / (spread + NEARER);
    let [hanging, inside] = match gap >= 0.0 {
        true => [(-gap / HANGING).exp() / HANGING, 0.0],
        false => [0.0, (gap / MEAN_DEPTH).exp() / MEAN_DEPTH],
    };
    (MIXTURE[0] * lying + MIXTURE[1] * hanging + MIXTURE[2] * inside).max(1e-9).ln()
}

/// The normal distribution's density.
pub(super) fn normal_density(x: f64, middle: f64, spread: f64) -> f64 {
    (-0.5 * ((x - middle) / spread).powi(2)).exp() / (spread * std::f64::consts::TAU.sqrt())
}

/// A bell of 2 cm around the middle of the usual eases, and a tail on both sides.
fn rough_log_density(gap: f64) -> f64 {
    let lying = normal_density(gap, 0.012, 0.02);
    let hanging = (-gap.max(0.0) / 0.1).exp() / 0.1;
    let inside = (gap.min(0.0) / 0.02).exp();
    (0.5 * lying + 0.5 * hanging * inside).max(1e-9).ln()
}

/// Logarithm of the density of gaps (m), each with its part of the body, at the most likely ease and spread of every part. The
/// gaps together are worth `evidence` independent ones.
pub(super) fn log_likelihood(gaps: impl ExactSizeIterator<Item = (f64, usize)>, evidence: f64) -> f64 {
    let count = gaps.len().max(1) as f64;
    let mut sums = [[0.0f32; EASE_KINDS]; BODY_PARTS];
    for (gap, part) in gaps {
        sums[part].iter_mut().zip(&SHARP_TABLE[row(gap)]).for_each(|(s, l)| *s += l);
    }
    let score = |(kind, sum): (usize, &f32)| {
        evidence * f64::from(*sum) / count - EASES[kind % EASES.len()] / USUAL_EASE
    };
    sums.iter().map(|sums| sums.iter().enumerate().map(score).fold(f64::MIN, f64::max)).sum()
}

/// The same for a garment that may be some centimetres away from its place.
pub(super) fn rough_log_likelihood(gaps: impl ExactSizeIterator<Item = (f64, usize)>, evidence: f64) -> f64 {
    let count = gaps.len().max(1) as f64;
    evidence * gaps.map(|(gap, _)| f64::from(ROUGH_TABLE[row(gap)])).sum::<f64>() / count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cloth_at_one_distance_is_likelier_than_scattered_or_buried_cloth() {
        let of = |gap: fn(f64) -> f64| {
            let gaps: Vec<(f64, usize)> = (0..200).map(|i| (gap(f64::from(i) / 200.0), 1)).collect();
            log_likelihood(gaps.into_iter(), 40.0)
        };
        let even = of(|t| 0.010 + 0.003 * t);
        assert!(even > of(|t| 0.010 + 0.030 * t) + 10.0, "scattered");
        assert!(even > of(|t| 0.010 - 0.020 * t) + 10.0, "buried");
        assert!(even > of(|t| 0.030 + 0.003 * t) + 1.0, "as even, but farther away");
    }

    #[test]
    fn each_part_of_the_body_has_its_own_ease() {
        let gaps = |second: usize| (0..200).map(move |i| if i < 100 { (0.005, 0) } else { (0.02, second) });
        assert!(log_likelihood(gaps(1), 40.0) > log_likelihood(gaps(0), 40.0) + 10.0);
    }
}
