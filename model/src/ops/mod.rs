//! Operations the networks are made of, fused where burn's own are slow.
//!
//! Each file holds one operation: what it computes, as kernels of a GPU (`gpu`) and in one pass over host memory (vectorised
//! for the CPU found at run time, parallel over fixed row chunks, hence bit-identical for any number of threads), and its
//! hand-written backward pass. `modulated_siren` and `diffusion_mlp` are several layers at once and run in host memory only;
//! GPUs have their layers one by one, of which `sine_modulation` and `gradient_features` are fused for them. Below lie
//! `operation` (how a backend runs and records one), `host` (loops over rows), `row_blocks` (several layers in one such loop),
//! `math`, `gemm` and `tile`, which know no operation.

// Without a backend in host memory nothing runs the host kernels.
#![cfg_attr(not(any(feature = "flex", feature = "ndarray")), allow(dead_code, unused_imports))]

mod activation;
mod adam;
mod blend;
mod diffusion_mlp;
#[cfg(feature = "flex")]
mod gemm;
#[cfg(feature = "gpu")]
mod gpu;
mod gradient_features;
mod host;
mod instruction_set;
mod math;
mod matrix_view;
mod modulated_siren;
mod norm;
mod operation;
mod product;
mod row_blocks;
mod sine_modulation;
mod skin_correction;
mod split_columns;
mod tensors;
#[cfg(test)]
mod tests;
mod tile;
mod transform_points;

pub use activation::{Activation, activate, activate_packed, activate_packed_sum, activate_residual};
pub use adam::{AdamFactors, adam_step};
pub use blend::blend;
pub use diffusion_mlp::diffusion_mlp;
pub use gradient_features::gradient_features;
pub use host::lies_on_host;
pub use modulated_siren::modulated_siren;
pub use norm::{scale_by, squared_norm};
pub use product::{product, product_add};
pub use sine_modulation::sine_modulation;
pub use skin_correction::skin_correction;
pub use split_columns::split_columns;
pub use transform_points::transform_points;
