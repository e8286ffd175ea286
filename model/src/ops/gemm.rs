//! Matrix products in host memory: crate `gemm` on memory that is not zeroed first, partitioned among threads by the shape of
//! the product. `gemm` itself splits large results into blocks, which is right for square matrices; ours are tall (a row a
//! vertex) or small results of long sums (gradients of weights).

use std::mem::MaybeUninit;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use gemm::Parallelism;
use rayon::prelude::*;

/// Multiplications and additions below which a second thread costs more than it saves.
const PARALLEL_FROM: usize = 192 * 192 * 192;
/// Results with more columns are partitioned by `gemm` itself, by blocks; narrower ones better by whole rows.
const NARROW: usize = 256;
/// Rows that are worth packing the right matrix once more.
const ROWS_PER_PART: usize = 384;
/// A product of this many terms an element is added up in parts, where the result is small. The parts depend on the
/// sizes alone, so that the number of threads does not change the sums.
const TERMS_PER_PART: usize = 512;
/// Parts of a sum at most.
const MAX_TERM_PARTS: usize = 8;

/// First element, row and column step of a matrix in memory.
#[derive(Clone, Copy)]
struct StridedMatrix {
    first: *const f32,
    row_stride: isize,
    column_stride: isize,
}

// SAFETY: only read, and the tensor it belongs to outlives every use.
unsafe impl Send for StridedMatrix {}
unsafe impl Sync for StridedMatrix {}

impl StridedMatrix {
    /// The f32 elements of a matrix.
    fn of(matrix: &FloatTensor<Flex>) -> Self {
        let layout = matrix.layout();
        let [row_stride, column_stride] = [layout.strides()[0], layout.strides()[1]];
        let first = matrix.storage::<f32>()[layout.start_offset()..].as_ptr();
        Self { first, row_stride, column_stride }
    }

    /// The matrix from row `row` and column `column` on.
    fn from(self, row: usize, column: usize) -> Self {
        let offset = row as isize * self.row_stride + column as isize * self.column_stride;
        Self { first: self.first.wrapping_offset(offset), ..self }
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
    let [rows, inner, columns] = [lhs.shape()[0], lhs.shape()[1], rhs.shape()[1]];
    assert_eq!(inner, rhs.shape()[0], "the inner sizes of a product differ");
    let (lhs, rhs) = (StridedMatrix::of(lhs), StridedMatrix::of(rhs));
    let work = rows.saturating_mul(inner).saturating_mul(columns);
    let size = [rows, inner, columns];
    // SAFETY (all branches): the steps are those of the tensors, whose elements all lie in their storage; the rest is
    // the caller's promise.
    if work < PARALLEL_FROM {
        unsafe { call_gemm(lhs, rhs, output, size, add, Parallelism::None) };
    } else if rows <= NARROW && columns <= NARROW && inner >= 2 * TERMS_PER_PART {
        unsafe { write_by_terms(lhs, rhs, output, size, add) };
    } else if columns <= NARROW && rows >= 2 * ROWS_PER_PART {
        let part = rows.div_ceil(rayon::current_num_threads()).max(ROWS_PER_PART);
        output.par_chunks_mut(part * columns).enumerate().for_each(|(i, output)| {
            let size = [output.len() / columns, inner, columns];
            unsafe { call_gemm(lhs.from(i * part, 0), rhs, output, size, add, Parallelism::None) };
        });
    } else {
        unsafe { call_gemm(lhs, rhs, output, size, add, Parallelism::Rayon(0)) };
    }
}

/// A small result of long sums, the gradient of a weight matrix: parts of the sums are computed in parallel.
///
/// # Safety
/// As [`call_gemm`].
unsafe fn write_by_terms(
    lhs: StridedMatrix,
    rhs: StridedMatrix,
    output: &mut [MaybeUninit<f32>],
    [rows, inner, columns]: [usize; 3],
    add: bool,
) {
    let count = rows * columns;
    let part = inner.div_ceil((inner / TERMS_PER_PART).clamp(1, MAX_TERM_PARTS));
    let parts = inner.div_ceil(part);
    let mut sums: Vec<f32> = Vec::with_capacity(count * parts);
    sums.spare_capacity_mut()[..count * parts].par_chunks_mut(count).enumerate().for_each(|(i, sums)| {
        let first = i * part;
        let size = [rows, part.min(inner - first), columns];
        // SAFETY: a block of the promised matrices.
        unsafe { call_gemm(lhs.from(0, first), rhs.from(first, 0), sums, size, false, Parallelism::None) };
    });
    // SAFETY: every part was written.
    unsafe { sums.set_len(count * parts) };
    for (i, output) in output.iter_mut().enumerate() {
        let sum = (0..parts).map(|p| sums[p * count + i]).sum::<f32>();
        // SAFETY: initialised where something is added.
        let before = if add { unsafe { output.assume_init() } } else { 0.0 };
        output.write(before + sum);
    }
}

/// `output = lhs·rhs`, plus what `output` holds if `add`; initialises all of it.
///
/// # Safety
/// `lhs` is a matrix of `[rows, inner]` elements, `rhs` of `[inner, columns]`; `output` is initialised if `add`.
unsafe fn call_gemm(
    lhs: StridedMatrix,
    rhs: StridedMatrix,
    output: &mut [MaybeUninit<f32>],
    [rows, inner, columns]: [usize; 3],
    add: bool,
    parallelism: Parallelism,
) {
    assert_eq!(output.len(), rows * columns, "the output of a product has another size");
    // SAFETY: promised; the output has the size of the product.
    unsafe {
        gemm::gemm(
            rows,
            columns,
            inner,
            output.as_mut_ptr().cast::<f32>(),
            1,
            columns as isize,
            add,
            lhs.first,
            lhs.column_stride,
            lhs.row_stride,
            rhs.first,
            rhs.column_stride,
            rhs.row_stride,
            1.0,
            1.0,
            false,
            false,
            false,
            parallelism,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::backend::ops::FloatTensorOps;
    use burn::tensor::TensorData;

    /// Rows, terms, columns: small, tall, long sums, both wide; sizes that no block divides.
    const SIZES: [[usize; 3]; 6] =
        [[7, 5, 3], [1931, 97, 65], [65, 4099, 33], [257, 2051, 40], [300, 301, 299], [33, 2500, 300]];

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
            let run = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let mut sum = c.clone();
                    add_product(&turned, &rhs, &mut sum);
                    [product(&lhs, &rhs), sum]
                })
            };
            let found = run(1);
            for threads in [2, 3] {
                assert_eq!(found, run(threads), "{rows} x {inner} x {columns} on {threads} threads");
            }
            for i in 0..rows {
                for j in 0..columns {
                    let terms =
                        (0..inner).map(|k| f64::from(a[i * inner + k]) * f64::from(b[k * columns + j]));
                    let exact: f64 = terms.sum();
                    let at = i * columns + j;
                    let tolerance = 1e-6 * inner as f64;
                    assert!((f64::from(found[0][at]) - exact).abs() < tolerance);
                    assert!((f64::from(found[1][at]) - exact - f64::from(c[at])).abs() < tolerance);
                }
            }
        }
    }
}
