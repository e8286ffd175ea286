//! The smallest eigenpairs of a large sparse symmetric positive semidefinite matrix.
//!
//! Block Lanczos on the shift-inverted operator `(C + σI)⁻¹` with full reorthogonalisation, Rayleigh–Ritz, and thick restarts
//! (Wu and Simon 2000). Blocks find repeated eigenvalues at once; full reorthogonalisation keeps false copies out; the number
//! of steps is bounded, so that it always ends.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::matmul::matmul;
use faer::{Accum, Col, Mat, MatRef, Par};

use crate::mesh::shapes::SplitMix;
use crate::operators::SparseMatrix;
use crate::operators::cholesky::Cholesky;

/// Columns added per step: more than the multiplicity that a symmetric shape gives an eigenvalue (5 for an icosahedron).
const BLOCK_COLUMNS: usize = 8;

/// A pair has converged at this residual of the inverted operator, relative to its eigenvalue there.
const RESIDUAL_TOLERANCE: f64 = 1e-9;

/// Restarts with one shift. None or one are usual.
const RESTART_LIMIT: usize = 8;

/// Shifts tried before giving up.
const SHIFT_LIMIT: usize = 4;

/// Why no eigenpairs were found.
pub(super) enum Failure {
    /// The factorisation or the small dense problem broke down.
    Factorisation(&'static str),
    /// The largest relative residual when the restarts were used up.
    NotConverged(f64),
}

/// Eigenvalues ascending and orthonormal eigenvectors by column of a dense symmetric matrix; single-threaded.
pub(super) fn dense_eigenpairs(matrix: MatRef<'_, f64>) -> Option<(Vec<f64>, Mat<f64>)> {
    let n = matrix.nrows();
    let mut values = Col::<f64>::zeros(n);
    let mut vectors = Mat::<f64>::zeros(n, n);
    let scratch = self_adjoint_evd_scratch::<f64>(n, ComputeEigenvectors::Yes, Par::Seq, Default::default());
    let mut memory = MemBuffer::try_new(scratch).ok()?;
    self_adjoint_evd(
        matrix,
        values.as_diagonal_mut(),
        Some(vectors.as_mut()),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    )
    .ok()?;
    let values: Vec<f64> = values.iter().copied().collect();
    values.iter().all(|v| v.is_finite()).then_some((values, vectors))
}

/// The `count` smallest eigenvalues of `matrix`, ascending, with orthonormal eigenvectors by column.
///
/// `kernel` is a unit vector with `matrix · kernel = 0` (the constants); it is kept exactly. The matrix is scaled so that its
/// first eigenvalues are of order one. Needs `matrix.rows() > 3·count` and at least 64 rows.
pub(super) fn smallest_eigenpairs(
    matrix: &SparseMatrix,
    kernel: &[f64],
    count: usize,
) -> Result<(Vec<f64>, Mat<f64>), Failure> {
    let mut shift = 1.0;
    let mut residual = f64::INFINITY;
    for _ in 0..SHIFT_LIMIT {
        match with_shift(matrix, kernel, count, shift)? {
            LanczosOutcome::Converged(vectors) => return Ok(rayleigh_quotients(matrix, vectors)),
            LanczosOutcome::Stalled { largest_residual, last_eigenvalue } => {
                residual = largest_residual;
                // A shift far above the wanted eigenvalues blurs them into one, one far below drowns them in rounding.
                shift = if last_eigenvalue > 1e-6 * shift { last_eigenvalue / 8.0 } else { 1e-3 * shift };
            }
        }
    }
    Err(Failure::NotConverged(residual))
}

enum LanczosOutcome {
    Converged(Mat<f64>),
    /// The restarts were used up; `last_eigenvalue` estimates the largest wanted one.
    Stalled {
        largest_residual: f64,
        last_eigenvalue: f64,
    },
}

fn with_shift(
    matrix: &SparseMatrix,
    kernel: &[f64],
    count: usize,
    shift: f64,
) -> Result<LanczosOutcome, Failure> {
    let n = matrix.rows();
    let factor =
        Cholesky::new(&shifted(matrix, shift)).ok_or(Failure::Factorisation("the sparse factorisation"))?;
    let capacity = (count * 5 / 2 + 6 * BLOCK_COLUMNS).min(n - BLOCK_COLUMNS);
    // Each look at the Ritz values is a dense eigenvalue problem; it must stay rare against the steps between.
    let between_checks = (count / 4).max(4 * BLOCK_COLUMNS);
    let mut space = Krylov::new(n, capacity, kernel, 1.0 / shift, |block| factor.solve_in_place(block));
    let mut next_check = count + count / 2 + 2 * BLOCK_COLUMNS;
    let mut restarts = 0;
    loop {
        let rest = space.expand(|block| factor.solve_in_place(block));
        let full = space.filled + BLOCK_COLUMNS > capacity;
        if !full && space.filled < next_check {
            space.append(&rest.directions);
            continue;
        }
        next_check = space.filled + between_checks;
        let ritz = space.ritz(&rest.coupling, count).ok_or(Failure::Factorisation("Rayleigh–Ritz"))?;
        if ritz.largest_residual <= RESIDUAL_TOLERANCE {
            return Ok(LanczosOutcome::Converged(space.refined(&ritz, &rest, count)));
        }
        if full {
            if restarts == RESTART_LIMIT {
                return Ok(LanczosOutcome::Stalled {
                    largest_residual: ritz.largest_residual,
                    last_eigenvalue: 1.0 / ritz.values[count - 1].max(f64::MIN_POSITIVE) - shift,
                });
            }
            restarts += 1;
            // Keeping some unwanted pairs makes the next cycle converge faster; it still gains a third of the space.
            let kept = (count + count / 4 + BLOCK_COLUMNS).min(capacity - 2 * BLOCK_COLUMNS);
            space.restart(&ritz, kept);
            next_check = capacity;
        }
        space.append(&rest.directions);
    }
}

/// `matrix + shift·I`.
fn shifted(matrix: &SparseMatrix, shift: f64) -> SparseMatrix {
    let mut triplets = Vec::with_capacity(matrix.entry_count() + matrix.rows());
    for row in 0..matrix.rows() {
        let (columns, values) = matrix.row(row);
        triplets.extend(columns.iter().zip(values).map(|(&column, &value)| (row as u32, column, value)));
        triplets.push((row as u32, row as u32, shift));
    }
    SparseMatrix::from_triplets(matrix.rows(), matrix.columns(), triplets)
}

/// Sorts eigenvectors by `yᵀCy`, which has half the relative error of an inverted Ritz value and none of its cancellation.
fn rayleigh_quotients(matrix: &SparseMatrix, vectors: Mat<f64>) -> (Vec<f64>, Mat<f64>) {
    let quotients: Vec<f64> = (0..vectors.ncols())
        .map(|j| {
            let y: Vec<f64> = vectors.col(j).iter().copied().collect();
            matrix.apply(&y).iter().zip(&y).map(|(c, y)| c * y).sum::<f64>().max(0.0)
        })
        .collect();
    let mut order: Vec<usize> = (0..quotients.len()).collect();
    order.sort_by(|&i, &j| quotients[i].total_cmp(&quotients[j]));
    let sorted = Mat::from_fn(vectors.nrows(), vectors.ncols(), |i, j| vectors[(i, order[j])]);
    (order.iter().map(|&j| quotients[j]).collect(), sorted)
}

/// What is left of the operator's image of the newest block: `directions · coupling`, orthogonal to the space.
struct ResidualBlock {
    directions: Mat<f64>,
    coupling: Mat<f64>,
}

/// Ritz pairs of the current space, largest eigenvalue of the inverted operator first.
struct Ritz {
    values: Vec<f64>,
    /// Coefficients in the basis, by column.
    coefficients: Mat<f64>,
    /// Residuals of the wanted pairs as coefficients of the directions outside the space, by column.
    residuals: Mat<f64>,
    /// The largest of their norms relative to the Ritz value.
    largest_residual: f64,
}

/// An orthonormal basis and the operator's projection on it.
struct Krylov {
    basis: Mat<f64>,
    projected: Mat<f64>,
    filled: usize,
    random: SplitMix,
}

impl Krylov {
    /// A space of the kernel vector and a first block: random, then smoothed by the operator, because noise on vertices of
    /// almost no mass would stay in the basis and leave every later vector only by cancellation. The seed is fixed: equal
    /// input gives equal output.
    fn new(
        n: usize,
        capacity: usize,
        kernel: &[f64],
        kernel_value: f64,
        operator: impl Fn(faer::MatMut<'_, f64>),
    ) -> Self {
        let mut space = Self {
            basis: Mat::zeros(n, capacity),
            projected: Mat::zeros(capacity, capacity),
            filled: 1,
            random: SplitMix::new(0x436c_6f74_6843_6f6d),
        };
        for i in 0..n {
            space.basis[(i, 0)] = kernel[i];
        }
        space.projected[(0, 0)] = kernel_value;
        let mut block = Mat::from_fn(n, BLOCK_COLUMNS, |_, _| space.random.symmetric());
        operator(block.as_mut());
        space.project_out(&mut block);
        let start = space.orthonormalise(block);
        space.append(&start.directions);
        space
    }

    fn append(&mut self, block: &Mat<f64>) {
        self.basis.as_mut().subcols_mut(self.filled, BLOCK_COLUMNS).copy_from(block);
        self.filled += BLOCK_COLUMNS;
    }

    /// Applies the operator to the newest block, records its projection, and returns the rest.
    fn expand(&mut self, operator: impl Fn(faer::MatMut<'_, f64>)) -> ResidualBlock {
        let start = self.filled - BLOCK_COLUMNS;
        let mut image = self.basis.as_ref().subcols(start, BLOCK_COLUMNS).to_owned();
        operator(image.as_mut());
        let overlap = self.project_out(&mut image);
        for j in 0..BLOCK_COLUMNS {
            for i in 0..self.filled {
                self.projected[(i, start + j)] = overlap[(i, j)];
                self.projected[(start + j, i)] = overlap[(i, j)];
            }
        }
        self.orthonormalise(image)
    }

    /// Removes the space from a block by classical Gram–Schmidt, twice (Parlett and Kahan: twice is enough), and returns the
    /// coefficients that were removed.
    fn project_out(&self, block: &mut Mat<f64>) -> Mat<f64> {
        let first = self.project_out_once(block);
        first + self.project_out_once(block)
    }

    /// One pass of it: what it leaves is as large as rounding in what it removed.
    fn project_out_once(&self, block: &mut Mat<f64>) -> Mat<f64> {
        let basis = self.basis.as_ref().subcols(0, self.filled);
        let mut overlap = Mat::<f64>::zeros(self.filled, block.ncols());
        matmul(overlap.as_mut(), Accum::Replace, basis.transpose(), block.as_ref(), 1.0, Par::Seq);
        matmul(block.as_mut(), Accum::Add, basis, overlap.as_ref(), -1.0, Par::Seq);
        overlap
    }

    /// QR of a block that is already orthogonal to the space. A column that vanishes (the space is invariant in that
    /// direction) is replaced by a random new direction with coupling zero.
    fn orthonormalise(&mut self, mut block: Mat<f64>) -> ResidualBlock {
        let n = block.nrows();
        let mut coupling = Mat::<f64>::zeros(BLOCK_COLUMNS, BLOCK_COLUMNS);
        for j in 0..BLOCK_COLUMNS {
            let before = norm(&block, j);
            part_from_earlier(&mut block, j, |i, overlap| coupling[(i, j)] += overlap);
            let after = norm(&block, j);
            // What is left after cancelling twelve digits is rounding, not a direction.
            if after > 1e-12 * before && after > 1e-150 {
                coupling[(j, j)] = after;
                divide(&mut block, j, after);
            } else {
                let mut fresh = Mat::from_fn(n, 1, |_, _| self.random.symmetric());
                self.project_out(&mut fresh);
                block.as_mut().col_mut(j).copy_from(fresh.col(0));
                part_from_earlier(&mut block, j, |_, _| ());
                let length = norm(&block, j).max(f64::MIN_POSITIVE);
                divide(&mut block, j, length);
            }
        }
        // A column that lost many digits inside the block may have turned back towards the space.
        let removed = self.project_out_once(&mut block).norm_max();
        debug_assert!(removed < 1e-2);
        if removed > 1e-8 {
            self.project_out_once(&mut block);
        }
        for j in 0..BLOCK_COLUMNS {
            let length = norm(&block, j).max(f64::MIN_POSITIVE);
            divide(&mut block, j, length);
        }
        ResidualBlock { directions: block, coupling }
    }

    /// Rayleigh–Ritz. The residual of a pair is the coupling times the last entries of its coefficients.
    fn ritz(&self, coupling: &Mat<f64>, count: usize) -> Option<Ritz> {
        let size = self.filled;
        let (ascending, vectors) = dense_eigenpairs(self.projected.as_ref().submatrix(0, 0, size, size))?;
        let coefficients = Mat::from_fn(size, size, |i, j| vectors[(i, size - 1 - j)]);
        let values: Vec<f64> = ascending.into_iter().rev().collect();
        let tail = coefficients.as_ref().submatrix(size - BLOCK_COLUMNS, 0, BLOCK_COLUMNS, count);
        let residuals = coupling * tail;
        let largest_residual =
            (0..count).map(|j| norm(&residuals, j) / values[j].max(f64::MIN_POSITIVE)).fold(0.0, f64::max);
        Some(Ritz { values, coefficients, residuals, largest_residual })
    }

    /// The first `count` Ritz vectors.
    fn combine(&self, ritz: &Ritz, count: usize) -> Mat<f64> {
        let mut vectors = Mat::zeros(self.basis.nrows(), count);
        matmul(
            vectors.as_mut(),
            Accum::Replace,
            self.basis.as_ref().subcols(0, self.filled),
            ritz.coefficients.as_ref().subcols(0, count),
            1.0,
            Par::Seq,
        );
        vectors
    }

    /// The first `count` Ritz vectors after one more application of the operator, `(C + σI)⁻¹ y / θ`, which the residual gives
    /// without a solve. Vertices of almost no mass hardly count in the norm that the tolerance bounds; this step sets them
    /// right. The change is orthogonal to the space and as small as the residual, so orthonormality survives.
    fn refined(&self, ritz: &Ritz, rest: &ResidualBlock, count: usize) -> Mat<f64> {
        let mut vectors = self.combine(ritz, count);
        let correction = Mat::from_fn(BLOCK_COLUMNS, count, |i, j| ritz.residuals[(i, j)] / ritz.values[j]);
        matmul(vectors.as_mut(), Accum::Add, rest.directions.as_ref(), correction.as_ref(), 1.0, Par::Seq);
        vectors
    }

    /// Shrinks the space to its best `kept` Ritz vectors.
    fn restart(&mut self, ritz: &Ritz, kept: usize) {
        let vectors = self.combine(ritz, kept);
        self.basis.as_mut().subcols_mut(0, kept).copy_from(&vectors);
        self.projected.fill(0.0);
        for j in 0..kept {
            self.projected[(j, j)] = ritz.values[j];
        }
        self.filled = kept;
    }
}

fn norm(matrix: &Mat<f64>, j: usize) -> f64 {
    matrix.col_as_slice(j).iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Makes column `j` orthogonal to the earlier ones, twice, and reports how much of each was in it.
fn part_from_earlier(block: &mut Mat<f64>, j: usize, mut removed: impl FnMut(usize, f64)) {
    for _ in 0..2 {
        for i in 0..j {
            let earlier = block.col_as_slice(i).to_vec();
            let column = block.col_as_slice_mut(j);
            let overlap: f64 = earlier.iter().zip(&*column).map(|(a, b)| a * b).sum();
            removed(i, overlap);
            column.iter_mut().zip(&earlier).for_each(|(value, other)| *value -= overlap * other);
        }
    }
}

fn divide(matrix: &mut Mat<f64>, j: usize, divisor: f64) {
    for value in matrix.col_as_slice_mut(j) {
        *value /= divisor;
    }
}
