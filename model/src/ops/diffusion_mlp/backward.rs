//! From the gradient of the result to those of features, coefficients and parameters.

use burn::backend::tensor::FloatTensor;

use super::{STATES, axes};
use crate::ops::host::{Chunk, HostBackend, MatrixView, NewPart, NewValues, vectorised};
use crate::ops::row_blocks::{add_to, map_lanes, row_blocks, sum_over_blocks, transposed_factor};
use crate::ops::tensors::Tensors;
use crate::ops::tile::{OutputBlock, RightFactor, StridedMatrix};
use crate::packing::Packing;

/// Arguments: features, both bases, weights (gradient features, features, second layer, output), states, gradient of the
/// result.
pub(super) fn run<B: HostBackend>(arguments: [FloatTensor<B>; 9]) -> Tensors<B> {
    let held = arguments.map(B::hold);
    let [features, gradient_basis, basis, gradient_weight, input, hidden, output, states, gradient] =
        held.each_ref().map(B::view);
    let (width, eigen) = (features.columns(), basis.columns());
    let weights = [gradient_weight, input, hidden, output].map(transposed_factor);
    let pass = Pass { features, gradient_basis, basis, states, gradient, weights };
    let blocks = row_blocks(&Packing::new([features.rows()]));
    let lengths = blocks.iter().map(|block| block.rows.len() * width).collect();
    let mut of_features = NewValues::new(lengths);
    let (spectrum, square) = (eigen * width, width * width);
    let [of_c, of_real, mut of_imaginary, subtracted, rest @ ..] = sum_over_blocks(
        blocks.iter().zip(of_features.parts()).collect(),
        [
            spectrum, spectrum, spectrum, spectrum, spectrum, square, square, width, square, width, square,
            width,
        ],
        |(block, of_features), sums, scratch| pass.block(block, of_features, sums, scratch),
    );
    of_imaginary.iter_mut().zip(&subtracted).for_each(|(sum, term)| *sum -= term);
    let sums = [of_c, of_real, of_imaginary].into_iter().chain(rest);
    let of_features = B::matrix(of_features.finish(), width);
    Tensors(std::iter::once(of_features).chain(sums.map(|sums| B::matrix(sums, width))).collect())
}

/// Memory of a task, used again for each of its blocks.
#[derive(Default)]
struct Scratch {
    matrices: [Vec<f32>; 5],
    factor: RightFactor,
    bias: Vec<f32>,
}

struct Pass<'a> {
    features: MatrixView<'a>,
    gradient_basis: MatrixView<'a>,
    basis: MatrixView<'a>,
    states: MatrixView<'a>,
    gradient: MatrixView<'a>,
    /// Transposed: of the gradient features, of the features, of the second layer, of the output.
    weights: [RightFactor; 4],
}

impl Pass<'_> {
    fn block(
        &self,
        block: &Chunk,
        of_features: NewPart<'_>,
        sums: &mut [Vec<f32>; 12],
        scratch: &mut Scratch,
    ) {
        let (count, width, eigen) = (block.rows.len(), self.features.columns(), self.basis.columns());
        let (start, size) = (block.rows.start, count * width);
        let [
            of_c,
            of_real,
            of_imaginary,
            subtracted,
            of_diffused,
            of_gradient_weight,
            of_input,
            of_bias,
            of_hidden,
            of_hidden_bias,
            of_output,
            of_output_bias,
        ] = sums;
        let Scratch { matrices, factor, bias } = scratch;
        matrices.iter_mut().for_each(|matrix| matrix.resize(size, 0.0));
        bias.resize(width, 0.0);
        let [a, b, of_x, of_y, of_x1] = matrices;
        let states = self.states.strided().from(start, 0).first;
        // SAFETY: the block's rows hold as many matrices of this size.
        let state = |index: usize| unsafe { std::slice::from_raw_parts(states.add(index * size), size) };
        let [x, y, real, imaginary, gradient_features, first, second]: [&[f32]; STATES] =
            std::array::from_fn(state);
        let matrix = |values: &[f32]| StridedMatrix::of_rows(values, width);
        let to = |values: &mut [f32]| OutputBlock::of_rows(values, width);
        let gradient = self.gradient.strided().from(start, 0);
        let features = self.features.strided().from(start, 0);
        let [weight_gradient, weight_input, weight_hidden, weight_output] = &self.weights;

        bias.fill(0.0);
        block.rows.clone().for_each(|row| add_to(bias, self.gradient.row(row)));
        add_to(of_output_bias, bias);
        // SAFETY (all products): every matrix has `count` rows of the columns it is multiplied with, sums the size of the
        // product; the gradient of the features is written before it is added to.
        unsafe {
            let sum = |lhs: StridedMatrix, rows: usize, factor: &RightFactor, sums: &mut [f32]| {
                factor.multiply(lhs.transposed(), rows, 0..count, to(sums), true);
            };
            // What comes from memory is read in its order before it is a transposed factor.
            weight_output.multiply(gradient, count, 0..width, to(a), false);
            masked(second, a, bias);
            add_to(of_hidden_bias, bias);
            factor.fill(gradient, [count, width]);
            sum(matrix(second), width, factor, of_output);
            weight_hidden.multiply(matrix(a), count, 0..width, to(b), false);
            masked(first, b, bias);
            add_to(of_bias, bias);
            factor.fill(matrix(a), [count, width]);
            sum(matrix(first), width, factor, of_hidden);
            factor.fill(matrix(b), [count, width]);
            sum(features, width, factor, of_input);
            sum(self.basis.strided().from(start, 0), eigen, factor, of_diffused);
            let of_features = of_features.unwritten().as_mut_ptr().cast::<f32>();
            for (index, row) in block.rows.clone().enumerate() {
                let from = self.gradient.row(row).as_ptr();
                std::ptr::copy_nonoverlapping(from, of_features.add(index * width), width);
            }
            let of_features = OutputBlock { first: of_features, row_stride: width };
            weight_input.multiply(matrix(b), count, 0..width, of_features, true);
            weight_gradient.multiply(matrix(b), count, 0..width, to(a), false);
            let of_y1 = b;
            vectorised(
                #[inline(always)]
                || mixed_gradients([x, y, real, imaginary, gradient_features], a, [of_x, of_y, of_x1, of_y1]),
            );
            sum(matrix(gradient_features), width, factor, of_gradient_weight);
            let [along_x, along_y] = axes(&self.gradient_basis, start);
            factor.fill(matrix(of_x), [count, width]);
            sum(along_x, eigen, factor, of_c);
            factor.fill(matrix(of_y), [count, width]);
            sum(along_y, eigen, factor, of_c);
            factor.fill(matrix(of_x1), [count, width]);
            sum(along_x, eigen, factor, of_real);
            sum(along_y, eigen, factor, subtracted);
            factor.fill(matrix(of_y1), [count, width]);
            sum(along_y, eigen, factor, of_real);
            sum(along_x, eigen, factor, of_imaginary);
        }
    }
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
