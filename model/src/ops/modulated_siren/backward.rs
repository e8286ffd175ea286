//! From the gradient of the values to those of all arguments.
//!
//! Phases and gates are read, features and everything else of the forward pass computed again.

use burn::backend::tensor::FloatTensor;

use super::{ModulatedSirenLayers, Weights};
use crate::ops::host::{Chunk, HostBackend, MatrixView, NewPart, NewValues, vectorised};
use crate::ops::math::sin_cos;
use crate::ops::row_blocks::{add_to, map_lanes, row_blocks, sum_over_blocks};
use crate::ops::tensors::Tensors;
use crate::ops::tile::{OutputBlock, RightFactor, StridedMatrix};

/// Arguments: coordinates, weights (between gates, first, sines, output), phases, gates, gradient of the values.
pub(super) fn run<B: HostBackend>(
    operation: &ModulatedSirenLayers,
    arguments: [FloatTensor<B>; 8],
) -> Tensors<B> {
    let held = arguments.map(B::hold);
    let [coordinates, gate_weights, first, sine_weights, output, phases, gates, gradient] =
        held.each_ref().map(B::view);
    let (width, inputs, outputs) = (output.rows(), first.rows(), output.columns());
    let layers = operation.omegas.len();
    let garments = operation.packing.count();
    let pass = Pass {
        coordinates,
        gradient,
        phases,
        gates,
        weights: Weights::new([gate_weights, first, sine_weights, output], true),
        omegas: &operation.omegas,
        width,
    };
    let blocks = row_blocks(&operation.packing);
    let lengths = |columns: usize| blocks.iter().map(|block| block.rows.len() * columns).collect();
    let mut of_coordinates = NewValues::new(lengths(inputs));
    let mut of_vertex_product = NewValues::new(lengths(layers * width));
    let rows = of_coordinates.parts().into_iter().zip(of_vertex_product.parts());
    let (all, squares) = (layers * width, (layers - 1) * width * width);
    let sums = sum_over_blocks(
        blocks.iter().zip(rows).collect(),
        [garments * all, squares, inputs * width, squares, all, width * outputs, outputs],
        |(block, rows), sums, scratch| pass.block(block, rows, sums, scratch),
    );
    let columns = [all, width, width, width, all, outputs, outputs];
    let rows = [(of_coordinates, inputs), (of_vertex_product, all)];
    let rows = rows.map(|(values, columns)| B::matrix(values.finish(), columns));
    let sums = sums.into_iter().zip(columns).map(|(sums, columns)| B::matrix(sums, columns));
    Tensors(rows.into_iter().chain(sums).collect())
}

/// Memory of a task, used again for each of its blocks.
#[derive(Default)]
struct Scratch {
    /// Gradients of features, which become those of phases: of this layer and of the one above.
    phases: [Vec<f32>; 2],
    /// Gradients of gates, which become those of their arguments: of this layer and of the one above.
    gates: [Vec<f32>; 2],
    features: Vec<f32>,
    factor: RightFactor,
    /// Sums over the rows of one block: of the gates' arguments and of the phases.
    sums: [Vec<f32>; 2],
}

struct Pass<'a> {
    coordinates: MatrixView<'a>,
    gradient: MatrixView<'a>,
    phases: MatrixView<'a>,
    gates: MatrixView<'a>,
    weights: Weights,
    omegas: &'a [f32],
    width: usize,
}

impl Pass<'_> {
    fn block(
        &self,
        block: &Chunk,
        (of_coordinates, of_vertex_product): (NewPart<'_>, NewPart<'_>),
        sums: &mut [Vec<f32>; 7],
        scratch: &mut Scratch,
    ) {
        let [of_rows, of_gates, of_first, of_sines, of_biases, of_output, of_output_bias] = sums;
        let (count, width, layers) = (block.rows.len(), self.width, self.omegas.len());
        let (inputs, outputs) = (self.coordinates.columns(), self.gradient.columns());
        let size = count * width;
        let Scratch { phases, gates, features, factor: right, sums: block_sums } = scratch;
        for matrix in phases.iter_mut().chain(gates.iter_mut()).chain([&mut *features]) {
            matrix.resize(size, 0.0);
        }
        for sums in block_sums.iter_mut() {
            sums.resize(width, 0.0);
        }
        let [below, above] = phases;
        let [gates_below, gates_above] = gates;
        // Phases and gates of a block lie layer after layer.
        let state = |states: &MatrixView<'_>, layer: usize| {
            let first = states.strided().from(block.rows.start, 0).first.wrapping_add(layer * size);
            // SAFETY: the block's rows hold `layers` matrices of this size.
            unsafe { std::slice::from_raw_parts(first, size) }
        };
        let (gradient, coordinates) = (
            self.gradient.strided().from(block.rows.start, 0),
            self.coordinates.strided().from(block.rows.start, 0),
        );
        // SAFETY: the memory is written before anybody reads it.
        let of_vertex_product = unsafe { of_vertex_product.unwritten() };
        let of_vertex_product = of_vertex_product.as_mut_ptr().cast::<f32>();
        for row in block.rows.clone() {
            add_to(of_output_bias, self.gradient.row(row));
        }
        // SAFETY (all products): every matrix has `count` rows of the columns it is multiplied with.
        unsafe {
            self.weights.output.multiply(
                gradient,
                count,
                0..outputs,
                OutputBlock::of_rows(below, width),
                false,
            );
        }
        gates_below[..size].fill(0.0);
        for (layer, omega) in self.omegas.iter().enumerate().rev() {
            let columns = layer * width..(layer + 1) * width;
            let (phase, gate) = (state(&self.phases, layer), state(&self.gates, layer));
            block_sums.iter_mut().for_each(|sums| sums.fill(0.0));
            let [of_shared, of_bias] = block_sums;
            // SAFETY: the block of the output that belongs to this layer, which nobody else uses.
            let of_own = |row: usize| unsafe {
                std::slice::from_raw_parts_mut(
                    of_vertex_product.add(row * layers * width + columns.start),
                    width,
                )
            };
            vectorised(
                #[inline(always)]
                || {
                    let (below, gates_below) = (&mut below[..size], &mut gates_below[..size]);
                    layer_gradients(
                        [phase, gate],
                        *omega,
                        [below, gates_below, &mut features[..size]],
                        of_own,
                        [of_shared, of_bias],
                    );
                },
            );
            let in_rows = block.garment * layers * width + columns.start;
            add_to(&mut of_rows[in_rows..in_rows + width], of_shared);
            add_to(&mut of_biases[columns], of_bias);
            // SAFETY: as above; sums have the size of the weight.
            unsafe {
                let factor = StridedMatrix::of_rows(features, width).transposed();
                if layer + 1 == layers {
                    right.fill(gradient, [count, outputs]);
                    let sums = OutputBlock::of_rows(of_output, outputs);
                    right.multiply(factor, width, 0..count, sums, true);
                } else {
                    right.fill(StridedMatrix::of_rows(above, width), [count, width]);
                    let sums = OutputBlock::of_rows(&mut of_sines[layer * width * width..], width);
                    right.multiply(factor, width, 0..count, sums, true);
                }
                if layer + 1 < layers {
                    // Not where the layer above is done: these gates have been read in their order since, and are at hand.
                    right.fill(StridedMatrix::of_rows(gates_above, width), [count, width]);
                    let factor = StridedMatrix::of_rows(gate, width).transposed();
                    let of_weight = OutputBlock::of_rows(&mut of_gates[layer * width * width..], width);
                    right.multiply(factor, width, 0..count, of_weight, true);
                }
                if layer > 0 {
                    let of_gate = StridedMatrix::of_rows(gates_below, width);
                    let output = OutputBlock::of_rows(gates_above, width);
                    self.weights.gates[layer - 1].multiply(of_gate, count, 0..width, output, false);
                    let output = OutputBlock::of_rows(above, width);
                    let of_phase = StridedMatrix::of_rows(below, width);
                    self.weights.sine(layer).multiply(of_phase, count, 0..width, output, false);
                    std::mem::swap(below, above);
                    std::mem::swap(gates_below, gates_above);
                }
            }
        }
        // SAFETY: as above; all elements are written.
        unsafe {
            right.fill(StridedMatrix::of_rows(below, width), [count, width]);
            let of_weight = OutputBlock::of_rows(of_first, width);
            right.multiply(coordinates.transposed(), inputs, 0..count, of_weight, true);
            let of_coordinates = of_coordinates.unwritten().as_mut_ptr().cast();
            let of_coordinates = OutputBlock { first: of_coordinates, row_stride: inputs };
            let of_phase = StridedMatrix::of_rows(below, width);
            self.weights.first.multiply(of_phase, count, 0..width, of_coordinates, false);
        }
    }
}

/// Gradients of features become those of phases, gradients of gates those of their arguments, and the features return.
#[inline(always)]
fn layer_gradients<'a>(
    [phases, gates]: [&[f32]; 2],
    omega: f32,
    [of_phases, of_gates, features]: [&mut [f32]; 3],
    of_own: impl Fn(usize) -> &'a mut [f32],
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
                of_own(row),
                &mut of_shared[..width],
                &mut of_bias[..width],
            ],
            #[inline(always)]
            |[phase, gate], [gradient, of_gate, _, _, of_shared, of_bias]| {
                let (sine, cosine) = sin_cos(phase);
                let of_argument = if gate > 0.0 { sine * gradient + of_gate } else { 0.0 };
                let of_phase = omega * cosine * gate * gradient;
                [of_phase, of_argument, sine * gate, of_argument, of_shared + of_argument, of_bias + of_phase]
            },
        );
    }
}
