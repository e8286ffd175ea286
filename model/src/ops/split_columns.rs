//! Cuts a wide matrix into column blocks, with a backward pass linear in its size.
//!
//! The gradient of an ordinary slice is the whole matrix, zero but for the slice, and one such matrix is added per block:
//! quadratic in the number of blocks. Here every block stores its gradient in one list, and a collector below all blocks
//! joins them once.

use std::any::Any;
use std::sync::{Arc, Mutex, PoisonError};

#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::{Shape, Slice, Tensor};

use super::host::HostBackend;
use super::operation::{ArgumentGradients, FusedOps, Operation, Saved, TensorKernel, apply};
use super::tensors::Tensors;

/// Gradients of the blocks of one matrix, kept for the collector (which knows their type).
#[derive(Clone, Debug)]
struct ColumnGradients {
    blocks: Arc<Mutex<Vec<Option<Box<dyn Any + Send>>>>>,
    width: usize,
}

impl ColumnGradients {
    fn new(count: usize, width: usize) -> Self {
        Self { blocks: Arc::new(Mutex::new((0..count).map(|_| None).collect())), width }
    }

    /// Stores the gradient of a block; true if it is the first one.
    fn store<B: Backend>(&self, block: usize, gradient: FloatTensor<B>) -> bool {
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
    let collected = apply(Collector(gradients.clone()), [wide]);
    let block = |index| apply(Block { index, gradients: gradients.clone() }, [collected.clone()]);
    (0..count).map(block).collect()
}

/// The wide matrix itself, which gets the joined gradients of its blocks.
#[derive(Clone, Debug)]
struct Collector(ColumnGradients);

impl TensorKernel for Collector {
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        arguments
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        arguments
    }
}

impl Operation<1> for Collector {
    /// The gradient that the blocks registered is only a sign that they have run.
    fn backward<B: FusedOps>(&self, _: Saved<B, 1>, _: FloatTensor<B>) -> ArgumentGradients<B, 1> {
        [self.0.join::<B>()]
    }
}

/// One block of columns of the collected matrix.
#[derive(Clone, Debug)]
struct Block {
    index: usize,
    gradients: ColumnGradients,
}

impl Block {
    fn cut<B: Backend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let [wide] = arguments.take();
        let (rows, width) = (wide.shape()[0], self.gradients.width);
        let columns = self.index * width..(self.index + 1) * width;
        [B::float_slice(wide, &[Slice::from(0..rows), Slice::from(columns)])].into()
    }
}

impl TensorKernel for Block {
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        self.cut(arguments)
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        self.cut(arguments)
    }
}

impl Operation<1> for Block {
    fn backward<B: FusedOps>(&self, _: Saved<B, 1>, gradient: FloatTensor<B>) -> ArgumentGradients<B, 1> {
        let (device, dtype) = (gradient.device(), gradient.dtype());
        let first = self.gradients.store::<B>(self.index, gradient);
        [first.then(|| B::float_zeros(Shape::new([1]), &device, dtype.into()))]
    }
}
