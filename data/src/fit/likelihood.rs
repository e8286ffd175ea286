//! How likely the gaps between cloth and body are for clothes that are worn.
//!
//! Cloth lies on the body at a distance that is about the same wherever it touches, hangs away from it elsewhere, and is hardly
//! ever inside. Every sample is drawn from a mixture of the three; the distance at which the cloth lies, its ease, is the most
//! likely one.

use std::sync::LazyLock;

/// Distances at which cloth may begin to lie on the body (m).
const EASES: [f64; 12] = [0.001, 0.003, 0.005, 0.0075, 0.010, 0.0125, 0.015, 0.018, 0.021, 0.025, 0.030, 0.036];
/// Scale of what is nearer than that (m).
const NEARER: f64 = 0.0015;
/// Scale of what lies there (m).
const LYING: [f64; 4] = [0.002, 0.004, 0.008, 0.016];
/// Mean distance where it hangs (m).
const HANGING: f64 = 0.2;
/// Mean depth where it is inside (m).
const DEPTH: f64 = 0.01;
/// Shares of what lies, hangs and is inside.
const SHARES: [f64; 3] = [0.54, 0.40, 0.06];
/// Clothes are made to lie this near (m): scale of the prior on the ease.
const USUAL_EASE: f64 = 0.005;

/// Range and resolution of the table (m).
const LOW: f64 = -0.25;
const HIGH: f64 = 0.25;
const RESOLUTION: f64 = 0.001;
const KINDS: usize = EASES.len() * LYING.len();
const ROWS: usize = ((HIGH - LOW) / RESOLUTION) as usize + 1;

static TABLE: LazyLock<Vec<[f32; KINDS]>> = LazyLock::new(|| {
    (0..ROWS).map(|i| std::array::from_fn(|k| log_density(LOW + i as f64 * RESOLUTION, EASES[k % EASES.len()], LYING[k / EASES.len()]) as f32)).collect()
});

/// Logarithm of the density of a gap (1/m).
fn log_density(gap: f64, ease: f64, spread: f64) -> f64 {
    let (nearer, hang, depth, share) = (env("NEARER", 0.0015), env("HANG", 0.2), env("DEPTH", 0.01), env("INS", 0.06));
    let from = gap - ease;
    let lying = (-from.max(0.0) / spread).exp() * (from.min(0.0) / nearer).exp() / (spread + nearer);
    let [hanging, inside] = match gap >= 0.0 {
        true => [(-gap / hang).exp() / hang, 0.0],
        false => [0.0, (gap / depth).exp() / depth],
    };
    (SHARES[0] * lying + SHARES[1] * hanging + share * inside).max(1e-9).ln()
}

/// Logarithm of the density of the gaps (m) at each part of the body, at the most likely ease and spread of each part.
pub(super) fn log_likelihood(gaps: impl ExactSizeIterator<Item = (f64, usize)>, evidence: f64) -> f64 {
    let count = gaps.len().max(1) as f64;
    let mut sums = [[0.0f32; KINDS]; PARTS];
    for (gap, part) in gaps {
        sums[part].iter_mut().zip(&TABLE[row(gap)]).for_each(|(s, l)| *s += l);
    }
    let score = |(k, sum): (usize, &f32)| evidence * f64::from(*sum) / count - EASES[k % EASES.len()] / *USUAL;
    sums.iter().map(|sums| sums.iter().enumerate().map(score).fold(f64::MIN, f64::max)).sum()
}

static USUAL: LazyLock<f64> = LazyLock::new(|| env("USUAL", 0.01));

/// Parts of the body on which cloth may lie differently: legs, hips, chest, arms.
pub(super) const PARTS: usize = 4;

/// The same for a garment that may be some centimetres away from its place.
pub(super) fn rough_log_likelihood(gaps: impl ExactSizeIterator<Item = (f64, usize)>, evidence: f64) -> f64 {
    let count = gaps.len().max(1) as f64;
    let sum: f64 = gaps.map(|(gap, _)| f64::from(ROUGH[row(gap)])).sum();
    evidence * sum / count
}

static ROUGH: LazyLock<Vec<f32>> = LazyLock::new(|| {
    (0..ROWS)
        .map(|i| {
            let gap = LOW + i as f64 * RESOLUTION;
            let lying = (-0.5 * ((gap - 0.012) / 0.02).powi(2)).exp() / (0.02 * 2.5066);
            let hanging = (-gap.max(0.0) / 0.1).exp() / 0.1;
            let inside = (gap.min(0.0) / 0.02).exp() ;
            (0.5 * lying + 0.5 * hanging * inside).max(1e-9).ln() as f32
        })
        .collect()
});

fn row(gap: f64) -> usize {
    ((gap - LOW) / RESOLUTION + 0.5).clamp(0.0, (ROWS - 1) as f64) as usize
}

pub(super) fn env(name: &str, default: f64) -> f64 {
    std::env::var(name).ok().and_then(|s| s.parse().ok()).unwrap_or(default)
}
