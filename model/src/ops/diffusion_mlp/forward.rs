//! From features and coefficients to features.

use std::mem::MaybeUninit;
use std::ops::Range;

use burn::backend::tensor::FloatTensor;

use crate::ops::host::{Chunk, HostBackend, NewValues, for_each, zeroed};
use crate::ops::instruction_set::vectorised;
use crate::ops::math::tanh;
use crate::ops::matrix_view::MatrixView;
use crate::ops::row_blocks::{map_lanes, row_blocks};
use crate::ops::tensors::Tensors;
use crate::ops::tile::RightFactor;
use crate::packing::Packing;

/// Matrices `[V,C]` that the backward pass reads: x0, y0, x1 − y2, y1 + x2, gradient features, both hidden layers.
pub(super) const STATES: usize = 7;

/// The gradients of the eigenvectors along both axes, at some vertices.
pub(super) fn axes<'a>(gradient_basis: MatrixView<'a>, vertices: &Range<usize>) -> [MatrixView<'a>; 2] {
    let offset = gradient_basis.rows() / 2;
    [0, offset].map(|first| gradient_basis.some_rows(first + vertices.start..first + vertices.end))
}

/// The result; then, if it is `recorded`, the states of every block of rows one after the other.
pub(super) fn run<B: HostBackend>(recorded: bool, arguments: [FloatTensor<B>; 14]) -> Tensors<B> {
    let held = arguments.map(B::hold);
    let views = held.each_ref().map(B::view);
    let [features, gradient_basis, basis, c, real, imaginary, diffused, gradient, input, bias, ..] = views;
    let [.., hidden, hidden_bias, output, output_bias] = views;
    let width = features.columns();
    let negative: Vec<f32> = (0..imaginary.rows()).flat_map(|row| imaginary.row(row)).map(|c| -c).collect();
    let negative_imaginary = RightFactor::new(MatrixView::of_rows(&negative, width));
    let [c, real, imaginary, diffused] = [c, real, imaginary, diffused].map(RightFactor::new);
    let [gradient, input, hidden, output] = [gradient, input, hidden, output].map(RightFactor::new);
    let [bias, hidden_bias, output_bias] = [bias, hidden_bias, output_bias].map(|bias| bias.row(0));

    // Writes all of the result and of the states.
    let pass = |block: &Chunk, result: &mut [MaybeUninit<f32>], states: &mut [MaybeUninit<f32>]| {
        let mut states = states.chunks_exact_mut(result.len());
        let mut state = || states.next().expect("memory for every state");
        let [along_x, along_y] = axes(gradient_basis, &block.rows);
        let x = c.product(along_x, state());
        let y = c.product(along_y, state());
        let x1 = real.product(along_x, state());
        negative_imaginary.add_product(along_y, x1);
        let y1 = real.product(along_y, state());
        imaginary.add_product(along_x, y1);
        let mixed = zeroed(state());
        vectorised(
            #[inline(always)]
            || gradient_features([x, y, x1, y1], mixed),
        );
        let first = gradient.product(MatrixView::of_rows(mixed, width), state());
        diffused.add_product(basis.some_rows(block.rows.clone()), first);
        input.add_product(features.some_rows(block.rows.clone()), first);
        vectorised(
            #[inline(always)]
            || relu(first, bias),
        );
        let second = hidden.product(MatrixView::of_rows(first, width), state());
        vectorised(
            #[inline(always)]
            || relu(second, hidden_bias),
        );
        let result = output.product(MatrixView::of_rows(second, width), result);
        vectorised(
            #[inline(always)]
            || {
                for (row, result) in block.rows.clone().zip(result.chunks_exact_mut(width)) {
                    let (bias, features) = (&output_bias[..width], &features.row(row)[..width]);
                    for channel in 0..width {
                        result[channel] += bias[channel] + features[channel];
                    }
                }
            },
        );
    };
    let blocks = row_blocks(&Packing::new([features.rows()]));
    let mut result = NewValues::of_rows(&blocks, width);
    let mut states = NewValues::of_rows(&blocks, if recorded { STATES * width } else { 0 });
    let parts = result.parts().into_iter().zip(states.parts());
    for_each(blocks.iter().zip(parts).collect(), |(block, (result, states))| {
        let mut scratch: Vec<f32> = Vec::new();
        let states = match recorded {
            true => states,
            false => {
                scratch.reserve(STATES * result.len());
                scratch.spare_capacity_mut()
            }
        };
        pass(block, result, states);
    });
    // SAFETY: a pass has written every part.
    let (result, states) = unsafe { (result.finish(), states.finish()) };
    let states = recorded.then(|| B::matrix(states, STATES * width));
    Tensors(std::iter::once(B::matrix(result, width)).chain(states).collect())
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
