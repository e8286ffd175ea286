//! Operations the networks are made of, fused where burn's own are slow.
//!
//! Each file holds one operation: what it computes, its kernel for host memory (vectorised for the CPU found at run time,
//! parallel over fixed row chunks, hence bit-identical for any number of threads), its composition of backend operations
//! for every other device, and its hand-written backward pass. `tensor_form` composes the same mathematics from burn's own
//! differentiable operations and is what the tests compare with.

// Without a backend in host memory nothing runs the host kernels.
#![cfg_attr(not(any(feature = "flex", feature = "ndarray")), allow(dead_code, unused_imports))]

mod activation;
mod adam;
mod backend;
mod gradient_features;
mod host;
mod kernels;
mod math;
mod norm;
mod product;
mod segments;
mod sine_modulation;
mod skin_correction;
mod split_columns;
#[cfg(test)]
pub(crate) mod tensor_form;
#[cfg(test)]
mod tests;
mod transform_points;

pub use activation::{Activation, activate, activate_residual, segment_activate, segment_activate_sum};
pub use adam::{AdamFactors, adam_step};
pub use gradient_features::gradient_features;
pub use norm::{scale_by, squared_norm};
pub use product::{product, product_add};
pub use segments::Segments;
pub use sine_modulation::sine_modulation;
pub use skin_correction::skin_correction;
pub use split_columns::split_columns;
pub use transform_points::transform_points;
