//! The operation as tensor operations, on any backend.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::{Shape, Slice};

use super::{Activation, ActivationGradients, Saved};
use crate::ops::segments::ranges;

pub(in crate::ops) fn forward<B: Backend>(
    terms: Vec<FloatTensor<B>>,
    rows: FloatTensor<B>,
    residual: Option<FloatTensor<B>>,
    ends: &[usize],
    activation: Activation,
) -> FloatTensor<B> {
    let sum = sum::<B>(terms, rows, ends);
    let value = match activation {
        Activation::Identity => sum,
        Activation::Relu => B::float_clamp_min(sum, 0.0.into()),
        Activation::Gelu => B::float_mul(sum.clone(), normal_distribution::<B>(sum)),
    };
    match residual {
        Some(residual) => B::float_add(value, residual),
        None => value,
    }
}

pub(in crate::ops) fn backward<B: Backend>(
    saved: Saved<B>,
    gradient: FloatTensor<B>,
    ends: &[usize],
    activation: Activation,
) -> ActivationGradients<B> {
    let sum = match saved {
        Saved::Nothing => None,
        Saved::Output(output) => Some(output),
        Saved::Arguments(terms, rows) => Some(sum::<B>(terms, rows, ends)),
    };
    let input = match (activation, sum) {
        (Activation::Identity, _) | (_, None) => gradient,
        // The sign of max(x, 0) is the derivative: one above zero, zero elsewhere.
        (Activation::Relu, Some(sum)) => {
            B::float_mul(B::float_sign(B::float_clamp_min(sum, 0.0.into())), gradient)
        }
        (Activation::Gelu, Some(sum)) => {
            let square = B::float_mul(sum.clone(), sum.clone());
            let density = B::float_exp(B::float_mul_scalar(square, (-0.5).into()));
            let density = B::float_mul_scalar(
                density,
                (0.5 * std::f64::consts::FRAC_2_SQRT_PI * std::f64::consts::FRAC_1_SQRT_2).into(),
            );
            let slope = B::float_add(normal_distribution::<B>(sum.clone()), B::float_mul(sum, density));
            B::float_mul(slope, gradient)
        }
    };
    let sums = ranges(ends).map(|range| B::float_sum_dim(row_block::<B>(input.clone(), range), 0)).collect();
    (input, concatenate::<B>(sums))
}

fn sum<B: Backend>(terms: Vec<FloatTensor<B>>, rows: FloatTensor<B>, ends: &[usize]) -> FloatTensor<B> {
    let shared = broadcast_rows::<B>(rows, ends);
    terms.into_iter().fold(shared, |sum, term| B::float_add(term, sum))
}

/// Repeats the row of every segment; a lone row is left to broadcast.
pub(in crate::ops) fn broadcast_rows<B: Backend>(rows: FloatTensor<B>, ends: &[usize]) -> FloatTensor<B> {
    if ends.len() == 1 {
        return rows;
    }
    let columns = rows.shape()[1];
    let blocks = ranges(ends).enumerate().map(|(segment, range)| {
        let row = row_block::<B>(rows.clone(), segment..segment + 1);
        B::float_expand(row, Shape::new([range.len(), columns]))
    });
    concatenate::<B>(blocks.collect())
}

fn row_block<B: Backend>(matrix: FloatTensor<B>, rows: std::ops::Range<usize>) -> FloatTensor<B> {
    let columns = matrix.shape()[1];
    B::float_slice(matrix, &[Slice::from(rows), Slice::from(0..columns)])
}

fn concatenate<B: Backend>(mut blocks: Vec<FloatTensor<B>>) -> FloatTensor<B> {
    match blocks.len() {
        1 => blocks.remove(0),
        _ => B::float_cat(blocks, 0),
    }
}

fn normal_distribution<B: Backend>(x: FloatTensor<B>) -> FloatTensor<B> {
    let erf = B::float_erf(B::float_mul_scalar(x, std::f64::consts::FRAC_1_SQRT_2.into()));
    B::float_add_scalar(B::float_mul_scalar(erf, 0.5.into()), 0.5.into())
}
