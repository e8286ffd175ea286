//! From the gradient of the values to those of all arguments.
//!
//! Phases and gates are read, features and everything else of the forward pass computed again.

use std::mem::{MaybeUninit, swap};

use burn::backend::tensor::FloatTensor;

use super::weights::SirenWeights;
use crate::ops::host::{Chunk, HostBackend, NewValues};
use crate::ops::instruction_set::vectorised;
use crate::ops::math::sin_cos;
use crate::ops::matrix_view::MatrixView;
use crate::ops::row_blocks::{add_to, map_lanes, row_blocks, sum_over_blocks};
use crate::ops::tensors::Tensors;
use crate::ops::tile::RightFactor;
use crate::packing::Packing;

/// Memory of a task, used again for each of its blocks.
#[derive(Default)]
struct LayerGradients {
    /// Gradients of features, which become those of phases: of this layer and of the one above.
    phases: [Vec<f32>; 2],
    /// Gradients of gates, which become those of their arguments: of this layer and of the one above.
    gates: [Vec<f32>; 2],
    features: Vec<f32>,
    factor: RightFactor,
    /// Sums over the rows of one block: of the gates' arguments and of the phases.
    sums: [Vec<f32>; 2],
}

/// Arguments: coordinates, weights (between gates, first, sines, output), phases, gates, gradient of the values.
pub(super) fn run<B: HostBackend>(
    omegas: &[f32],
    packing: &Packing,
    arguments: [FloatTensor<B>; 8],
) -> Tensors<B> {
    let held = arguments.map(B::hold);
    let [coordinates, gate_weights, first, sine_weights, output, phases, gates, gradient] =
        held.each_ref().map(B::view);
    let (width, inputs, outputs) = (output.rows(), first.rows(), output.columns());
    let (layers, all) = (omegas.len(), omegas.len() * width);
    let weights = SirenWeights::new([gate_weights, first, sine_weights, output], true);

    // Writes all of both matrices.
    let pass = |block: &Chunk,
                [of_coordinates, of_vertex_product]: [&mut [MaybeUninit<f32>]; 2],
                sums: &mut [Vec<f32>; 7],
                scratch: &mut LayerGradients| {
        let [of_rows, of_gates, of_first, of_sines, of_biases, of_output, of_output_bias] = sums;
        let size = block.rows.len() * width;
        let LayerGradients { phases: [below, above], gates: [gates_below, gates_above], .. } = scratch;
        let LayerGradients { features, factor, sums: [of_shared, of_bias], .. } = scratch;
        for matrix in [&mut *below, above, gates_below, gates_above, features] {
            matrix.resize(size, 0.0);
        }
        for sums in [&mut *of_shared, of_bias] {
            sums.resize(width, 0.0);
        }
        // Phases and gates of a block lie layer after layer.
        let [phases, gates] = [phases, gates].map(|states| states.some_rows(block.rows.clone()).elements());
        let gradient = gradient.some_rows(block.rows.clone());
        (0..gradient.rows()).for_each(|row| add_to(of_output_bias, gradient.row(row)));
        weights.output.overwrite(gradient, below);
        gates_below.fill(0.0);
        for (layer, omega) in omegas.iter().enumerate().rev() {
            let columns = layer * width..(layer + 1) * width;
            let place = layer * size..(layer + 1) * size;
            let (phase, gate) = (&phases[place.clone()], &gates[place]);
            of_shared.fill(0.0);
            of_bias.fill(0.0);
            vectorised(
                #[inline(always)]
                || {
                    layer_gradients(
                        [phase, gate],
                        *omega,
                        [below, gates_below, features],
                        [of_shared, of_bias],
                    );
                },
            );
            let rows = of_vertex_product.chunks_exact_mut(all).zip(gates_below.chunks_exact(width));
            for (of_row, of_arguments) in rows {
                of_row[columns.clone()].write_copy_of_slice(of_arguments);
            }
            let in_rows = block.garment * all + columns.start;
            add_to(&mut of_rows[in_rows..in_rows + width], of_shared);
            add_to(&mut of_biases[columns], of_bias);
            let square = layer * width * width..(layer + 1) * width * width;
            if layer + 1 == layers {
                factor.fill(gradient);
                factor.add_product(MatrixView::of_rows(features, width).transposed(), of_output);
            } else {
                factor.fill(MatrixView::of_rows(above, width));
                factor.add_product(
                    MatrixView::of_rows(features, width).transposed(),
                    &mut of_sines[square.clone()],
                );
                // Not where the layer above is done: these gates have been read in their order since, and are at hand.
                factor.fill(MatrixView::of_rows(gates_above, width));
                factor.add_product(MatrixView::of_rows(gate, width).transposed(), &mut of_gates[square]);
            }
            if layer > 0 {
                weights.gates[layer - 1].overwrite(MatrixView::of_rows(gates_below, width), gates_above);
                weights.sines[layer].overwrite(MatrixView::of_rows(below, width), above);
                swap(below, above);
                swap(gates_below, gates_above);
            }
        }
        factor.fill(MatrixView::of_rows(below, width));
        factor.add_product(coordinates.some_rows(block.rows.clone()).transposed(), of_first);
        weights.sines[0].product(MatrixView::of_rows(below, width), of_coordinates);
    };
    let blocks = row_blocks(packing);
    let mut of_rows = [inputs, all].map(|columns| NewValues::of_rows(&blocks, columns));
    let [of_coordinates, of_vertex_product] = of_rows.each_mut().map(NewValues::parts);
    let parts = of_coordinates.into_iter().zip(of_vertex_product).map(|(a, b)| [a, b]);
    let squares = (layers - 1) * width * width;
    let sums = sum_over_blocks(
        blocks.iter().zip(parts).collect(),
        [packing.count() * all, squares, inputs * width, squares, all, width * outputs, outputs],
        |(block, parts), sums, scratch| pass(block, parts, sums, scratch),
    );
    // SAFETY: a pass has written every part.
    let of_rows = of_rows.map(|values| unsafe { values.finish() });
    let columns = [inputs, all, all, width, width, width, all, outputs, outputs];
    let values = of_rows.into_iter().chain(sums).zip(columns);
    Tensors(values.map(|(values, columns)| B::matrix(values, columns)).collect())
}

/// Gradients of features become those of phases, gradients of gates those of their arguments, and the features return.
#[inline(always)]
fn layer_gradients(
    [phases, gates]: [&[f32]; 2],
    omega: f32,
    [of_phases, of_gates, features]: [&mut [f32]; 3],
    [of_shared, of_bias]: [&mut [f32]; 2],
) {
    let width = of_bias.len();
    for row in 0..phases.len() / width {
        let units = row * width..(row + 1) * width;
        map_lanes(
            [&phases[units.clone()], &gates[units.clone()]],
            [
                &mut of_phases[units.clone()],
                &mut of_gates[units.clone()],
                &mut features[units],
                &mut of_shared[..width],
                &mut of_bias[..width],
            ],
            #[inline(always)]
            |[phase, gate], [gradient, of_gate, _, of_shared, of_bias]| {
                let (sine, cosine) = sin_cos(phase);
                let of_argument = if gate > 0.0 { sine * gradient + of_gate } else { 0.0 };
                let of_phase = omega * cosine * gate * gradient;
                [of_phase, of_argument, sine * gate, of_shared + of_argument, of_bias + of_phase]
            },
        );
    }
}
