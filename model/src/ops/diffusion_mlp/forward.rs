//! From features and coefficients to features.

use std::mem::MaybeUninit;

use burn::backend::tensor::FloatTensor;

use super::{DiffusionMlp, STATES, axes};
use crate::ops::host::{Chunk, HostBackend, MatrixView, NewValues, for_each, vectorised};
use crate::ops::math::tanh;
use crate::ops::row_blocks::{factor, map_lanes, row_blocks};
use crate::ops::tensors::Tensors;
use crate::ops::tile::{OutputBlock, RightFactor, StridedMatrix};
use crate::packing::Packing;

/// The result; then, if it is `recorded`, the states of every block of rows one after the other.
pub(super) fn run<B: HostBackend>(operation: &DiffusionMlp, arguments: [FloatTensor<B>; 14]) -> Tensors<B> {
    let DiffusionMlp { recorded } = *operation;
    let held = arguments.map(B::hold);
    let views = held.each_ref().map(B::view);
    let [features, gradient_basis, basis, c, real, imaginary, diffused, gradient, input, bias, ..] = views;
    let [.., hidden, hidden_bias, output, output_bias] = views;
    let width = features.columns();
    let negative: Vec<f32> = (0..imaginary.rows()).flat_map(|row| imaginary.row(row)).map(|c| -c).collect();
    let mut negative_imaginary = RightFactor::default();
    // SAFETY: the copy has the same size.
    unsafe {
        let matrix = StridedMatrix::of_rows(&negative, width);
        negative_imaginary.fill(matrix, [imaginary.rows(), width]);
    }
    let pass = Pass {
        features,
        gradient_basis,
        basis,
        coefficients: [c, real, imaginary].map(factor),
        negative_imaginary,
        diffused: factor(diffused),
        weights: [gradient, input, hidden, output].map(factor),
        biases: [bias, hidden_bias, output_bias].map(|bias| bias.row(0)),
    };
    let blocks = row_blocks(&Packing::new([features.rows()]));
    let lengths = |columns: usize| blocks.iter().map(|block| block.rows.len() * columns).collect();
    let of_states = if recorded { STATES * width } else { 0 };
    let mut result = NewValues::new(lengths(width));
    let mut states = NewValues::new(lengths(of_states));
    let parts = result.parts().into_iter().zip(states.parts());
    for_each(blocks.iter().zip(parts).collect(), |(block, (result, states))| {
        // SAFETY: a pass writes all of the result and, if it gets memory for them, of the states.
        unsafe {
            let (result, states) = (result.unwritten(), states.unwritten());
            match recorded {
                true => pass.block(block, result, states),
                false => {
                    let mut scratch = Vec::with_capacity(STATES * result.len());
                    pass.block(block, result, scratch.spare_capacity_mut());
                }
            }
        }
    });
    let mut results = vec![B::matrix(result.finish(), width)];
    if recorded {
        results.push(B::matrix(states.finish(), STATES * width));
    }
    Tensors(results)
}

struct Pass<'a> {
    features: MatrixView<'a>,
    gradient_basis: MatrixView<'a>,
    basis: MatrixView<'a>,
    coefficients: [RightFactor; 3],
    negative_imaginary: RightFactor,
    diffused: RightFactor,
    /// Of the gradient features, of the features, of the second layer, of the output.
    weights: [RightFactor; 4],
    /// Of the first layer, of the second, of the output.
    biases: [&'a [f32]; 3],
}

impl Pass<'_> {
    /// # Safety
    /// `states` has room for the states of the block.
    unsafe fn block(&self, block: &Chunk, result: &mut [MaybeUninit<f32>], states: &mut [MaybeUninit<f32>]) {
        let (count, width, eigen) = (block.rows.len(), self.features.columns(), self.basis.columns());
        let size = count * width;
        assert!(result.len() == size && states.len() >= STATES * size);
        let first = states.as_mut_ptr().cast::<f32>();
        let place = |state: usize| OutputBlock { first: first.wrapping_add(state * size), row_stride: width };
        let result = OutputBlock { first: result.as_mut_ptr().cast(), row_stride: width };
        let [gradient, input, hidden, output] = &self.weights;
        let [c, real, imaginary] = &self.coefficients;
        let [x, y] = axes(&self.gradient_basis, block.rows.start);
        let features = self.features.strided().from(block.rows.start, 0);
        let basis = self.basis.strided().from(block.rows.start, 0);
        // SAFETY: every matrix has `count` rows of its columns, and is written before it is read.
        unsafe {
            let written = |state: usize| std::slice::from_raw_parts_mut(place(state).first, size);
            let product =
                |lhs: StridedMatrix, rhs: &RightFactor, terms: usize, to: OutputBlock, add: bool| {
                    rhs.multiply(lhs, count, 0..terms, to, add);
                };
            product(x, c, eigen, place(0), false);
            product(y, c, eigen, place(1), false);
            product(x, real, eigen, place(2), false);
            product(y, &self.negative_imaginary, eigen, place(2), true);
            product(y, real, eigen, place(3), false);
            product(x, imaginary, eigen, place(3), true);
            std::ptr::write_bytes(place(4).first, 0, size);
            let mixed = [0, 1, 2, 3].map(|state| &*written(state));
            vectorised(
                #[inline(always)]
                || gradient_features(mixed, written(4)),
            );
            product(StridedMatrix::of_rows(written(4), width), gradient, width, place(5), false);
            product(basis, &self.diffused, eigen, place(5), true);
            product(features, input, width, place(5), true);
            vectorised(
                #[inline(always)]
                || relu(written(5), self.biases[0]),
            );
            product(StridedMatrix::of_rows(written(5), width), hidden, width, place(6), false);
            vectorised(
                #[inline(always)]
                || relu(written(6), self.biases[1]),
            );
            product(StridedMatrix::of_rows(written(6), width), output, width, result, false);
            let result = std::slice::from_raw_parts_mut(result.first, size);
            vectorised(
                #[inline(always)]
                || {
                    for (row, result) in block.rows.clone().zip(result.chunks_exact_mut(width)) {
                        let (bias, features) = (&self.biases[2][..width], &self.features.row(row)[..width]);
                        for channel in 0..width {
                            result[channel] += bias[channel] + features[channel];
                        }
                    }
                },
            );
        }
    }
}

#[inline(always)]
fn gradient_features([x, y, real, imaginary]: [&[f32]; 4], features: &mut [f32]) {
    map_lanes(
        [x, y, real, imaginary],
        [features],
        #[inline(always)]
        |[x, y, real, imaginary], _| [tanh(x.mul_add(real, y * imaginary))],
    );
}

#[inline(always)]
fn relu(values: &mut [f32], bias: &[f32]) {
    for row in values.chunks_exact_mut(bias.len()) {
        for channel in 0..bias.len() {
            let sum = row[channel] + bias[channel];
            // Not `max`: a NaN must stay visible.
            row[channel] = if sum < 0.0 { 0.0 } else { sum };
        }
    }
}
