//! Matrix products in f32.
//!
//! burn's own kernels reach a quarter of a large GPU's rate here, and a hundredth where both factors are long and the result is
//! small, as in the gradient of every weight: there the sum is cut into chunks that different groups add up.

mod factor;
mod matrix_units;
mod plain;

use burn_cubecl::cubecl;
use cubecl::prelude::*;

use super::column_sums::total;
use super::matrix::GpuTensor;
use factor::{Factor, PRODUCT_UNITS, Sizes, TILE, Transposed};

/// Groups that keep a large GPU busy: two on each of its 132 multiprocessors.
const ENOUGH_GROUPS: usize = 264;
/// Terms of a sum below which cutting it further costs more than it gains.
const SMALLEST_CHUNK: usize = 128;
/// Both kernels' tiles divide it.
const CHUNK_MULTIPLE: usize = 32;
const _: () =
    assert!(CHUNK_MULTIPLE % matrix_units::CMMA_DEPTH == 0 && CHUNK_MULTIPLE % plain::PLAIN_DEPTH == 0);
/// Entries of a result beyond which its tiles keep a GPU busy anyway, and adding up chunks would need more groups along a
/// dimension than the graphics APIs grant (65,535, for 32 entries each).
const LARGEST_CHUNKED: usize = 32 * 65_535;

/// `lhs·rhs`, from matrices in memory as they are or transposed; other views are copied first.
///
/// # Panics
/// If the inner sizes differ, or a factor is empty.
pub(in crate::ops) fn product(lhs: GpuTensor, rhs: GpuTensor) -> GpuTensor {
    let (lhs, rhs) = (Factor::new(lhs), Factor::new(rhs));
    let sizes = Sizes::new(&lhs, &rhs);
    assert!(sizes.rows.min(sizes.columns).min(sizes.depth) > 0, "a product of an empty matrix");
    let tiles = sizes.rows.div_ceil(TILE) * sizes.columns.div_ceil(TILE);
    let most = match sizes.rows * sizes.columns {
        ..=LARGEST_CHUNKED => ENOUGH_GROUPS.div_ceil(tiles).min(sizes.depth.div_ceil(SMALLEST_CHUNK)),
        _ => 1,
    };
    let chunk = sizes.depth.div_ceil(most).next_multiple_of(CHUNK_MULTIPLE);
    let chunks = sizes.depth.div_ceil(chunk);
    let output = lhs.matrix.empty(chunks, sizes.rows * sizes.columns);
    let groups = CubeCount::Static(
        sizes.columns.div_ceil(TILE) as u32,
        sizes.rows.div_ceil(TILE) as u32,
        chunks as u32,
    );
    let multiply = match matrix_units::are_in(output.client()) {
        true => matrix_units::multiply::launch_unchecked,
        false => plain::multiply::launch_unchecked,
    };
    let width = lhs.matrix.width().min(rhs.matrix.width());
    // SAFETY: entries outside of the factors are zeros that are not read, and none outside of the result is written.
    unsafe {
        multiply(
            output.client(),
            groups,
            CubeDim::new_1d(PRODUCT_UNITS as u32),
            width,
            lhs.matrix.argument(width),
            rhs.matrix.argument(width),
            output.argument(1),
            sizes.rows,
            sizes.columns,
            sizes.depth,
            chunk,
            Transposed { lhs: lhs.transposed, rhs: rhs.transposed },
        );
    }
    let sum = total(output).tensor;
    GpuTensor::new_contiguous(
        sum.client,
        sum.device,
        [sizes.rows, sizes.columns].into(),
        sum.handle,
        sum.dtype,
    )
}
