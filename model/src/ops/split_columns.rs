//! Cuts a wide matrix into column blocks, with a backward pass linear in its size.
//!
//! The gradient of an ordinary slice is the whole matrix, zero but for the slice, and one such matrix is added per block:
//! quadratic in the number of blocks. Here every block leaves its gradient in a shared place, and one collector below all
//! blocks joins them once.

use std::any::Any;
use std::sync::{Arc, Mutex, PoisonError};

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata};
use burn::tensor::{Shape, Slice, Tensor};

use super::backend::FusedOps;
use super::kernels::Kernels;

/// Gradients of the blocks of one matrix, on their way to the collector (which knows their type).
#[derive(Clone, Debug)]
pub(super) struct ColumnGradients {
    blocks: Arc<Mutex<Vec<Option<Box<dyn Any + Send>>>>>,
    width: usize,
}

impl ColumnGradients {
    fn new(count: usize, width: usize) -> Self {
        Self { blocks: Arc::new(Mutex::new((0..count).map(|_| None).collect())), width }
    }

    /// Leaves the gradient of a block; true if it is the first one to arrive.
    fn leave<B: Backend>(&self, block: usize, gradient: FloatTensor<B>) -> bool {
        let mut blocks = self.blocks.lock().unwrap_or_else(PoisonError::into_inner);
        let first = blocks.iter().all(Option::is_none);
        blocks[block] = Some(Box::new(gradient));
        first
    }

    /// All gradients side by side; blocks that got none count as zero.
    fn join<B: Backend>(&self) -> Option<FloatTensor<B>> {
        let mut blocks = self.blocks.lock().unwrap_or_else(PoisonError::into_inner);
        let gradients: Vec<Option<FloatTensor<B>>> = blocks
            .iter_mut()
            .map(|block| block.take().and_then(|gradient| gradient.downcast().ok()).map(|gradient| *gradient))
            .collect();
        let present = gradients.iter().flatten().next()?;
        let (rows, device, dtype) = (present.shape()[0], present.device(), present.dtype());
        let zeros = || B::float_zeros(Shape::new([rows, self.width]), &device, dtype.into());
        let gradients: Vec<_> =
            gradients.into_iter().map(|gradient| gradient.unwrap_or_else(zeros)).collect();
        Some(B::float_cat(gradients, 1))
    }
}

/// `[N, count·width]` → count matrices `[N, width]`.
pub fn split_columns(wide: Tensor<2>, width: usize, count: usize) -> Vec<Tensor<2>> {
    if count == 1 {
        return vec![wide];
    }
    let gradients = ColumnGradients::new(count, width);
    let collector = Dispatch::column_collector(wide.into_dispatch(), gradients.clone());
    (0..count)
        .map(|block| {
            Tensor::from_dispatch(Dispatch::column_block(collector.clone(), block, gradients.clone()))
        })
        .collect()
}

pub(super) fn block<B: Backend>(
    wide: FloatTensor<B>,
    block: usize,
    gradients: &ColumnGradients,
) -> FloatTensor<B> {
    let (rows, width) = (wide.shape()[0], gradients.width);
    B::float_slice(wide, &[Slice::from(0..rows), Slice::from(block * width..(block + 1) * width)])
}

// ------------------------------------------------------------------------------------------------------------- autodiff

#[derive(Debug)]
struct CollectorBackward;

impl<B: Backend> Backward<B, 1> for CollectorBackward {
    type State = ColumnGradients;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        // What the blocks registered is only a sign that they have run.
        let _ = grads.consume::<B>(&ops.node);
        if let ([Some(parent)], Some(gradient)) = (ops.parents, ops.state.join::<B>()) {
            grads.register::<B>(parent.id, gradient);
        }
    }
}

#[derive(Debug)]
struct BlockBackward;

impl<B: Backend> Backward<B, 1> for BlockBackward {
    type State = (ColumnGradients, usize);

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (gradients, block) = ops.state;
        let gradient = grads.consume::<B>(&ops.node);
        let (device, dtype) = (gradient.device(), gradient.dtype());
        if let [Some(collector)] = ops.parents
            && gradients.leave::<B>(block, gradient)
        {
            grads.register::<B>(collector.id, B::float_zeros(Shape::new([1]), &device, dtype.into()));
        }
    }
}

pub(super) fn record_collector<B: Kernels, C: CheckpointStrategy>(
    wide: FloatTensor<Autodiff<B, C>>,
    gradients: ColumnGradients,
) -> FloatTensor<Autodiff<B, C>> {
    let (wide, node) = wide.into_parts();
    match Backward::<B, 1>::prepare::<C>(CollectorBackward, [node]).compute_bound().stateful() {
        OpsKind::UnTracked(operation) => operation.finish(wide),
        OpsKind::Tracked(operation) => operation.finish(gradients, wide),
    }
}

pub(super) fn record_block<B: Kernels, C: CheckpointStrategy>(
    wide: FloatTensor<Autodiff<B, C>>,
    index: usize,
    gradients: ColumnGradients,
) -> FloatTensor<Autodiff<B, C>> {
    let (wide, node) = wide.into_parts();
    let output = block::<B>(wide, index, &gradients);
    match Backward::<B, 1>::prepare::<C>(BlockBackward, [node]).compute_bound().stateful() {
        OpsKind::UnTracked(operation) => operation.finish(output),
        OpsKind::Tracked(operation) => operation.finish((gradients, index), output),
    }
}
