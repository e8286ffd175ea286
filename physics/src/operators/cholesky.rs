//! Sparse Cholesky factorisation of a symmetric positive definite matrix, single-threaded.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{
    LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

use crate::operators::SparseMatrix;

/// `A = P L Lᵀ Pᵀ` with a fill-reducing ordering.
///
/// One thread only: garments are prepared side by side, and results must not depend on how many threads there are.
pub(super) struct Cholesky {
    symbolic: SymbolicCholesky<u32>,
    values: Vec<f64>,
}

impl Cholesky {
    /// Factorises; `None` if the matrix is not positive definite in floating point, or memory ran out.
    pub fn new(matrix: &SparseMatrix) -> Option<Self> {
        let n = matrix.rows();
        // Symmetric: compressed rows are compressed columns.
        let structure =
            SymbolicSparseColMatRef::new_checked(n, n, matrix.offsets(), None, matrix.column_indices());
        let symbolic =
            factorize_symbolic_cholesky(structure, Side::Lower, SymmetricOrdering::Amd, Default::default())
                .ok()?;
        let mut values = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).ok()?;
        symbolic
            .factorize_numeric_llt(
                &mut values,
                SparseColMatRef::new(structure, matrix.values()),
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .ok()?;
        values.iter().all(|v| v.is_finite()).then_some(Self { symbolic, values })
    }

    /// Solves for every column of `rhs` `[n, m]` in place.
    pub fn solve_in_place(&self, rhs: MatMut<'_, f64>) {
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(rhs.ncols(), Par::Seq);
        let mut memory = MemBuffer::new(scratch);
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            rhs,
            Par::Seq,
            MemStack::new(&mut memory),
        );
    }
}
