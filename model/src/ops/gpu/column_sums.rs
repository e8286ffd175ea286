//! Sums over the rows of a matrix, in a fixed order.

use std::ops::Range;

use burn_cubecl::cubecl;
use cubecl::prelude::*;

use super::matrix::{Matrix, UNITS};

/// Columns (of whole vectors) that one group works on at a time.
const GROUP_COLUMNS: usize = 32;
/// Rows that one group works on at a time: how far those of a unit are apart.
pub(super) const UNIT_ROW_STEP: usize = UNITS as usize / GROUP_COLUMNS;

/// Rows whose sum one group makes.
pub(super) const ROWS_PER_SUM: usize = 256;

/// Groups for the blocks of `rows` rows of `vectors` vectors each.
pub(super) fn blocks(rows: usize, vectors: usize) -> (CubeCount, CubeDim) {
    let count =
        CubeCount::Static(vectors.div_ceil(GROUP_COLUMNS) as u32, rows.div_ceil(ROWS_PER_SUM) as u32, 1);
    (count, CubeDim::new_1d(UNITS))
}

/// Which column of vectors this unit works on.
#[cube]
pub(super) fn column() -> usize {
    CUBE_POS_X as usize * GROUP_COLUMNS + UNIT_POS as usize % GROUP_COLUMNS
}

/// The first row of this unit in a matrix that starts at row `start`; it takes every [`UNIT_ROW_STEP`]th from there.
#[cube]
pub(super) fn first_row(start: usize) -> usize {
    start + CUBE_POS_Y as usize * ROWS_PER_SUM + UNIT_POS as usize / GROUP_COLUMNS
}

/// One past the last row of this group.
#[cube]
pub(super) fn end_row(start: usize, end: usize) -> usize {
    let block_end = start + (CUBE_POS_Y as usize + 1) * ROWS_PER_SUM;
    select(block_end < end, block_end, end)
}

/// Adds up what the units of a group found, and writes it to the block's row of `partial`.
#[cube]
pub(super) fn write_block<N: Size>(sum: Vector<f32, N>, partial: &mut [Vector<f32, N>], vectors: usize) {
    let mut sums = Shared::<[Vector<f32, N>]>::new_slice(comptime!(UNITS as usize));
    sums[UNIT_POS as usize] = sum;
    sync_cube();
    if UNIT_POS < GROUP_COLUMNS as u32 {
        let mut total = sum;
        #[unroll]
        for row in 1..UNIT_ROW_STEP {
            total += sums[row * GROUP_COLUMNS + UNIT_POS as usize];
        }
        if column() < vectors {
            partial[CUBE_POS_Y as usize * vectors + column()] = total;
        }
    }
}

#[cube(launch_unchecked)]
fn column_sums<N: Size>(
    matrix: &[Vector<f32, N>],
    partial: &mut [Vector<f32, N>],
    start: usize,
    end: usize,
    vectors: usize,
) {
    let mut sum = Vector::<f32, N>::new(0.0);
    if column() < vectors {
        let mut row = first_row(start);
        let end = end_row(start, end);
        while row < end {
            sum += matrix[row * vectors + column()];
            row += UNIT_ROW_STEP;
        }
    }
    write_block::<N>(sum, partial, vectors);
}

/// The sum `[1,C]` of all rows of a matrix `[R,C]`.
///
/// # Panics
/// If there are no rows.
pub(super) fn total(matrix: Matrix) -> Matrix {
    match matrix.rows {
        1 => matrix,
        rows => total_of(&matrix, 0..rows),
    }
}

/// The sum `[1,C]` of some rows of a matrix `[R,C]`.
///
/// # Panics
/// If there are no rows.
pub(super) fn total_of(matrix: &Matrix, rows: Range<usize>) -> Matrix {
    assert!(!rows.is_empty(), "a sum of no rows");
    let width = matrix.width();
    let partial = matrix.empty(rows.len().div_ceil(ROWS_PER_SUM), matrix.columns);
    let (count, dim) = blocks(rows.len(), matrix.columns / width);
    // SAFETY: units beyond the last column or row read and write nothing.
    unsafe {
        column_sums::launch_unchecked(
            matrix.client(),
            count,
            dim,
            width,
            matrix.argument(width),
            partial.argument(width),
            rows.start,
            rows.end,
            matrix.columns / width,
        );
    }
    total(partial)
}
