//! A matrix in host memory, to be read.

use std::ops::Range;

/// Read access to a matrix whose rows, or columns, are contiguous.
#[derive(Clone, Copy)]
pub(super) struct MatrixView<'a> {
    values: &'a [f32],
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

impl<'a> MatrixView<'a> {
    /// A matrix whose first element is that of `values`.
    ///
    /// # Panics
    /// If the strides lead beyond `values`.
    pub(super) fn new(
        values: &'a [f32],
        [rows, columns]: [usize; 2],
        [row_stride, column_stride]: [usize; 2],
    ) -> Self {
        // One column is contiguous, whatever step leads to the next one.
        let column_stride = if columns < 2 { 1 } else { column_stride };
        let last = |count: usize, stride| count.saturating_sub(1) * stride;
        let last = last(rows, row_stride) + last(columns, column_stride);
        assert!(rows * columns == 0 || last < values.len(), "a matrix beyond its memory");
        Self { values, rows, columns, row_stride, column_stride }
    }

    /// A matrix whose rows lie one after another.
    pub(super) fn of_rows(values: &'a [f32], columns: usize) -> Self {
        Self::new(values, [values.len() / columns.max(1), columns], [columns, 1])
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    /// Steps to the next row and to the next column.
    pub(super) fn strides(&self) -> [usize; 2] {
        [self.row_stride, self.column_stride]
    }

    /// The first element.
    pub(super) fn as_ptr(&self) -> *const f32 {
        self.values.as_ptr()
    }

    /// One row of a matrix whose rows are contiguous.
    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> &'a [f32] {
        debug_assert!(self.column_stride == 1 || self.columns < 2, "a row that is not contiguous");
        &self.values[row * self.row_stride..row * self.row_stride + self.columns]
    }

    /// All elements of a matrix whose rows lie one after another.
    pub(super) fn elements(&self) -> &'a [f32] {
        assert_eq!(self.strides(), [self.columns, 1], "rows with gaps between them");
        &self.values[..self.rows * self.columns]
    }

    /// Some of the rows and columns.
    ///
    /// # Panics
    /// If there are no such rows or columns.
    pub(super) fn block(self, rows: Range<usize>, columns: Range<usize>) -> Self {
        assert!(rows.end <= self.rows && columns.end <= self.columns, "a block beyond its matrix");
        let first = rows.start * self.row_stride + columns.start * self.column_stride;
        let sizes = [rows.len(), columns.len()];
        Self::new(&self.values[first..], sizes, self.strides())
    }

    /// Some of the rows.
    pub(super) fn some_rows(self, rows: Range<usize>) -> Self {
        self.block(rows, 0..self.columns)
    }

    pub(super) fn transposed(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }
}
