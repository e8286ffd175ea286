//! The factors of a product, and how a group of units reads its tiles of them.

use burn::backend::TensorMetadata;
use burn_cubecl::cubecl;
use cubecl::prelude::*;

use crate::ops::gpu::matrix::{GpuTensor, Matrix};

/// Units of a group, of either kernel.
pub(super) const PRODUCT_UNITS: usize = 256;
/// Rows and columns of the result that one group computes.
pub(super) const TILE: usize = 128;

/// A factor, held in memory as it is or transposed.
pub(super) struct Factor {
    /// The matrix in memory.
    pub(super) matrix: Matrix,
    /// Whether the factor is its transpose.
    pub(super) transposed: bool,
}

impl Factor {
    pub(super) fn new(tensor: GpuTensor) -> Self {
        let shape = tensor.shape();
        let [rows, columns] = [shape[0], shape[1]];
        let strides = tensor.meta.strides();
        let transposed = rows > 1 && columns > 1 && strides[0] == 1 && strides[1] == rows;
        let tensor = match transposed {
            true => {
                let (client, device, handle) = (tensor.client, tensor.device, tensor.handle);
                GpuTensor::new_contiguous(client, device, [columns, rows].into(), handle, tensor.dtype)
            }
            false => tensor,
        };
        Self { matrix: Matrix::new(tensor), transposed }
    }

    /// Rows and columns of the factor.
    fn sizes(&self) -> [usize; 2] {
        let Matrix { rows, columns, .. } = self.matrix;
        if self.transposed { [columns, rows] } else { [rows, columns] }
    }
}

/// Which factors lie transposed in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Transposed {
    pub(super) lhs: bool,
    pub(super) rhs: bool,
}

/// Rows and columns of a product, and the terms of each of its sums.
#[derive(Clone, Copy)]
pub(super) struct Sizes {
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) depth: usize,
}

impl Sizes {
    /// # Panics
    /// If the inner sizes differ.
    pub(super) fn new(lhs: &Factor, rhs: &Factor) -> Self {
        let ([rows, depth], [inner, columns]) = (lhs.sizes(), rhs.sizes());
        assert_eq!(depth, inner, "the inner sizes of a product");
        Self { rows, columns, depth }
    }
}

/// Reads this unit's share of a tile into `registers`: `outer` lines of a matrix in memory, `inner` entries of each; zero
/// outside of the ranges `…_start..…_end`. The `count` shares of a unit lie `units` apart.
#[cube]
pub(super) fn read_tile<N: Size>(
    source: &[Vector<f32, N>],
    registers: &mut Array<Vector<f32, N>>,
    unit: usize,
    outer_start: usize,
    outer_end: usize,
    inner_start: usize,
    inner_end: usize,
    pitch: usize,
    #[comptime] inner: usize,
    #[comptime] count: usize,
    #[comptime] units: usize,
) {
    let width = N::value();
    let per_line = comptime!(inner / width);
    #[unroll]
    for i in 0..count {
        let position = unit + i * units;
        let outer = outer_start + position / per_line;
        let at = inner_start + position % per_line * width;
        let mut value = Vector::<f32, N>::new(0.0);
        if outer < outer_end && at < inner_end {
            value = source[(outer * pitch + at) / width];
        }
        registers[i] = value;
    }
}
