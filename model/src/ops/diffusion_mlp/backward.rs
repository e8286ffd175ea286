//! From the gradient of the result to those of features, coefficients and parameters.

use std::mem::MaybeUninit;

use burn::backend::tensor::FloatTensor;

use super::forward::{STATES, axes};
use crate::ops::host::{Chunk, HostBackend, NewValues, filled};
use crate::ops::instruction_set::vectorised;
use crate::ops::matrix_view::MatrixView;
use crate::ops::row_blocks::{add_to, map_lanes, row_blocks, sum_over_blocks};
use crate::ops::tensors::Tensors;
use crate::ops::tile::RightFactor;
use crate::packing::Packing;

/// Memory of a task, used again for each of its blocks.
#[derive(Default)]
struct BlockGradients {
    matrices: [Vec<f32>; 5],
    factor: RightFactor,
    bias: Vec<f32>,
}

/// Arguments: features, both bases, weights (gradient features, features, second layer, output), states, gradient of the
/// result.
pub(super) fn run<B: HostBackend>(arguments: [FloatTensor<B>; 9]) -> Tensors<B> {
    let held = arguments.map(B::hold);
    let [features, gradient_basis, basis, gradient_weight, input, hidden, output, states, gradient] =
        held.each_ref().map(B::view);
    let (width, eigen) = (features.columns(), basis.columns());
    let [by_gradient_weight, by_input, by_hidden, by_output] =
        [gradient_weight, input, hidden, output].map(|weight| RightFactor::new(weight.transposed()));

    // Writes all of `of_features`.
    let pass = |block: &Chunk,
                of_features: &mut [MaybeUninit<f32>],
                sums: &mut [Vec<f32>; 12],
                scratch: &mut BlockGradients| {
        let [of_c, of_real, of_imaginary, subtracted, of_diffused, of_gradient_weight, rest @ ..] = sums;
        let [of_input, of_bias, of_hidden, of_hidden_bias, of_output, of_output_bias] = rest;
        let size = block.rows.len() * width;
        let BlockGradients { matrices, factor, bias } = scratch;
        matrices.iter_mut().for_each(|matrix| matrix.resize(size, 0.0));
        bias.resize(width, 0.0);
        let [a, b, of_x, of_y, of_x1] = matrices;
        let mut states = states.some_rows(block.rows.clone()).elements().chunks_exact(size);
        let [x, y, real, imaginary, gradient_features, first, second]: [&[f32]; STATES] =
            std::array::from_fn(|_| states.next().expect("every state"));
        let gradient = gradient.some_rows(block.rows.clone());
        let gradient_rows = || (0..gradient.rows()).map(|row| gradient.row(row));

        bias.fill(0.0);
        gradient_rows().for_each(|row| add_to(bias, row));
        add_to(of_output_bias, bias);
        // What comes from memory is read in its order before it is a transposed factor.
        by_output.overwrite(gradient, a);
        masked(second, a, bias);
        add_to(of_hidden_bias, bias);
        factor.fill(gradient);
        factor.add_product(MatrixView::of_rows(second, width).transposed(), of_output);
        by_hidden.overwrite(MatrixView::of_rows(a, width), b);
        masked(first, b, bias);
        add_to(of_bias, bias);
        factor.fill(MatrixView::of_rows(a, width));
        factor.add_product(MatrixView::of_rows(first, width).transposed(), of_hidden);
        factor.fill(MatrixView::of_rows(b, width));
        factor.add_product(features.some_rows(block.rows.clone()).transposed(), of_input);
        factor.add_product(basis.some_rows(block.rows.clone()).transposed(), of_diffused);
        by_input.add_product(MatrixView::of_rows(b, width), filled(of_features, gradient_rows()));
        by_gradient_weight.overwrite(MatrixView::of_rows(b, width), a);
        let of_y1 = b;
        vectorised(
            #[inline(always)]
            || mixed_gradients([x, y, real, imaginary, gradient_features], a, [of_x, of_y, of_x1, of_y1]),
        );
        factor.add_product(MatrixView::of_rows(gradient_features, width).transposed(), of_gradient_weight);
        let [along_x, along_y] = axes(gradient_basis, &block.rows).map(MatrixView::transposed);
        factor.fill(MatrixView::of_rows(of_x, width));
        factor.add_product(along_x, of_c);
        factor.fill(MatrixView::of_rows(of_y, width));
        factor.add_product(along_y, of_c);
        factor.fill(MatrixView::of_rows(of_x1, width));
        factor.add_product(along_x, of_real);
        factor.add_product(along_y, subtracted);
        factor.fill(MatrixView::of_rows(of_y1, width));
        factor.add_product(along_y, of_real);
        factor.add_product(along_x, of_imaginary);
    };
    let blocks = row_blocks(&Packing::new([features.rows()]));
    let mut of_features = NewValues::of_rows(&blocks, width);
    let (spectrum, square) = (eigen * width, width * width);
    let [of_c, of_real, mut of_imaginary, subtracted, rest @ ..] = sum_over_blocks(
        blocks.iter().zip(of_features.parts()).collect(),
        [
            spectrum, spectrum, spectrum, spectrum, spectrum, square, square, width, square, width, square,
            width,
        ],
        |(block, of_features), sums, scratch| pass(block, of_features, sums, scratch),
    );
    of_imaginary.iter_mut().zip(&subtracted).for_each(|(sum, term)| *sum -= term);
    // SAFETY: a pass has written every part.
    let of_features = unsafe { of_features.finish() };
    let all = [of_features, of_c, of_real, of_imaginary].into_iter().chain(rest);
    Tensors(all.map(|values| B::matrix(values, width)).collect())
}

/// Keeps a gradient where the unit was open, and sums its rows.
fn masked(units: &[f32], gradient: &mut [f32], sums: &mut [f32]) {
    sums.fill(0.0);
    vectorised(
        #[inline(always)]
        || {
            let width = sums.len();
            for (units, gradient) in units.chunks_exact(width).zip(gradient.chunks_exact_mut(width)) {
                for channel in 0..width {
                    let open = if units[channel] > 0.0 { gradient[channel] } else { 0.0 };
                    gradient[channel] = open;
                    sums[channel] += open;
                }
            }
        },
    );
}

/// From the gradient of the features to those of x0, y0, of x1 and −y2, of y1 and x2.
#[inline(always)]
fn mixed_gradients(
    [x, y, real, imaginary, features]: [&[f32]; 5],
    gradient: &[f32],
    [of_x, of_y, of_x1, of_y1]: [&mut [f32]; 4],
) {
    map_lanes(
        [gradient, x, y, real, imaginary, features],
        [of_x, of_y, of_x1, of_y1],
        #[inline(always)]
        |[gradient, x, y, real, imaginary, feature], _| {
            let slope = gradient * (-feature).mul_add(feature, 1.0);
            [slope * real, slope * imaginary, slope * x, slope * y]
        },
    );
}
