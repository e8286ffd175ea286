//! The operations as kernels for GPUs, written once in CubeCL for every graphics API and for CUDA.
//!
//! Kernels read and write whole matrices `[rows, columns]` in row-major order; those that most time goes to take four entries at
//! a time where the rows have a multiple of four. They test their indices against the sizes of one matrix, so the functions that
//! launch them test that the others agree. Sums over rows are added up block by block in a fixed order, so that results do not
//! change from run to run.

// A kernel takes its buffers and sizes one by one.
#![allow(clippy::too_many_arguments)]
// CubeCL knows `%`, but not `is_multiple_of`.
#![allow(clippy::manual_is_multiple_of)]

mod activation;
mod adam;
mod blend;
mod column_sums;
mod gradient_features;
mod math;
mod norm;
mod product;
mod sine_modulation;
mod skin_correction;
mod transform_points;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Cube, TensorMetadata};
use burn::tensor::Shape;
use burn_cubecl::cubecl;
use burn_cubecl::kernel::into_contiguous;
use cubecl::client::Client;
use cubecl::prelude::*;

pub(super) use activation::{activated_sum, activated_sum_gradients};
pub(super) use adam::adam;
pub(super) use blend::blend;
pub(super) use gradient_features::{feature_gradients, gradient_features};
pub(super) use norm::{scale, squared_norm};
pub(super) use product::product;
pub(super) use sine_modulation::{sine_gradients, sine_modulation};
pub(super) use skin_correction::projection;
pub(super) use transform_points::{transform_gradients, transform_points};

/// A tensor on a GPU.
pub(super) type GpuTensor = FloatTensor<Cube>;

/// Units that run in one group.
const UNITS: u32 = 256;

/// A matrix in row-major order, read or written by kernels `width` entries at a time.
#[derive(Clone)]
struct Matrix {
    tensor: GpuTensor,
    rows: usize,
    columns: usize,
}

impl Matrix {
    /// A tensor of any dimension as the matrix of its last one; copied if its memory is not in row-major order.
    fn new(tensor: GpuTensor) -> Self {
        let tensor = into_contiguous(tensor);
        let shape = tensor.shape();
        let columns = shape.iter().last().copied().unwrap_or(1);
        let rows = shape.num_elements() / columns.max(1);
        Self { tensor, rows, columns }
    }

    /// # Panics
    /// If another matrix has other sizes; kernels do not look.
    fn assert_like<'a>(&self, others: impl IntoIterator<Item = &'a Self>) {
        others.into_iter().for_each(|other| other.assert_size(self.rows, self.columns));
    }

    /// # Panics
    /// If it has other sizes; kernels do not look.
    fn assert_size(&self, rows: usize, columns: usize) {
        assert_eq!([self.rows, self.columns], [rows, columns], "rows and columns of an argument");
    }

    /// Uninitialised memory on the device of `self`.
    fn empty(&self, rows: usize, columns: usize) -> Self {
        let tensor = empty(&self.tensor, Shape::new([rows, columns]));
        Self { tensor, rows, columns }
    }

    /// Entries that a kernel reads at once.
    fn width(&self) -> usize {
        if self.columns.is_multiple_of(4) { 4 } else { 1 }
    }

    fn client(&self) -> &Client {
        &self.tensor.client
    }

    /// The whole matrix as an argument of a kernel.
    fn argument(&self, width: usize) -> BufferArg {
        buffer(&self.tensor, self.rows * self.columns, width)
    }
}

/// Uninitialised memory on the device of `like`.
fn empty(like: &GpuTensor, shape: Shape) -> GpuTensor {
    let handle = like.client.empty(shape.num_elements() * size_of::<f32>());
    GpuTensor::new_contiguous(like.client.clone(), like.device.clone(), shape, handle, like.dtype)
}

/// All `count` entries of a tensor in row-major order.
fn buffer(tensor: &GpuTensor, count: usize, width: usize) -> BufferArg {
    assert_eq!(tensor.shape().num_elements(), count, "entries of an argument");
    assert!(u32::try_from(count).is_ok(), "{count} entries: kernels count them in 32 bits");
    // SAFETY: the memory of the tensor has `count` entries.
    unsafe { BufferArg::from_raw_parts(tensor.handle.clone(), count / width) }
}

/// Groups that together have at least one unit for each of `count` tasks.
fn groups(client: &Client, count: usize) -> (CubeCount, CubeDim) {
    let dim = CubeDim::new_1d(UNITS);
    (cubecl::calculate_cube_count_elemwise(client, count, dim), dim)
}
