//! Products of blocks that stay in a core's caches: a tile of the result is kept in registers while all terms are added.
//!
//! The same source is compiled for every instruction set, with tiles that fill its registers. An element of the result is
//! the sum of its terms in their order, whatever tile it lies in: how a matrix is cut into blocks changes no bit.

use std::ops::Range;

use pulp::{Scalar128b, Simd};

use super::host::vectorised;

/// First element, row and column step of a matrix in memory.
#[derive(Clone, Copy)]
pub(super) struct StridedMatrix {
    pub(super) first: *const f32,
    pub(super) row_stride: isize,
    pub(super) column_stride: isize,
}

// SAFETY: only read, and whoever makes one outlives every use.
unsafe impl Send for StridedMatrix {}
unsafe impl Sync for StridedMatrix {}

impl StridedMatrix {
    /// A matrix whose rows lie one after another.
    pub(super) fn of_rows(values: &[f32], columns: usize) -> Self {
        Self { first: values.as_ptr(), row_stride: columns as isize, column_stride: 1 }
    }

    /// The matrix from row `row` and column `column` on.
    pub(super) fn from(self, row: usize, column: usize) -> Self {
        let offset = row as isize * self.row_stride + column as isize * self.column_stride;
        Self { first: self.first.wrapping_offset(offset), ..self }
    }

    pub(super) fn transposed(self) -> Self {
        Self { row_stride: self.column_stride, column_stride: self.row_stride, ..self }
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
    /// A matrix whose rows lie one after another.
    pub(super) fn of_rows(values: &mut [f32], columns: usize) -> Self {
        Self { first: values.as_mut_ptr(), row_stride: columns }
    }

    /// The block from row `row` and column `column` on.
    pub(super) fn from(self, row: usize, column: usize) -> Self {
        Self { first: self.first.wrapping_add(row * self.row_stride + column), ..self }
    }
}

/// The instruction sets that blocks are compiled for.
#[derive(Clone, Copy)]
enum InstructionSet {
    #[cfg(target_arch = "x86_64")]
    Avx512(pulp::x86::V4),
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    Baseline(Scalar128b),
}

impl InstructionSet {
    #[inline]
    fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V4::try_new() {
            return Self::Avx512(simd);
        } else if let Some(simd) = pulp::x86::V3::try_new() {
            return Self::Avx2(simd);
        }
        Self::Baseline(Scalar128b)
    }

    /// Elements of a vector.
    fn lanes(self) -> usize {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => 16,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => 8,
            Self::Baseline(_) => 4,
        }
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
    /// Becomes a matrix of `[inner, columns]` elements, in the memory it has.
    ///
    /// # Safety
    /// `matrix` has that size.
    pub(super) unsafe fn fill(&mut self, matrix: StridedMatrix, [inner, columns]: [usize; 2]) {
        let lanes = InstructionSet::detect().lanes();
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
                    // SAFETY: the panel lies in the matrix; its memory has been reserved and is written.
                    unsafe {
                        let start = self.values.len();
                        let panel = self.values.as_mut_ptr().add(start);
                        write_panel(panel, matrix.from(0, at), inner, wanted, width);
                        self.values.set_len(start + inner * width);
                    }
                    at += wanted;
                }
            },
        );
    }

    /// `output = lhs·(rows `terms` of the right factor)`, plus what `output` holds if `add`.
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
        assert!(terms.end <= self.inner, "terms of a product beyond its right factor");
        let turned = lhs.column_stride != 1;
        assert!(!turned || lhs.row_stride == 1, "neither rows nor columns of a left factor are contiguous");
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
        lhs: StridedMatrix,
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

/// Writes `[inner, columns]` elements, every row filled up with zeros to `width`.
///
/// # Safety
/// `matrix` has that size, `panel` is memory for `[inner, width]`.
#[inline(always)]
unsafe fn write_panel(panel: *mut f32, matrix: StridedMatrix, inner: usize, columns: usize, width: usize) {
    // SAFETY (all): elements of matrix and panel.
    unsafe {
        if matrix.column_stride == 1 {
            match (columns == width, width) {
                (true, 32) => return copy_rows::<32>(panel, matrix, inner),
                (true, 16) => return copy_rows::<16>(panel, matrix, inner),
                (true, 8) => return copy_rows::<8>(panel, matrix, inner),
                _ => {}
            }
        }
        if columns < width {
            std::ptr::write_bytes(panel, 0, inner * width);
        }
        // So many terms that what is written stays in the first cache.
        for start in (0..inner).step_by(64) {
            for column in 0..columns {
                let from = matrix.from(start, column).first;
                let panel = panel.add(start * width + column);
                for row in 0..64.min(inner - start) {
                    panel.add(row * width).write(*from.offset(row as isize * matrix.row_stride));
                }
            }
        }
    }
}

/// Rows of a known length, which are moved without a call.
#[inline(always)]
unsafe fn copy_rows<const C: usize>(panel: *mut f32, matrix: StridedMatrix, rows: usize) {
    for row in 0..rows {
        // SAFETY: rows of matrix and panel.
        unsafe {
            let values = matrix.from(row, 0).first.cast::<[f32; C]>().read_unaligned();
            panel.add(row * C).cast::<[f32; C]>().write_unaligned(values);
        }
    }
}

/// The product with one panel of V vectors, tile by tile.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
unsafe fn strip<S: Simd, const R: usize, const V: usize, const TURNED: bool>(
    simd: S,
    lhs: StridedMatrix,
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
            let (lhs, output) = (lhs.from(row, 0), output.from(row, 0));
            tile::<S, R, V, TURNED>(simd, lhs, rhs, inner, output, columns, add);
            row += R;
        }
        while row + 4 <= rows {
            let (lhs, output) = (lhs.from(row, 0), output.from(row, 0));
            tile::<S, 4, V, TURNED>(simd, lhs, rhs, inner, output, columns, add);
            row += 4;
        }
        while row < rows {
            let (lhs, output) = (lhs.from(row, 0), output.from(row, 0));
            tile::<S, 1, V, TURNED>(simd, lhs, rhs, inner, output, columns, add);
            row += 1;
        }
    }
}

/// R rows times a panel of V vectors, of whose columns as many as `columns` are wanted.
#[inline(always)]
unsafe fn tile<S: Simd, const R: usize, const V: usize, const TURNED: bool>(
    simd: S,
    lhs: StridedMatrix,
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
                    true => *lhs.first.offset(term as isize * lhs.column_stride).add(row),
                    false => *lhs.first.offset(row as isize * lhs.row_stride).add(term),
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
