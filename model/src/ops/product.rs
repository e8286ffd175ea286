//! Matrix products written straight into their place.
//!
//! burn's flex backend zeroes the memory of every product, copies it to aligned memory, and only then multiplies; for the
//! narrow matrices of these networks (width 128) that takes a quarter of the time of the multiplication. Here the same one
//! (crate `gemm`) writes into fresh memory, or adds to a matrix that nobody else holds.

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, NodeGuard, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch};
use burn::tensor::Tensor;

use super::backend::{FusedOps, Kernels};

/// `lhs·rhs`: `[N,K]`, `[K,C]` → `[N,C]`.
///
/// # Panics
/// If the inner sizes differ.
pub fn product(lhs: Tensor<2>, rhs: Tensor<2>) -> Tensor<2> {
    Tensor::from_dispatch(Dispatch::product(lhs.into_dispatch(), rhs.into_dispatch()))
}

/// `lhs·rhs + addend`: `[N,K]`, `[K,C]`, `[N,C]` → `[N,C]`; in the memory of `addend` where nobody else holds it.
///
/// # Panics
/// If the sizes disagree.
pub fn product_add(lhs: Tensor<2>, rhs: Tensor<2>, addend: Tensor<2>) -> Tensor<2> {
    Tensor::from_dispatch(Dispatch::product_add(
        lhs.into_dispatch(),
        rhs.into_dispatch(),
        addend.into_dispatch(),
    ))
}

// ---------------------------------------------------------------------------------------------------------- any backend

pub(super) fn forward<B: Backend>(
    lhs: FloatTensor<B>,
    rhs: FloatTensor<B>,
    addend: Option<FloatTensor<B>>,
) -> FloatTensor<B> {
    let product = B::float_matmul(lhs, rhs);
    match addend {
        Some(addend) => B::float_add(product, addend),
        None => product,
    }
}

// ----------------------------------------------------------------------------------------------------------------- flex

#[cfg(feature = "flex")]
pub(super) use flex::multiply;

#[cfg(feature = "flex")]
mod flex {
    use burn::backend::tensor::FloatTensor;
    use burn::backend::{Flex, TensorMetadata};
    use burn::tensor::{DType, TensorData};

    /// Multiplications and additions below which a second thread costs more than it saves.
    const PARALLEL_FROM: usize = 192 * 192 * 192;

    /// First element and strides of a matrix in memory.
    struct Place {
        first: *const f32,
        row_stride: isize,
        column_stride: isize,
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
                assert_eq!(
                    sum.shape().as_slice(),
                    [rows, columns],
                    "the addend of a product has another size"
                );
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
        let parallelism = match rows.saturating_mul(inner).saturating_mul(columns) {
            0..PARALLEL_FROM => gemm::Parallelism::None,
            _ => gemm::Parallelism::Rayon(0),
        };
        // SAFETY: the strides are those of the tensors, whose elements all lie in their storage; the rest is promised.
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
}

// ------------------------------------------------------------------------------------------------------------- autodiff

/// The factors, then the addend if there is one.
#[derive(Debug)]
struct ProductBackward;

/// Each factor, where the gradient of the other one is wanted.
type Factors<B> = [Option<FloatTensor<B>>; 2];

impl<B: Kernels, const N: usize> Backward<B, N> for ProductBackward {
    type State = Factors<B>;

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let gradient = grads.consume::<B>(&ops.node);
        let [lhs, rhs] = ops.state;
        let mut parents = ops.parents.into_iter();
        let (to_lhs, to_rhs) = (parents.next().flatten(), parents.next().flatten());
        if let (Some(parent), Some(rhs)) = (to_lhs, rhs) {
            let transposed = B::float_swap_dims(rhs, 0, 1);
            grads.register::<B>(parent.id, B::matrix_product(gradient.clone(), transposed, None));
        }
        if let (Some(parent), Some(lhs)) = (to_rhs, lhs) {
            let transposed = B::float_swap_dims(lhs, 0, 1);
            grads.register::<B>(parent.id, B::matrix_product(transposed, gradient.clone(), None));
        }
        if let Some(parent) = parents.next().flatten() {
            grads.register::<B>(parent.id, gradient);
        }
    }
}

/// Runs the product and records it if any argument is tracked.
pub(super) fn record<B: Kernels, C: CheckpointStrategy>(
    lhs: FloatTensor<Autodiff<B, C>>,
    rhs: FloatTensor<Autodiff<B, C>>,
) -> FloatTensor<Autodiff<B, C>> {
    let tracked = [lhs.is_tracked(), rhs.is_tracked()];
    let ((lhs, a), (rhs, b)) = (lhs.into_parts(), rhs.into_parts());
    finish::<B, C, 2>([a, b], lhs, rhs, None, tracked)
}

/// The same with an addend.
pub(super) fn record_add<B: Kernels, C: CheckpointStrategy>(
    lhs: FloatTensor<Autodiff<B, C>>,
    rhs: FloatTensor<Autodiff<B, C>>,
    addend: FloatTensor<Autodiff<B, C>>,
) -> FloatTensor<Autodiff<B, C>> {
    let tracked = [lhs.is_tracked(), rhs.is_tracked()];
    let ((lhs, a), (rhs, b)) = (lhs.into_parts(), rhs.into_parts());
    let (addend, c) = addend.into_parts();
    finish::<B, C, 3>([a, b, c], lhs, rhs, Some(addend), tracked)
}

fn finish<B: Kernels, C: CheckpointStrategy, const N: usize>(
    parents: [NodeGuard; N],
    lhs: FloatTensor<B>,
    rhs: FloatTensor<B>,
    addend: Option<FloatTensor<B>>,
    [lhs_tracked, rhs_tracked]: [bool; 2],
) -> FloatTensor<Autodiff<B, C>> {
    match Backward::<B, N>::prepare::<C>(ProductBackward, parents).compute_bound().stateful() {
        OpsKind::UnTracked(operation) => operation.finish(B::matrix_product(lhs, rhs, addend)),
        OpsKind::Tracked(operation) => {
            let factors = [rhs_tracked.then(|| lhs.clone()), lhs_tracked.then(|| rhs.clone())];
            operation.finish(factors, B::matrix_product(lhs, rhs, addend))
        }
    }
}
