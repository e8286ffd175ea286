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
mod matrix;
mod norm;
mod product;
mod sine_modulation;
mod skin_correction;
mod transform_points;

pub(super) use activation::{activated_sum, activated_sum_gradients};
pub(super) use adam::adam;
pub(super) use blend::blend;
pub(super) use gradient_features::gradient_features;
pub(super) use norm::{scale, squared_norm};
pub(super) use product::product;
pub(super) use sine_modulation::sine_modulation;
pub(super) use skin_correction::projection;
pub(super) use transform_points::{transform_gradients, transform_points};
