//! Normal equations of linear least squares.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// The sums `Σ r rᵀ` (its lower triangle) and `Σ r y` over the rows of a least-squares problem.
pub(crate) struct NormalEquations {
    gram: Vec<Vec<f64>>,
    right: Vec<f64>,
}

impl NormalEquations {
    /// Of no rows.
    pub fn new(unknowns: usize) -> Self {
        Self { gram: vec![vec![0.0; unknowns]; unknowns], right: vec![0.0; unknowns] }
    }

    /// Adds a row and the value that its product with the unknowns should have.
    pub fn add(&mut self, row: &[f64], wanted: f64) {
        for i in 0..row.len() {
            self.right[i] += row[i] * wanted;
            (0..=i).for_each(|j| self.gram[i][j] += row[i] * row[j]);
        }
    }

    /// The unknowns, with `ridge` of each on the diagonal; none where the rows do not determine them.
    pub fn solution(&self, ridge: impl Fn(usize) -> f64) -> Option<Vec<f64>> {
        let size = self.right.len();
        let gram = |i: usize, j: usize| self.gram[i.max(j)][i.min(j)] + if i == j { ridge(i) } else { 0.0 };
        let factor = Mat::from_fn(size, size, gram).llt(Side::Lower).ok()?;
        let solution = factor.solve(Mat::from_fn(size, 1, |i, _| self.right[i]));
        Some((0..size).map(|i| solution[(i, 0)]).collect())
    }
}
