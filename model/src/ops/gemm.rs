//! Matrix products in host memory, written into memory that is not zeroed first and partitioned among threads by their shape:
//! tall ones (a row a vertex) by rows, small results of long sums (gradients of weights) by columns.

use std::mem::MaybeUninit;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use rayon::prelude::*;

use super::tile::{OutputBlock, RightFactor, StridedMatrix};

/// Multiplications and additions below which a second thread costs more than it saves.
const PARALLEL_FROM: usize = 192 * 192 * 192;
/// Rows that one task multiplies: with their terms they fit the second-level cache.
const ROWS_PER_BLOCK: usize = 96;
/// Terms that are added up at once: a panel of so many stays in the first two levels of cache.
const TERMS_PER_BLOCK: usize = 512;
/// The same where the left factor is copied too.
const TERMS_PER_COPY: usize = 192;

impl StridedMatrix {
    /// The f32 elements of a matrix.
    fn of(matrix: &FloatTensor<Flex>) -> Self {
        let layout = matrix.layout();
        let [row_stride, column_stride] = [layout.strides()[0], layout.strides()[1]];
        let first = matrix.storage::<f32>()[layout.start_offset()..].as_ptr();
        Self { first, row_stride, column_stride }
    }
}

/// `lhs·rhs` of f32 matrices, none of them empty, row by row.
pub(super) fn product(lhs: &FloatTensor<Flex>, rhs: &FloatTensor<Flex>) -> Vec<f32> {
    let count = lhs.shape()[0] * rhs.shape()[1];
    let mut values = Vec::with_capacity(count);
    // SAFETY: nothing is added; all elements of the product are written.
    unsafe {
        write(lhs, rhs, &mut values.spare_capacity_mut()[..count], false);
        values.set_len(count);
    }
    values
}

/// Adds `lhs·rhs` to `sum`, whose rows lie one after another.
pub(super) fn add_product(lhs: &FloatTensor<Flex>, rhs: &FloatTensor<Flex>, sum: &mut [f32]) {
    // SAFETY: the elements are initialised and stay so: only floats are written.
    unsafe { write(lhs, rhs, &mut *(std::ptr::from_mut(sum) as *mut [MaybeUninit<f32>]), true) };
}

/// `output = lhs·rhs`, plus what `output` holds if `add`; initialises all of it.
///
/// # Safety
/// `output` is initialised if `add`.
unsafe fn write(
    lhs: &FloatTensor<Flex>,
    rhs: &FloatTensor<Flex>,
    output: &mut [MaybeUninit<f32>],
    add: bool,
) {
    let size @ [rows, inner, columns] = [lhs.shape()[0], lhs.shape()[1], rhs.shape()[1]];
    assert_eq!(inner, rhs.shape()[0], "the inner sizes of a product differ");
    assert_eq!(output.len(), rows * columns, "the output of a product has another size");
    let (lhs, rhs) = (StridedMatrix::of(lhs), StridedMatrix::of(rhs));
    let output = OutputBlock { first: output.as_mut_ptr().cast(), row_stride: columns };
    let work = rows.saturating_mul(inner).saturating_mul(columns);
    let threads = if work < PARALLEL_FROM { 1 } else { rayon::current_num_threads() };
    // SAFETY: the steps are those of the tensors, whose elements all lie in their storage; the rest is the caller's promise.
    unsafe {
        match inner > 2 * rows && inner > TERMS_PER_COPY {
            true => write_long_sums(lhs, rhs, output, size, add, threads),
            false => write_rows(lhs, rhs, output, size, add, threads),
        }
    }
}

/// A result of many rows: the right factor is rearranged once, and every task multiplies a block of rows.
///
/// # Safety
/// `lhs` is a matrix of `[rows, inner]` elements, `rhs` of `[inner, columns]`; `output` of `[rows, columns]` is initialised if
/// `add`.
unsafe fn write_rows(
    lhs: StridedMatrix,
    rhs: StridedMatrix,
    output: OutputBlock,
    [rows, inner, columns]: [usize; 3],
    add: bool,
    threads: usize,
) {
    let mut right = RightFactor::default();
    // SAFETY: promised.
    unsafe { right.fill(rhs, [inner, columns]) };
    let block = |block: usize| {
        let first = block * ROWS_PER_BLOCK;
        let count = ROWS_PER_BLOCK.min(rows - first);
        let output = output.from(first, 0);
        let mut copy = Vec::new();
        for start in (0..inner).step_by(TERMS_PER_BLOCK) {
            let terms = start..(start + TERMS_PER_BLOCK).min(inner);
            // SAFETY: a block of the promised matrices; no other task has these rows.
            unsafe {
                let lhs = along_rows(lhs.from(first, start), count, terms.len(), &mut copy);
                right.multiply(lhs, count, terms, output, add || start > 0);
            }
        }
    };
    for_each(rows.div_ceil(ROWS_PER_BLOCK), threads, block);
}

/// A small result of long sums, the gradient of a weight matrix: every task computes a block of the result.
///
/// # Safety
/// As [`write_rows`].
unsafe fn write_long_sums(
    lhs: StridedMatrix,
    rhs: StridedMatrix,
    output: OutputBlock,
    [rows, inner, columns]: [usize; 3],
    add: bool,
    threads: usize,
) {
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
        let (height, width) = (height.min(rows - row), width.min(columns - column));
        let (mut right, mut copy) = (RightFactor::default(), Vec::new());
        for start in (0..inner).step_by(TERMS_PER_COPY) {
            let terms = TERMS_PER_COPY.min(inner - start);
            // SAFETY: a block of the promised matrices; no other task has this part of the output.
            unsafe {
                right.fill(rhs.from(start, column), [terms, width]);
                for first in (row..row + height).step_by(ROWS_PER_BLOCK) {
                    let count = ROWS_PER_BLOCK.min(row + height - first);
                    let lhs = along_rows(lhs.from(first, start), count, terms, &mut copy);
                    right.multiply(lhs, count, 0..terms, output.from(first, column), add || start > 0);
                }
            }
        }
    };
    for_each(rows.div_ceil(height) * column_blocks, threads, block);
}

/// A block whose elements lie close together: itself, or a copy if its columns are contiguous instead of its rows.
///
/// # Safety
/// `block` has `[rows, terms]` elements, and so many can be read from every column.
unsafe fn along_rows(block: StridedMatrix, rows: usize, terms: usize, copy: &mut Vec<f32>) -> StridedMatrix {
    if block.column_stride == 1 {
        return block;
    }
    if rows == 1 {
        // There is no step to another row.
        return StridedMatrix { row_stride: 1, ..block };
    }
    assert_eq!(block.row_stride, 1, "neither rows nor columns of a left factor are contiguous");
    copy.clear();
    for term in 0..terms {
        // SAFETY: a column of the block.
        copy.extend_from_slice(unsafe { std::slice::from_raw_parts(block.from(0, term).first, rows) });
    }
    StridedMatrix::of_rows(copy, rows).transposed()
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
    use burn::backend::ops::FloatTensorOps;
    use burn::tensor::TensorData;

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

    fn matrix(values: &[f32], rows: usize, columns: usize) -> FloatTensor<Flex> {
        FloatTensor::<Flex>::from_data(TensorData::new(values.to_vec(), [rows, columns]))
    }

    #[test]
    fn every_partition_matches_sums_in_double_precision_for_any_number_of_threads() {
        for [rows, inner, columns] in SIZES {
            let (a, b, c) = (values(rows * inner, 1), values(inner * columns, 2), values(rows * columns, 3));
            let (lhs, rhs) = (matrix(&a, rows, inner), matrix(&b, inner, columns));
            // The left factor of a weight's gradient is a transposed view.
            let turned: Vec<f32> = (0..inner * rows).map(|i| a[(i % rows) * inner + i / rows]).collect();
            let turned = Flex::float_swap_dims(matrix(&turned, inner, rows), 0, 1);
            // The right one of the gradient of a factor is too.
            let turned_rhs: Vec<f32> =
                (0..inner * columns).map(|i| b[(i % inner) * columns + i / inner]).collect();
            let turned_rhs = Flex::float_swap_dims(matrix(&turned_rhs, columns, inner), 0, 1);
            let run = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let mut sum = c.clone();
                    add_product(&turned, &rhs, &mut sum);
                    [product(&lhs, &turned_rhs), sum]
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
        let lhs = matrix(&[1.0, f32::NAN, f32::MAX, 1.0, 2.0, 3.0], 2, 3);
        let found = product(&lhs, &matrix(&[2.0, 1.0, 4.0], 3, 1));
        assert!(found[0].is_nan());
        assert_eq!(found[1], 16.0, "in the other row");
    }
}
