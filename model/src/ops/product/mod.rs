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

use super::backend::FusedOps;
use super::kernels::Kernels;

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
mod flex;

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
