//! Matrix products in host memory, written into memory that is not zeroed first and partitioned among threads by their shape:
//! tall ones (a row a vertex) by rows, small results of long sums (gradients of weights) by columns.

use std::mem::MaybeUninit;

use rayon::prelude::*;

use super::matrix_view::MatrixView;
use super::tile::{OutputBlock, RightFactor};

/// Multiplications and additions below which a second thread costs more than it saves.
const PARALLEL_FROM: usize = 192 * 192 * 192;
/// Rows that one task multiplies: with their terms they fit the second-level cache.
const ROWS_PER_TASK: usize = 96;
/// Terms that are added up at once: a panel of so many stays in the first two levels of cache.
const TERMS_PER_BLOCK: usize = 512;
/// The same where the left factor is copied too.
const TERMS_PER_COPY: usize = 192;

/// `lhs·rhs`, row by row.
pub(super) fn product(lhs: MatrixView<'_>, rhs: MatrixView<'_>) -> Vec<f32> {
    let count = lhs.rows() * rhs.columns();
    let mut values = Vec::with_capacity(count);
    // SAFETY: nothing is added; all elements of the product are written.
    unsafe {
        write(lhs, rhs, &mut values.spare_capacity_mut()[..count], false);
        values.set_len(count);
    }
    values
}

/// Adds `lhs·rhs` to `sum`, whose rows lie one after another.
pub(super) fn add_product(lhs: MatrixView<'_>, rhs: MatrixView<'_>, sum: &mut [f32]) {
    // SAFETY: the elements are initialised and stay so: only floats are written.
    unsafe { write(lhs, rhs, &mut *(std::ptr::from_mut(sum) as *mut [MaybeUninit<f32>]), true) };
}

/// `output = lhs·rhs`, plus what `output` holds if `add`; initialises all of it.
///
/// # Safety
/// `output` is initialised if `add`.
unsafe fn write(lhs: MatrixView<'_>, rhs: MatrixView<'_>, output: &mut [MaybeUninit<f32>], add: bool) {
    let [rows, inner, columns] = [lhs.rows(), lhs.columns(), rhs.columns()];
    assert_eq!(inner, rhs.rows(), "the inner sizes of a product differ");
    assert_eq!(output.len(), rows * columns, "the output of a product has another size");
    let work = rows.saturating_mul(inner).saturating_mul(columns);
    if work == 0 && !add {
        output.fill(MaybeUninit::new(0.0));
    }
    if work == 0 {
        return;
    }
    let output = OutputBlock { first: output.as_mut_ptr().cast(), row_stride: columns };
    let threads = if work < PARALLEL_FROM { 1 } else { rayon::current_num_threads() };
    // SAFETY: the output has the size of the product; the rest is the caller's promise.
    unsafe {
        match inner > 2 * rows && inner > TERMS_PER_COPY {
            true => write_long_sums(lhs, rhs, output, add, threads),
            false => write_rows(lhs, rhs, output, add, threads),
        }
    }
}

/// A result of many rows: the right factor is rearranged once, and every task multiplies a block of rows.
///
/// # Safety
/// `output` has the size of the product, and is initialised if `add`.
unsafe fn write_rows(
    lhs: MatrixView<'_>,
    rhs: MatrixView<'_>,
    output: OutputBlock,
    add: bool,
    threads: usize,
) {
    let right = RightFactor::new(rhs);
    let (rows, inner) = (lhs.rows(), lhs.columns());
    let block = |block: usize| {
        let first = block * ROWS_PER_TASK;
        let last = (first + ROWS_PER_TASK).min(rows);
        let output = output.from(first, 0);
        let mut copy = Vec::new();
        for start in (0..inner).step_by(TERMS_PER_BLOCK) {
            let terms = start..(start + TERMS_PER_BLOCK).min(inner);
            let lhs = along_rows(lhs.block(first..last, terms.clone()), &mut copy);
            // SAFETY: a block of the output; no other task has these rows.
            unsafe { right.multiply(lhs, terms, output, add || start > 0) };
        }
    };
    for_each(rows.div_ceil(ROWS_PER_TASK), threads, block);
}

/// A small result of long sums, the gradient of a weight matrix: every task computes a block of the result.
///
/// # Safety
/// As [`write_rows`].
unsafe fn write_long_sums(
    lhs: MatrixView<'_>,
    rhs: MatrixView<'_>,
    output: OutputBlock,
    add: bool,
    threads: usize,
) {
    let [rows, inner, columns] = [lhs.rows(), lhs.columns(), rhs.columns()];
    // As many blocks as threads, of whole tiles: how the result is cut changes no bit.
    let column_blocks = threads.min(columns.div_ceil(32));
    let row_blocks = (threads / column_blocks).clamp(1, rows.div_ceil(24));
    let (width, height) = (
        columns.div_ceil(column_blocks).next_multiple_of(32),
        rows.div_ceil(row_blocks).next_multiple_of(12),
    );
    let column_blocks = columns.div_ceil(width);
    let block = |block: usize| {
        let (row, column) = (block / column_blocks * height, block % column_blocks * width);
        let (row_end, column_end) = ((row + height).min(rows), (column + width).min(columns));
        let (mut right, mut copy) = (RightFactor::default(), Vec::new());
        for start in (0..inner).step_by(TERMS_PER_COPY) {
            let terms = start..(start + TERMS_PER_COPY).min(inner);
            right.fill(rhs.block(terms.clone(), column..column_end));
            for first in (row..row_end).step_by(ROWS_PER_TASK) {
                let last = (first + ROWS_PER_TASK).min(row_end);
                let lhs = along_rows(lhs.block(first..last, terms.clone()), &mut copy);
                // SAFETY: a block of the output; no other task has this part.
                unsafe { right.multiply(lhs, 0..terms.len(), output.from(first, column), add || start > 0) };
            }
        }
    };
    for_each(rows.div_ceil(height) * column_blocks, threads, block);
}

/// A block whose elements lie close together: itself, or a copy if its columns are contiguous instead of its rows.
fn along_rows<'a>(block: MatrixView<'a>, copy: &'a mut Vec<f32>) -> MatrixView<'a> {
    let [row_stride, column_stride] = block.strides();
    if column_stride == 1 || block.rows() == 1 {
        return block;
    }
    assert_eq!(row_stride, 1, "neither rows nor columns of a left factor are contiguous");
    copy.clear();
    let columns = block.transposed();
    (0..columns.rows()).for_each(|column| copy.extend_from_slice(columns.row(column)));
    MatrixView::of_rows(copy, block.rows()).transposed()
}

fn for_each(tasks: usize, threads: usize, run: impl Fn(usize) + Send + Sync) {
    match threads {
        1 => (0..tasks).for_each(run),
        _ => (0..tasks).into_par_iter().for_each(run),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows, terms, columns: small, tall, long sums, both wide; sizes that no block divides, and several blocks of terms.
    const SIZES: [[usize; 3]; 10] = [
        [7, 5, 3],
        [1931, 97, 65],
        [65, 4099, 33],
        [257, 2051, 40],
        [300, 301, 299],
        [33, 2500, 300],
        [300, 1027, 33],
        [40, 31, 32],
        [41, 48, 17],
        [1, 16, 16],
    ];

    fn values(count: usize, seed: u64) -> Vec<f32> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1 << 24) as f32 - 0.5
        };
        (0..count).map(|_| next()).collect()
    }

    #[test]
    fn every_partition_matches_sums_in_double_precision_for_any_number_of_threads() {
        for [rows, inner, columns] in SIZES {
            let (a, b, c) = (values(rows * inner, 1), values(inner * columns, 2), values(rows * columns, 3));
            let (lhs, rhs) = (MatrixView::of_rows(&a, inner), MatrixView::of_rows(&b, columns));
            // The left factor of a weight's gradient is a transposed view.
            let turned: Vec<f32> = (0..inner * rows).map(|i| a[(i % rows) * inner + i / rows]).collect();
            let turned = MatrixView::of_rows(&turned, rows).transposed();
            // The right one of the gradient of a factor is too.
            let turned_rhs: Vec<f32> =
                (0..inner * columns).map(|i| b[(i % inner) * columns + i / inner]).collect();
            let turned_rhs = MatrixView::of_rows(&turned_rhs, inner).transposed();
            let run = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let mut sum = c.clone();
                    add_product(turned, rhs, &mut sum);
                    [product(lhs, turned_rhs), sum]
                })
            };
            let found = run(1);
            for threads in [2, 3] {
                assert_eq!(found, run(threads), "{rows} x {inner} x {columns} on {threads} threads");
            }
            for i in 0..rows {
                for j in 0..columns {
                    let of = |value: f32| f64::from(value);
                    let exact: f64 = (0..inner).map(|k| of(a[i * inner + k]) * of(b[k * columns + j])).sum();
                    let at = i * columns + j;
                    let tolerance = 1e-6 * inner as f64;
                    assert!((f64::from(found[0][at]) - exact).abs() < tolerance);
                    assert!((f64::from(found[1][at]) - exact - f64::from(c[at])).abs() < tolerance);
                }
            }
        }
    }

    #[test]
    fn what_is_not_a_number_stays_visible() {
        let lhs = MatrixView::of_rows(&[1.0, f32::NAN, f32::MAX, 1.0, 2.0, 3.0], 3);
        let found = product(lhs, MatrixView::of_rows(&[2.0, 1.0, 4.0], 1));
        assert!(found[0].is_nan());
        assert_eq!(found[1], 16.0, "in the other row");
    }
}
