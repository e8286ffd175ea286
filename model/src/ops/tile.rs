//! Products of blocks that stay in a core's caches: a tile of the result is kept in registers while all terms are added.
//!
//! The same source is compiled for every instruction set, with tiles that fill its registers. An element of the result is
//! the sum of its terms in their order, whatever tile it lies in: how a matrix is cut into blocks changes no bit.

use std::mem::MaybeUninit;
use std::ops::Range;

use pulp::Simd;

use super::instruction_set::{InstructionSet, vectorised};
use super::matrix_view::MatrixView;

/// The left factor of a tile: first element, steps to the next row and term.
#[derive(Clone, Copy)]
struct LeftFactor {
    first: *const f32,
    row_stride: usize,
    term_stride: usize,
}

impl LeftFactor {
    fn rows_from(self, row: usize) -> Self {
        Self { first: self.first.wrapping_add(row * self.row_stride), ..self }
    }
}

/// A matrix to be written, whose rows are contiguous.
#[derive(Clone, Copy)]
pub(super) struct OutputBlock {
    pub(super) first: *mut f32,
    pub(super) row_stride: usize,
}

// SAFETY: whoever makes one keeps its writers apart.
unsafe impl Send for OutputBlock {}
unsafe impl Sync for OutputBlock {}

impl OutputBlock {
    /// The block from row `row` and column `column` on.
    pub(super) fn from(self, row: usize, column: usize) -> Self {
        Self { first: self.first.wrapping_add(row * self.row_stride + column), ..self }
    }
}

/// The right factor of a product, its columns in panels of two vectors (the last one of one, if that is enough) that lie one
/// after another.
#[derive(Default)]
pub(super) struct RightFactor {
    values: Vec<f32>,
    inner: usize,
    columns: usize,
}

impl RightFactor {
    pub(super) fn new(matrix: MatrixView<'_>) -> Self {
        let mut factor = Self::default();
        factor.fill(matrix);
        factor
    }

    /// Becomes another matrix, in the memory it has.
    pub(super) fn fill(&mut self, matrix: MatrixView<'_>) {
        let lanes = InstructionSet::detect().lanes();
        let (inner, columns) = (matrix.rows(), matrix.columns());
        (self.inner, self.columns) = (inner, columns);
        self.values.clear();
        self.values.reserve(inner * columns.next_multiple_of(lanes));
        vectorised(
            #[inline(always)]
            || {
                let mut at = 0;
                while at < columns {
                    let wanted = (columns - at).min(2 * lanes);
                    let width = wanted.next_multiple_of(lanes);
                    // SAFETY: the panel's memory has been reserved and is written.
                    unsafe {
                        let start = self.values.len();
                        let panel = self.values.as_mut_ptr().add(start);
                        write_panel(panel, matrix.block(0..inner, at..at + wanted), width);
                        self.values.set_len(start + inner * width);
                    }
                    at += wanted;
                }
            },
        );
    }

    /// Writes `lhs·self` row after row, and returns it.
    ///
    /// # Panics
    /// If sizes disagree.
    pub(super) fn product<'o>(
        &self,
        lhs: MatrixView<'_>,
        output: &'o mut [MaybeUninit<f32>],
    ) -> &'o mut [f32] {
        assert_eq!(output.len(), lhs.rows() * self.columns, "the output of a product has another size");
        let block = OutputBlock { first: output.as_mut_ptr().cast(), row_stride: self.columns };
        // SAFETY: the output has the size of the product, and all of it is written.
        unsafe {
            self.multiply(lhs, 0..self.inner, block, false);
            output.assume_init_mut()
        }
    }

    /// Writes `lhs·self` row after row over what `output` holds.
    ///
    /// # Panics
    /// If sizes disagree.
    pub(super) fn overwrite(&self, lhs: MatrixView<'_>, output: &mut [f32]) {
        self.write(lhs, output, false);
    }

    /// Adds `lhs·self`.
    ///
    /// # Panics
    /// If sizes disagree.
    pub(super) fn add_product(&self, lhs: MatrixView<'_>, sum: &mut [f32]) {
        self.write(lhs, sum, true);
    }

    fn write(&self, lhs: MatrixView<'_>, output: &mut [f32], add: bool) {
        assert_eq!(output.len(), lhs.rows() * self.columns, "the output of a product has another size");
        let block = OutputBlock { first: output.as_mut_ptr(), row_stride: self.columns };
        // SAFETY: the output has the size of the product.
        unsafe { self.multiply(lhs, 0..self.inner, block, add) };
    }

    /// `output = lhs·(rows `terms` of the right factor)`, plus what `output` holds if `add`.
    ///
    /// # Panics
    /// If the inner sizes differ, or neither rows nor columns of `lhs` are contiguous.
    ///
    /// # Safety
    /// `output` has as many rows as `lhs` and the columns of the right factor, is initialised if `add`, and nobody else uses it.
    pub(super) unsafe fn multiply(
        &self,
        lhs: MatrixView<'_>,
        terms: Range<usize>,
        output: OutputBlock,
        add: bool,
    ) {
        assert!(terms.end <= self.inner, "terms of a product beyond its right factor");
        let rows = lhs.rows();
        assert_eq!(lhs.columns(), terms.len(), "the inner sizes of a product differ");
        let [row_stride, term_stride] = lhs.strides();
        let lhs = LeftFactor { first: lhs.as_ptr(), row_stride, term_stride };
        let turned = term_stride != 1;
        assert!(
            !turned || row_stride == 1 || rows == 1,
            "neither rows nor columns of a left factor are contiguous"
        );
        macro_rules! block {
            ($simd:expr, $rows:literal) => {
                match turned {
                    true => self.block::<_, $rows, true>($simd, lhs, rows, terms, output, add),
                    false => self.block::<_, $rows, false>($simd, lhs, rows, terms, output, add),
                }
            };
        }
        // SAFETY: promised.
        unsafe {
            match InstructionSet::detect() {
                #[cfg(target_arch = "x86_64")]
                InstructionSet::Avx512(simd) => simd.vectorize(
                    #[inline(always)]
                    || block!(simd, 12),
                ),
                #[cfg(target_arch = "x86_64")]
                InstructionSet::Avx2(simd) => simd.vectorize(
                    #[inline(always)]
                    || block!(simd, 6),
                ),
                InstructionSet::Baseline(simd) => block!(simd, 4),
            }
        }
    }

    #[inline(always)]
    unsafe fn block<S: Simd, const R: usize, const TURNED: bool>(
        &self,
        simd: S,
        lhs: LeftFactor,
        rows: usize,
        terms: Range<usize>,
        output: OutputBlock,
        add: bool,
    ) {
        let mut at = 0;
        while at < self.columns {
            let columns = (self.columns - at).min(2 * S::F32_LANES);
            let (panel, output) = (at * self.inner, output.from(0, at));
            // SAFETY: the panel's rows `terms` lie in `values`; the rest is promised.
            unsafe {
                if columns <= S::F32_LANES {
                    let rhs = self.values.as_ptr().add(panel + terms.start * S::F32_LANES);
                    strip::<S, R, 1, TURNED>(simd, lhs, rows, rhs, terms.len(), output, columns, add);
                } else {
                    let rhs = self.values.as_ptr().add(panel + terms.start * 2 * S::F32_LANES);
                    strip::<S, R, 2, TURNED>(simd, lhs, rows, rhs, terms.len(), output, columns, add);
                }
            }
            at += columns;
        }
    }
}

/// Writes a matrix row after row, every one filled up with zeros to `width`.
///
/// # Safety
/// `panel` is memory for as many rows of `width` elements.
#[inline(always)]
unsafe fn write_panel(panel: *mut f32, matrix: MatrixView<'_>, width: usize) {
    let (inner, columns, [row_stride, column_stride]) = (matrix.rows(), matrix.columns(), matrix.strides());
    let first = matrix.as_ptr();
    // SAFETY (all): elements of matrix and panel.
    unsafe {
        if column_stride == 1 {
            match (columns == width, width) {
                (true, 32) => return copy_rows::<32>(panel, first, row_stride, inner),
                (true, 16) => return copy_rows::<16>(panel, first, row_stride, inner),
                (true, 8) => return copy_rows::<8>(panel, first, row_stride, inner),
                _ => {}
            }
        }
        if columns < width {
            std::ptr::write_bytes(panel, 0, inner * width);
        }
        // So many terms that what is written stays in the first cache.
        for start in (0..inner).step_by(64) {
            for column in 0..columns {
                let from = first.add(start * row_stride + column * column_stride);
                let panel = panel.add(start * width + column);
                for row in 0..64.min(inner - start) {
                    panel.add(row * width).write(*from.add(row * row_stride));
                }
            }
        }
    }
}

/// Rows of a known length, which are moved without a call.
#[inline(always)]
unsafe fn copy_rows<const C: usize>(panel: *mut f32, first: *const f32, row_stride: usize, rows: usize) {
    for row in 0..rows {
        // SAFETY: rows of matrix and panel.
        unsafe {
            let values = first.add(row * row_stride).cast::<[f32; C]>().read_unaligned();
            panel.add(row * C).cast::<[f32; C]>().write_unaligned(values);
        }
    }
}

/// The product with one panel of V vectors, tile by tile.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
unsafe fn strip<S: Simd, const R: usize, const V: usize, const TURNED: bool>(
    simd: S,
    lhs: LeftFactor,
    rows: usize,
    rhs: *const f32,
    inner: usize,
    output: OutputBlock,
    columns: usize,
    add: bool,
) {
    let mut row = 0;
    // SAFETY: rows below `rows`.
    unsafe {
        while row + R <= rows {
            let (lhs, output) = (lhs.rows_from(row), output.from(row, 0));
            tile::<S, R, V, TURNED>(simd, lhs, rhs, inner, output, columns, add);
            row += R;
        }
        while row + 4 <= rows {
            let (lhs, output) = (lhs.rows_from(row), output.from(row, 0));
            tile::<S, 4, V, TURNED>(simd, lhs, rhs, inner, output, columns, add);
            row += 4;
        }
        while row < rows {
            let (lhs, output) = (lhs.rows_from(row), output.from(row, 0));
            tile::<S, 1, V, TURNED>(simd, lhs, rhs, inner, output, columns, add);
            row += 1;
        }
    }
}

/// R rows times a panel of V vectors, of whose columns as many as `columns` are wanted.
#[inline(always)]
unsafe fn tile<S: Simd, const R: usize, const V: usize, const TURNED: bool>(
    simd: S,
    lhs: LeftFactor,
    rhs: *const f32,
    inner: usize,
    output: OutputBlock,
    columns: usize,
    add: bool,
) {
    let mut sums = [[simd.splat_f32s(0.0); V]; R];
    let rhs = rhs.cast::<S::f32s>();
    for term in 0..inner {
        let mut right = [simd.splat_f32s(0.0); V];
        for vector in 0..V {
            // SAFETY: in row `term` of the panel.
            right[vector] = unsafe { rhs.add(term * V + vector).read_unaligned() };
        }
        for row in 0..R {
            // SAFETY: an element of the left factor.
            let left = simd.splat_f32s(unsafe {
                match TURNED {
                    true => *lhs.first.add(term * lhs.term_stride + row),
                    false => *lhs.first.add(row * lhs.row_stride + term),
                }
            });
            for vector in 0..V {
                sums[row][vector] = simd.mul_add_e_f32s(left, right[vector], sums[row][vector]);
            }
        }
    }
    for row in 0..R {
        let output = output.from(row, 0).first;
        // SAFETY: `columns` elements of a row of the output, initialised if they are read.
        unsafe {
            if columns == V * S::F32_LANES {
                let output = output.cast::<S::f32s>();
                for vector in 0..V {
                    let mut sum = sums[row][vector];
                    if add {
                        sum = simd.add_f32s(output.add(vector).read_unaligned(), sum);
                    }
                    output.add(vector).write_unaligned(sum);
                }
            } else {
                let sums = sums[row];
                let sums = std::slice::from_raw_parts(sums.as_ptr().cast::<f32>(), columns);
                for (column, sum) in sums.iter().enumerate() {
                    let output = output.add(column);
                    output.write(if add { *output + sum } else { *sum });
                }
            }
        }
    }
}
