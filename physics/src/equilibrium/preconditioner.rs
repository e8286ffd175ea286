//! The Cholesky factor of the approximate Hessian.

use faer::MatMut;

use super::Problem;
use crate::energy::CurvatureSink;
use crate::operators::SparseMatrix;
use crate::operators::cholesky::Cholesky;
use crate::rows::CompressedRows;

/// Multiple of the identity that is added, in units of the mean diagonal entry: what no term holds (a rigid motion, a fold
/// that opens) would be a step of any length otherwise.
const SHIFT: f64 = 1e-4;

/// Largest such multiple; a matrix that is not positive definite with it is not used at all.
const LARGEST_SHIFT: f64 = 1.0;

/// A sparse symmetric matrix of 3×3 blocks, and its factor.
pub(super) struct Preconditioner {
    /// The vertices that every vertex has a block with.
    blocks: CompressedRows<u32>,
    /// The same matrix over coordinates.
    matrix: SparseMatrix,
    factor: Option<Cholesky>,
    usable: bool,
    /// Successful factorisations.
    pub factorisations: usize,
}

impl Preconditioner {
    /// Finds out where entries are and orders them; nothing is factorised yet.
    pub fn new(problem: &Problem<'_>, posed: &[[f64; 3]]) -> Self {
        let count = problem.vertex_count();
        let mut pairs = Pairs(Vec::new());
        problem.curvature(posed, &mut pairs);
        let mut pairs = pairs.0;
        pairs.extend((0..count as u32).map(|v| [v, v]));
        pairs.sort_unstable();
        pairs.dedup();
        let keyed = pairs.iter().map(|[row, column]| (*row as usize, *column));
        let blocks = CompressedRows::grouped(count, keyed);
        let mut triplets = Vec::with_capacity(9 * pairs.len());
        for row in 0..count {
            for r in 0..3 {
                for &column in blocks.row(row) {
                    triplets.extend((0..3).map(|c| (3 * row as u32 + r, 3 * column + c, 0.0)));
                }
            }
        }
        let matrix = SparseMatrix::from_triplets(3 * count, 3 * count, triplets);
        let factor = Cholesky::analysed(&matrix);
        Self { blocks, matrix, factor, usable: false, factorisations: 0 }
    }

    /// Assembles and factorises at `posed`; for an outfit also finds anew which entries there are, since garments touch elsewhere
    /// than before. Where factorising fails (out of memory, numbers that are not finite) the identity is used: plain BFGS.
    pub fn refresh(&mut self, problem: &Problem<'_>, posed: &[[f64; 3]]) {
        if problem.couples_garments() {
            *self = Self { factorisations: self.factorisations, ..Self::new(problem, posed) };
        }
        self.matrix.values_mut().fill(0.0);
        problem.curvature(posed, &mut Blocks(self));
        self.usable = false;
        let rows = self.matrix.rows();
        let diagonal: Vec<usize> =
            (0..rows).map(|row| self.slot(row / 3, row / 3, row % 3) + row % 3).collect();
        let mean = diagonal.iter().map(|&at| self.matrix.values_mut()[at]).sum::<f64>() / rows.max(1) as f64;
        let Some(factor) = &mut self.factor else { return };
        if !(mean > 0.0 && mean.is_finite()) {
            return;
        }
        let (mut shift, mut added) = (SHIFT, 0.0);
        while shift <= LARGEST_SHIFT {
            let values = self.matrix.values_mut();
            for &at in &diagonal {
                values[at] += (shift - added) * mean;
            }
            if factor.factorise(&self.matrix) {
                self.usable = true;
                self.factorisations += 1;
                return;
            }
            added = shift;
            shift *= 10.0;
        }
    }

    /// The product with the inverse, in place.
    pub fn apply(&self, x: &mut [[f64; 3]]) {
        if let (Some(factor), true) = (&self.factor, self.usable) {
            let rows = self.matrix.rows();
            factor.solve_in_place(MatMut::from_column_major_slice_mut(x.as_flattened_mut(), rows, 1));
        }
    }

    /// Where row `r` of block `(row, column)` starts in the values, for a block that exists.
    fn slot(&self, row: usize, column: usize, r: usize) -> usize {
        self.try_slot(row, column, r).expect("the diagonal is part of the matrix")
    }

    fn try_slot(&self, row: usize, column: usize, r: usize) -> Option<usize> {
        let range = self.blocks.range(row);
        let at = self.blocks.row(row).binary_search(&(column as u32)).ok()?;
        Some(9 * range.start + 3 * (r * range.len() + at))
    }
}

/// Which pairs of vertices have a block.
struct Pairs(Vec<[u32; 2]>);

impl CurvatureSink for Pairs {
    fn add(&mut self, i: usize, j: usize, _: [[f64; 3]; 3]) {
        let (i, j) = (i as u32, j as u32);
        self.0.extend([[i, j], [j, i]]);
    }
}

/// Adds blocks to the matrix. Pairs that were not there at first are dropped, as the contract of the sink says.
struct Blocks<'a>(&'a mut Preconditioner);

impl CurvatureSink for Blocks<'_> {
    fn add(&mut self, i: usize, j: usize, block: [[f64; 3]; 3]) {
        for r in 0..3 {
            let Some(at) = self.0.try_slot(i, j, r) else { return };
            for c in 0..3 {
                self.0.matrix.values_mut()[at + c] += block[r][c];
            }
            if i != j {
                let Some(at) = self.0.try_slot(j, i, r) else { return };
                for c in 0..3 {
                    self.0.matrix.values_mut()[at + c] += block[c][r];
                }
            }
        }
    }
}
