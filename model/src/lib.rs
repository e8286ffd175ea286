//! The four networks of ClothCombo and the draping pipeline, on burn.
//!
//! ```text
//! E_c  garment_encoder   rest mesh → vertex embedding z_v, garment embedding z̄_v        (DiffusionNet)
//! F_s  draping           z̄_v, β, θ → draping embedding z_s
//! D_s  draping           x, z_s, z_v → displacement Δx_s                               (modulated SIREN)
//! S    skinning          x, z_s, z_v → skin weight correction ΔW
//! F_f  untangling        z_s^i, z_s^j → force f^ij
//! D_m  untangling        x_s, f^i, z_s, z_v → displacement Δx_m                        (modulated SIREN)
//!      corrections       contact features, z_s, z_v → corrected displacement          (not in the paper)
//! ```
//!
//! No files and no energies here: arrays come in as host slices ([`GarmentTensors`], [`BodyTensors`]), positions go out as
//! tensors. [`ClothCombo`] is the entry point. Networks compute in f32 on any burn device; with an autodiff device every
//! output is differentiable, with a plain one (or after `valid()`) nothing is recorded.

mod adam;
mod cloth_combo;
mod config;
mod correction;
pub mod diffusion_net;
mod draping;
mod error;
mod forward;
mod garment_encoder;
mod gradient;
mod initializer;
mod linear;
mod linear_blend_skinning;
mod mlp;
mod mode;
pub mod ops;
mod packing;
mod siren;
mod skinning;
mod surroundings;
mod tensors;
#[cfg(test)]
mod testing;
mod untangling;

pub use adam::FusedAdam;
pub use cloth_combo::{ClothCombo, Embeddings};
pub use config::{Dimensions, Graph, ModelConfig, SkinningJoints};
pub use correction::Correction;
pub use draping::Draping;
pub use error::ModelError;
pub use forward::{DrapeState, DrapeStates};
pub use garment_encoder::{GarmentEmbedding, GarmentEncoder};
pub use gradient::{clip_global_norm, gradient_bucket, gradients_of_bucket};
pub use initializer::Initializer;
pub use linear::Linear;
pub use linear_blend_skinning::linear_blend_skinning;
pub use mlp::ResidualMlp;
pub use mode::Mode;
pub use ops::Precision;
pub use packing::Packing;
pub use siren::{ModulatedSiren, Modulator, SirenSizes};
pub use skinning::Skinning;
pub use surroundings::Surroundings;
pub use tensors::{
    BodyTensors, ContactFeatureTensors, GarmentArrays, GarmentTensors, JOINT_FEATURES, OutfitTensors,
};
pub use untangling::Untangling;
