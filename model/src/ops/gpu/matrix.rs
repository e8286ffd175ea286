//! Tensors of a GPU as the matrices that kernels read and write.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Cube, TensorMetadata};
use burn::tensor::Shape;
use burn_cubecl::cubecl;
use burn_cubecl::kernel::into_contiguous;
use cubecl::client::Client;
use cubecl::prelude::*;

/// A tensor on a GPU.
pub(in crate::ops) type GpuTensor = FloatTensor<Cube>;

/// Units that run in one group.
pub(super) const UNITS: u32 = 256;

/// A matrix in row-major order, read or written by kernels `width` entries at a time.
#[derive(Clone)]
pub(super) struct Matrix {
    pub(super) tensor: GpuTensor,
    pub(super) rows: usize,
    pub(super) columns: usize,
}

impl Matrix {
    /// A tensor of any dimension as the matrix of its last one; copied if its memory is not in row-major order.
    pub(super) fn new(tensor: GpuTensor) -> Self {
        let tensor = into_contiguous(tensor);
        let shape = tensor.shape();
        let columns = shape.iter().last().copied().unwrap_or(1);
        let rows = shape.num_elements() / columns.max(1);
        Self { tensor, rows, columns }
    }

    /// # Panics
    /// If another matrix has other sizes; kernels do not look.
    pub(super) fn assert_like<'a>(&self, others: impl IntoIterator<Item = &'a Self>) {
        others.into_iter().for_each(|other| other.assert_size(self.rows, self.columns));
    }

    /// # Panics
    /// If it has other sizes; kernels do not look.
    pub(super) fn assert_size(&self, rows: usize, columns: usize) {
        assert_eq!([self.rows, self.columns], [rows, columns], "rows and columns of an argument");
    }

    /// Uninitialised memory on the device of `self`.
    pub(super) fn empty(&self, rows: usize, columns: usize) -> Self {
        let tensor = empty(&self.tensor, Shape::new([rows, columns]));
        Self { tensor, rows, columns }
    }

    /// Uninitialised memory for a tensor of the same shape.
    pub(super) fn like(&self) -> Self {
        Self { tensor: empty(&self.tensor, self.tensor.shape()), ..*self }
    }

    /// Entries.
    pub(super) fn count(&self) -> usize {
        self.rows * self.columns
    }

    /// Entries that a kernel reads at once.
    pub(super) fn width(&self) -> usize {
        if self.columns.is_multiple_of(4) { 4 } else { 1 }
    }

    pub(super) fn client(&self) -> &Client {
        &self.tensor.client
    }

    /// The whole matrix as an argument of a kernel.
    pub(super) fn argument(&self, width: usize) -> BufferArg {
        buffer(&self.tensor, self.count(), width)
    }
}

/// Uninitialised memory on the device of `like`.
pub(super) fn empty(like: &GpuTensor, shape: Shape) -> GpuTensor {
    let handle = like.client.empty(shape.num_elements() * size_of::<f32>());
    GpuTensor::new_contiguous(like.client.clone(), like.device.clone(), shape, handle, like.dtype)
}

/// All `count` entries of a tensor in row-major order.
pub(super) fn buffer(tensor: &GpuTensor, count: usize, width: usize) -> BufferArg {
    assert_eq!(tensor.shape().num_elements(), count, "entries of an argument");
    assert!(u32::try_from(count).is_ok(), "{count} entries: kernels count them in 32 bits");
    // SAFETY: the memory of the tensor has `count` entries.
    unsafe { BufferArg::from_raw_parts(tensor.handle.clone(), count / width) }
}

/// Groups that together have at least one unit for each of `count` tasks.
pub(super) fn groups(client: &Client, count: usize) -> (CubeCount, CubeDim) {
    let dim = CubeDim::new_1d(UNITS);
    (cubecl::calculate_cube_count_elemwise(client, count, dim), dim)
}
