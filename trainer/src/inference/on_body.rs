//! What the networks drape: an outfit on a body.

use crate::dataset::PreparedScene;
use burn::tensor::Tensor;
use clothcombo_model::{BodyTensors, Embeddings, OutfitTensors};

/// An outfit with its embeddings on the first body of a scene.
pub struct OnBody<'a> {
    /// The scene.
    pub scene: &'a PreparedScene,
    /// Its garments.
    pub outfit: &'a OutfitTensors,
    /// Their embeddings.
    pub embeddings: &'a Embeddings,
    /// Its first body.
    pub body: &'a BodyTensors,
    /// Where the garments start on it `[ΣV, 3]` (m).
    pub start: Tensor<2>,
}
