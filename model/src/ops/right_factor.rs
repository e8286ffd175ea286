//! The right factor of matrix products in host memory, prepared once in the numbers that it is multiplied in.

use std::ops::Range;

#[cfg(target_arch = "x86_64")]
use super::bf16::PairPanels;
use super::precision::Precision;
use super::tile::{OutputBlock, Panels, StridedMatrix};

/// The right factor of a product.
#[derive(Default)]
pub(super) struct RightFactor {
    plain: Panels,
    #[cfg(target_arch = "x86_64")]
    pairs: PairPanels,
    rounds: bool,
}

impl RightFactor {
    /// Becomes a matrix of `[inner, columns]` elements, in the memory it has.
    ///
    /// # Safety
    /// `matrix` has that size.
    pub(super) unsafe fn fill(
        &mut self,
        matrix: StridedMatrix,
        [inner, columns]: [usize; 2],
        precision: Precision,
    ) {
        self.rounds = precision.rounds();
        // SAFETY (both): promised.
        #[cfg(target_arch = "x86_64")]
        if self.rounds {
            return unsafe { self.pairs.fill(matrix, inner, columns) };
        }
        unsafe { self.plain.fill(matrix, inner, columns) };
    }

    /// `output = lhs·(rows `terms` of the right factor)`, plus what `output` holds if `add`. The first of the terms is even.
    ///
    /// # Safety
    /// `lhs` has `[rows, terms.len()]` elements; `output` `[rows, columns]`, initialised if `add`, that nobody else uses.
    pub(super) unsafe fn multiply(
        &self,
        lhs: StridedMatrix,
        rows: usize,
        terms: Range<usize>,
        output: OutputBlock,
        add: bool,
    ) {
        // SAFETY (both): promised; what rounds is available.
        #[cfg(target_arch = "x86_64")]
        if self.rounds {
            return unsafe { self.pairs.multiply(lhs, rows, terms, output, add) };
        }
        unsafe { self.plain.multiply(lhs, rows, terms, output, add) };
    }
}
