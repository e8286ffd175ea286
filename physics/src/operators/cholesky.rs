//! Sparse Cholesky factorisation of a symmetric positive definite matrix, single-threaded.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{
    LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

use crate::operators::SparseMatrix;
use crate::rows::CompressedRows;

/// `A = P L Lᵀ Pᵀ` with a fill-reducing ordering.
///
/// Of the matrix only the entries on and above its diagonal are read; it may be without the others.
///
/// One thread only: garments are prepared side by side, and results must not depend on how many threads there are.
pub(crate) struct Cholesky {
    symbolic: SymbolicCholesky<u32>,
    values: Vec<f64>,
}

impl Cholesky {
    /// Factorises; `None` if the matrix is not positive definite in floating point, or memory ran out.
    pub fn new(matrix: &SparseMatrix) -> Option<Self> {
        let mut cholesky = Self::analysed(matrix)?;
        cholesky.factorise(matrix).then_some(cholesky)
    }

    /// Chooses the ordering for matrices with the entries of `matrix`, whatever their values, and factorises none yet;
    /// `None` if memory ran out.
    fn analysed(matrix: &SparseMatrix) -> Option<Self> {
        Self::ordered(matrix, SymmetricOrdering::Amd)
    }

    /// The same for a matrix of dense 3×3 `blocks`, given by those on and right of the diagonal: the ordering is that of a
    /// graph with a ninth of the edges.
    pub fn analysed_in_blocks(matrix: &SparseMatrix, blocks: &CompressedRows<u32>) -> Option<Self> {
        let n = blocks.len();
        let graph = SymbolicSparseColMatRef::new_checked(n, n, blocks.offsets(), None, blocks.items());
        let scratch = amd::order_maybe_unsorted_scratch::<u32>(n, blocks.items().len());
        let mut memory = MemBuffer::try_new(scratch).ok()?;
        let [mut forward, mut inverse] = [vec![0; n], vec![0; n]];
        let stack = MemStack::new(&mut memory);
        amd::order_maybe_unsorted(&mut forward, &mut inverse, graph, Default::default(), stack).ok()?;
        let [forward, inverse] = [forward, inverse]
            .map(|order| -> Vec<u32> { order.iter().flat_map(|v| [3 * v, 3 * v + 1, 3 * v + 2]).collect() });
        let ordering = PermRef::new_checked(&forward, &inverse, 3 * n);
        Self::ordered(matrix, SymmetricOrdering::Custom(ordering))
    }

    fn ordered(matrix: &SparseMatrix, ordering: SymmetricOrdering<'_, u32>) -> Option<Self> {
        let symbolic =
            factorize_symbolic_cholesky(structure(matrix), Side::Lower, ordering, Default::default()).ok()?;
        let values = vec![0.0; symbolic.len_val()];
        Some(Self { symbolic, values })
    }

    /// Factorises a matrix whose entries are where those of the analysed one are. `false` if it is not positive definite
    /// in floating point, or memory ran out: then there is nothing to solve with until a later call succeeds.
    pub fn factorise(&mut self, matrix: &SparseMatrix) -> bool {
        let scratch = self.symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let Ok(mut memory) = MemBuffer::try_new(scratch) else { return false };
        let done = self.symbolic.factorize_numeric_llt(
            &mut self.values,
            SparseColMatRef::new(structure(matrix), matrix.values()),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        done.is_ok() && self.values.iter().all(|v| v.is_finite())
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

/// Symmetric: compressed rows are compressed columns.
fn structure(matrix: &SparseMatrix) -> SymbolicSparseColMatRef<'_, u32> {
    let n = matrix.rows();
    SymbolicSparseColMatRef::new_checked(n, n, matrix.offsets(), None, matrix.column_indices())
}
