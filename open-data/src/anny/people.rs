//! Principal components of many people.

use clothcombo_data::import::ImportError;
use faer::{Mat, Side};
use rayon::prelude::*;

/// Mean and scaled principal directions: a unit step along one of them is one standard deviation.
pub struct Components {
    /// Mean, flat `[3N]`.
    pub mean: Vec<f64>,
    /// One flat `[3N]` direction per component, largest first.
    pub directions: Vec<Vec<f64>>,
    /// Share of the variance explained by the first, the first two, …
    pub explained: Vec<f64>,
}

/// PCA by the Gram matrix of the first `measured` coordinates of each row, applied to all coordinates, so that joints and
/// helper meshes follow the same components as the skin.
pub fn principal_components(
    rows: &[Vec<f32>],
    measured: usize,
    count: usize,
) -> Result<Components, ImportError> {
    let n = rows.len();
    let width = rows[0].len();
    let mut mean = vec![0.0; width];
    for row in rows {
        mean.iter_mut().zip(row).for_each(|(m, x)| *m += f64::from(*x));
    }
    mean.iter_mut().for_each(|m| *m /= n as f64);
    let centred: Vec<Vec<f32>> = rows
        .par_iter()
        .map(|row| row.iter().zip(&mean).map(|(x, m)| (f64::from(*x) - m) as f32).collect())
        .collect();
    // f32 products summed in blocks, blocks in f64: exact enough (1e-6 relative) and twice as fast.
    let dot = |a: &[f32], b: &[f32]| -> f64 {
        a.chunks(256)
            .zip(b.chunks(256))
            .map(|(a, b)| f64::from(a.iter().zip(b).map(|(x, y)| x * y).sum::<f32>()))
            .sum()
    };
    let gram_rows: Vec<Vec<f64>> = (0..n)
        .into_par_iter()
        .map(|i| (0..=i).map(|j| dot(&centred[i][..measured], &centred[j][..measured])).collect())
        .collect();
    let gram = Mat::from_fn(n, n, |i, j| gram_rows[i.max(j)][i.min(j)]);
    let eigen = gram
        .self_adjoint_eigen(Side::Lower)
        .map_err(|e| ImportError::Refused(format!("PCA failed: {e:?}")))?;
    let values: Vec<f64> = (0..n).map(|i| eigen.S()[i].max(0.0)).collect();
    let total: f64 = values.iter().sum();
    // Eigenvalues ascend.
    let order: Vec<usize> = (0..n).rev().take(count).collect();
    let directions: Vec<Vec<f64>> = order
        .par_iter()
        .map(|column| {
            let mut direction = vec![0.0; width];
            for (i, row) in centred.iter().enumerate() {
                let coefficient = eigen.U()[(i, *column)] / ((n - 1) as f64).sqrt();
                direction.iter_mut().zip(row).for_each(|(d, x)| *d += coefficient * f64::from(*x));
            }
            // Signs are arbitrary: let positive mean taller, so that they do not depend on the solver.
            let height: f64 = direction[..measured]
                .iter()
                .skip(1)
                .step_by(3)
                .zip(mean.iter().skip(1).step_by(3))
                .map(|(d, y)| d * y)
                .sum();
            if height < 0.0 {
                direction.iter_mut().for_each(|d| *d = -*d);
            }
            direction
        })
        .collect();
    let explained = order
        .iter()
        .scan(0.0, |sum, i| {
            *sum += values[*i] / total.max(f64::MIN_POSITIVE);
            Some(*sum)
        })
        .collect();
    Ok(Components { mean, directions, explained })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn recovers_a_planted_subspace() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let width = 60;
        let mut random =
            |scale: f64| -> Vec<f64> { (0..width).map(|_| scale * rng.random_range(-1.0..1.0)).collect() };
        let (mean, first, second) = (random(1.0), random(0.5), random(0.1));
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(6);
        let rows: Vec<Vec<f32>> = (0..40)
            .map(|_| {
                let (a, b) = (rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
                (0..width).map(|i| (mean[i] + a * first[i] + b * second[i]) as f32).collect()
            })
            .collect();
        let pca = principal_components(&rows, width, 2).unwrap();
        assert!(pca.explained[1] > 1.0 - 1e-6 && pca.explained[0] > 0.8);
        // Every row is mean + span of the directions: projection leaves nothing.
        for row in &rows {
            let mut rest: Vec<f64> = row.iter().zip(&pca.mean).map(|(x, m)| f64::from(*x) - m).collect();
            for d in &pca.directions {
                let norm: f64 = d.iter().map(|x| x * x).sum();
                let c = rest.iter().zip(d).map(|(r, x)| r * x).sum::<f64>() / norm;
                rest.iter_mut().zip(d).for_each(|(r, x)| *r -= c * x);
            }
            assert!(rest.iter().all(|r| r.abs() < 1e-5));
        }
        // Unit variance: projections of the rows onto d/|d|² have variance one.
        let d = &pca.directions[0];
        let norm: f64 = d.iter().map(|x| x * x).sum();
        let variance: f64 = rows
            .iter()
            .map(|row| {
                (row.iter().zip(&pca.mean).zip(d).map(|((x, m), d)| (f64::from(*x) - m) * d).sum::<f64>()
                    / norm)
                    .powi(2)
            })
            .sum::<f64>()
            / 39.0;
        assert!((variance - 1.0).abs() < 1e-4, "{variance}");
    }
}
