//! The products of burn's flex backend: crate `gemm` on memory that is not zeroed first, shared out among threads by the shape
//! of the product. `gemm` itself splits large results into blocks, which is right for square matrices; ours are tall (a row a
//! vertex) or small results of long sums (gradients of weights).

use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use burn::tensor::{DType, TensorData};
use gemm::Parallelism;
use rayon::prelude::*;
use std::mem::MaybeUninit;

/// Multiplications and additions below which a second thread costs more than it saves.
const PARALLEL_FROM: usize = 192 * 192 * 192;
/// Results with more columns are shared out by `gemm` itself, by blocks; narrower ones better by whole rows.
const NARROW: usize = 256;
/// Rows that are worth packing the right matrix once more.
const ROWS_PER_PART: usize = 384;
/// A product of this many terms an element is added up in parts, where the result is small. The parts depend on the
/// sizes alone, so that the number of threads does not change the sums.
const TERMS_PER_PART: usize = 512;
/// Parts of a sum at most.
const MOST_PARTS: usize = 8;

/// First element and strides of a matrix in memory.
#[derive(Clone, Copy)]
struct Place {
    first: *const f32,
    row_stride: isize,
    column_stride: isize,
}

// SAFETY: only read, and the tensor it belongs to outlives every use.
unsafe impl Send for Place {}
unsafe impl Sync for Place {}

impl Place {
    /// The matrix from row `row` on.
    fn row(self, row: usize) -> Self {
        Self { first: self.first.wrapping_offset(row as isize * self.row_stride), ..self }
    }

    /// The matrix from column `column` on.
    fn column(self, column: usize) -> Self {
        Self { first: self.first.wrapping_offset(column as isize * self.column_stride), ..self }
    }
}

fn place(matrix: &FloatTensor<Flex>) -> Place {
    let layout = matrix.layout();
    let [row_stride, column_stride] = [layout.strides()[0], layout.strides()[1]];
    let first = matrix.storage::<f32>()[layout.start_offset()..].as_ptr();
    Place { first, row_stride, column_stride }
}

/// See [`super::forward`], which computes what this function does not: other element types and empty matrices.
pub(in crate::ops) fn multiply(
    lhs: FloatTensor<Flex>,
    rhs: FloatTensor<Flex>,
    addend: Option<FloatTensor<Flex>>,
) -> FloatTensor<Flex> {
    let f32_matrix = |t: &FloatTensor<Flex>| t.dtype() == DType::F32 && t.shape().num_dims() == 2;
    let [rows, inner] = [0, 1].map(|axis| lhs.shape()[axis]);
    let columns = rhs.shape()[1];
    if !(f32_matrix(&lhs) && f32_matrix(&rhs) && addend.as_ref().is_none_or(f32_matrix))
        || rows * inner * columns == 0
    {
        return super::forward::<Flex>(lhs, rhs, addend);
    }
    assert_eq!(inner, rhs.shape()[0], "the inner sizes of a product differ");
    let count = rows * columns;
    let add = addend.is_some();
    match addend {
        None => {
            let mut values = Vec::with_capacity(count);
            // SAFETY: the product has `count` elements, all of which are written.
            unsafe {
                write(&lhs, &rhs, values.as_mut_ptr(), [rows, inner, columns], add);
                values.set_len(count);
            }
            matrix(values, rows, columns)
        }
        Some(mut sum) => {
            assert_eq!(sum.shape().as_slice(), [rows, columns], "the addend of a product has another size");
            let whole = sum.layout().is_contiguous()
                && sum.layout().start_offset() == 0
                && sum.storage::<f32>().len() == count;
            if whole && sum.is_unique() {
                let values = sum.storage_mut::<f32>();
                // SAFETY: `values` has `count` elements, and no other tensor shares them.
                unsafe { write(&lhs, &rhs, values.as_mut_ptr(), [rows, inner, columns], add) };
                sum
            } else {
                let sum = sum.to_contiguous();
                let start = sum.layout().start_offset();
                let mut values = sum.storage::<f32>()[start..start + count].to_vec();
                // SAFETY: as above; the memory is new.
                unsafe { write(&lhs, &rhs, values.as_mut_ptr(), [rows, inner, columns], add) };
                matrix(values, rows, columns)
            }
        }
    }
}

fn matrix(values: Vec<f32>, rows: usize, columns: usize) -> FloatTensor<Flex> {
    FloatTensor::<Flex>::from_data(TensorData::new(values, [rows, columns]))
}

/// `output = lhs·rhs`, plus what `output` holds if `add`.
///
/// # Safety
/// `output` points to rows·columns elements that no one else uses, initialised if `add`; `lhs` is a matrix of
/// `[rows, inner]` f32 elements, `rhs` of `[inner, columns]`.
unsafe fn write(
    lhs: &FloatTensor<Flex>,
    rhs: &FloatTensor<Flex>,
    output: *mut f32,
    [rows, inner, columns]: [usize; 3],
    add: bool,
) {
    let (lhs, rhs) = (place(lhs), place(rhs));
    let work = rows.saturating_mul(inner).saturating_mul(columns);
    // SAFETY (all branches): the strides are those of the tensors, whose elements all lie in their storage; parts of
    // rows and of terms do not overlap; the rest is promised.
    if work < PARALLEL_FROM {
        unsafe { one(lhs, rhs, output, [rows, inner, columns], add, Parallelism::None) };
    } else if rows <= NARROW && columns <= NARROW && inner >= 2 * TERMS_PER_PART {
        unsafe { by_terms(lhs, rhs, output, [rows, inner, columns], add) };
    } else if columns <= NARROW && rows >= 2 * ROWS_PER_PART {
        let part = rows.div_ceil(rayon::current_num_threads()).max(ROWS_PER_PART);
        let target = Target(output);
        (0..rows.div_ceil(part)).into_par_iter().for_each(|i| {
            let (first, target) = (i * part, &target);
            let size = [part.min(rows - first), inner, columns];
            unsafe { one(lhs.row(first), rhs, target.at(first * columns), size, add, Parallelism::None) };
        });
    } else {
        unsafe { one(lhs, rhs, output, [rows, inner, columns], add, Parallelism::Rayon(0)) };
    }
}

/// Where threads write parts that do not overlap.
struct Target(*mut f32);

// SAFETY: only disjoint parts are written, each by one thread.
unsafe impl Sync for Target {}

impl Target {
    /// # Safety
    /// `offset` elements after the first must be there.
    unsafe fn at(&self, offset: usize) -> *mut f32 {
        // SAFETY: promised.
        unsafe { self.0.add(offset) }
    }
}

/// A small result of long sums, the gradient of a weight matrix: parts of the sums are computed side by side.
///
/// # Safety
/// As [`write`].
unsafe fn by_terms(lhs: Place, rhs: Place, output: *mut f32, [rows, inner, columns]: [usize; 3], add: bool) {
    let count = rows * columns;
    let part = inner.div_ceil((inner / TERMS_PER_PART).clamp(1, MOST_PARTS));
    let parts = inner.div_ceil(part);
    let mut sums: Vec<f32> = Vec::with_capacity(count * parts);
    let target = Target(sums.as_mut_ptr());
    (0..parts).into_par_iter().for_each(|i| {
        let (first, target) = (i * part, &target);
        let size = [rows, part.min(inner - first), columns];
        // SAFETY: part `i` of `sums` is written by this thread alone.
        unsafe {
            let sum = target.at(i * count);
            one(lhs.column(first), rhs.row(first), sum, size, false, Parallelism::None);
        }
    });
    // SAFETY: every part was written; `output` is promised.
    let (sums, output) = unsafe {
        sums.set_len(count * parts);
        (sums, std::slice::from_raw_parts_mut(output.cast::<MaybeUninit<f32>>(), count))
    };
    for (i, out) in output.iter_mut().enumerate() {
        let sum = (0..parts).map(|p| sums[p * count + i]).sum::<f32>();
        // SAFETY: initialised where something is added.
        let before = if add { unsafe { out.assume_init() } } else { 0.0 };
        out.write(before + sum);
    }
}

/// One call of `gemm`.
///
/// # Safety
/// As [`write`].
unsafe fn one(
    lhs: Place,
    rhs: Place,
    output: *mut f32,
    [rows, inner, columns]: [usize; 3],
    add: bool,
    parallelism: Parallelism,
) {
    // SAFETY: promised.
    unsafe {
        gemm::gemm(
            rows,
            columns,
            inner,
            output,
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
    use burn::tensor::Device;
    use burn::tensor::Tensor;

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

    fn tensor(values: &[f32], rows: usize, columns: usize) -> Tensor<2> {
        Tensor::from_data(TensorData::new(values.to_vec(), [rows, columns]), &Device::flex())
    }

    #[test]
    fn every_way_of_sharing_out_matches_sums_in_double_precision_for_any_number_of_threads() {
        for [rows, inner, columns] in SIZES {
            let (a, b, c) = (values(rows * inner, 1), values(inner * columns, 2), values(rows * columns, 3));
            let run = |threads: usize| -> Vec<Vec<f32>> {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let plain = crate::ops::product(tensor(&a, rows, inner), tensor(&b, inner, columns));
                    // The left factor of a weight's gradient is a transposed view.
                    let turned: Vec<f32> =
                        (0..inner * rows).map(|i| a[(i % rows) * inner + i / rows]).collect();
                    let turned = tensor(&turned, inner, rows).transpose();
                    let sum = tensor(&c, rows, columns);
                    let added = crate::ops::product_add(turned, tensor(&b, inner, columns), sum);
                    [plain, added].map(|t| t.into_data().try_to_vec::<f32>().unwrap()).into()
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
