//! Constant tensors the networks read: one garment, the garments of an outfit, one posed body.
//!
//! All of them live on a plain (non-autodiff) device; an operation that combines them with tracked tensors treats them as
//! constants, so the same tensors serve training and inference.

mod body;
mod contact_features;
mod garment;
mod outfit;

pub use body::{BodyTensors, JOINT_FEATURES};
pub use contact_features::ContactFeatureTensors;
pub use garment::{GarmentArrays, GarmentTensors};
pub use outfit::OutfitTensors;
pub(crate) use outfit::{ForceEdges, stack_rows};

use burn::tensor::{Device, Tensor, TensorData};

/// A row-major matrix on the device.
pub(crate) fn matrix(values: Vec<f32>, rows: usize, columns: usize, device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(values, [rows, columns]), device)
}
