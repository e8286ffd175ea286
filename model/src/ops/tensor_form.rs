//! The operations composed of burn's own differentiable ones: the oracle of the fused forms.

use burn::tensor::Tensor;

use super::{Activation, Segments};

/// Gives every row its segment's row of `[M,C]`: `[N,C]`.
pub(crate) fn broadcast(rows: Tensor<2>, segments: &Segments) -> Tensor<2> {
    let columns = rows.dims()[1];
    let blocks = segments.ranges().into_iter().enumerate().map(|(segment, range)| {
        rows.clone().slice([segment..segment + 1, 0..columns]).expand([range.len(), columns])
    });
    Tensor::cat(blocks.collect(), 0)
}

/// The activation alone.
pub(crate) fn apply(activation: Activation, sum: Tensor<2>) -> Tensor<2> {
    match activation {
        Activation::Identity => sum,
        Activation::Relu => burn::tensor::activation::relu(sum),
        // burn's own `gelu` differentiates the tanh form on some backends.
        Activation::Gelu => {
            let distribution = (sum.clone() * std::f64::consts::FRAC_1_SQRT_2).erf() * 0.5 + 0.5;
            sum * distribution
        }
    }
}

/// [`super::sine_modulation`].
pub(crate) fn sine_modulation(input: Tensor<2>, bias: Tensor<2>, gate: Tensor<2>, omega: f64) -> Tensor<2> {
    ((input + bias) * omega).sin() * gate
}

/// [`super::split_columns`].
pub(crate) fn split_columns(wide: Tensor<2>, width: usize, count: usize) -> Vec<Tensor<2>> {
    (0..count).map(|block| wide.clone().narrow(1, block * width, width)).collect()
}

/// [`super::gradient_features`].
pub(crate) fn gradient_features(mixed: Tensor<2>) -> Tensor<2> {
    let [rows, columns] = mixed.dims();
    let (vertices, width) = (rows / 2, columns / 3);
    let block = |axis: usize, part: usize| {
        let rows = axis * vertices..(axis + 1) * vertices;
        mixed.clone().slice([rows, part * width..(part + 1) * width])
    };
    let real = block(0, 1) - block(1, 2);
    let imaginary = block(1, 1) + block(0, 2);
    (block(0, 0) * real + block(1, 0) * imaginary).tanh()
}

/// [`super::skin_correction`].
pub(crate) fn skin_correction(
    weights: Tensor<2>,
    raw: Tensor<2>,
    mask: Tensor<2>,
    segments: &Segments,
    scale: f64,
    zero_sum: bool,
) -> Tensor<2> {
    let masked = raw * broadcast(mask.clone(), segments);
    let share = broadcast(mask.clone() / mask.sum_dim(1).clamp_min(1.0), segments);
    let sum = masked.clone().sum_dim(1);
    let projected = if zero_sum { masked - share * sum } else { masked };
    weights + projected * scale
}

/// [`super::transform_points`].
pub(crate) fn transform_points(transforms: Tensor<2>, points: Tensor<2>) -> Tensor<2> {
    let rows = points.dims()[0];
    let transforms = transforms.reshape([rows, 3, 4]);
    let linear = transforms.clone().slice([0..rows, 0..3, 0..3]);
    let offset = transforms.slice([0..rows, 0..3, 3..4]).reshape([rows, 3]);
    (linear * points.reshape([rows, 1, 3])).sum_dim(2).reshape([rows, 3]) + offset
}
