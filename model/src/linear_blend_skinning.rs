//! Linear blend skinning: canonical positions to the posed body.

use burn::tensor::Tensor;

use crate::ops::{product, transform_points};

/// Moves points `[N,3]` by the weighted sum of bone transforms `[J,12]` (3×4, row-major) with weights `[N,J]`.
pub fn linear_blend_skinning(points: Tensor<2>, weights: Tensor<2>, bones: Tensor<2>) -> Tensor<2> {
    transform_points(product(weights, bones), points)
}
