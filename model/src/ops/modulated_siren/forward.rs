//! From coordinates and the gates' arguments to values.

use std::mem::MaybeUninit;

use burn::backend::tensor::FloatTensor;

use super::{ModulatedSirenLayers, Weights};
use crate::ops::host::{Chunk, HostBackend, MatrixView, NewValues, for_each, vectorised};
use crate::ops::math::sin_cos;
use crate::ops::row_blocks::{map_lanes, row_blocks};
use crate::ops::tensors::Tensors;
use crate::ops::tile::{OutputBlock, StridedMatrix};

/// The values; then, if the operation is recorded, phases and gates of every block of rows, layer after layer.
pub(super) fn run<B: HostBackend>(
    operation: &ModulatedSirenLayers,
    arguments: [FloatTensor<B>; 9],
) -> Tensors<B> {
    let held = arguments.map(B::hold);
    let [coordinates, vertex_product, rows, gate_weights, first, sine_weights, biases, output, output_bias] =
        held.each_ref().map(B::view);
    let (width, outputs) = (output.rows(), output.columns());
    let layers = operation.omegas.len();
    let pass = Pass {
        coordinates,
        vertex_product,
        rows,
        biases: biases.row(0),
        output_bias: output_bias.row(0),
        weights: Weights::new([gate_weights, first, sine_weights, output], false),
        omegas: &operation.omegas,
        width,
    };
    let blocks = row_blocks(&operation.packing);
    let lengths = |columns: usize| blocks.iter().map(|block| block.rows.len() * columns).collect();
    let mut values = NewValues::new(lengths(outputs));
    let of_layers = if operation.recorded { layers * width } else { 0 };
    let mut states = [(); 2].map(|()| NewValues::new(lengths(of_layers)));
    let [phases, gates] = states.each_mut().map(NewValues::parts);
    let parts = values.parts().into_iter().zip(phases.into_iter().zip(gates));
    for_each(blocks.iter().zip(parts).collect(), |(block, (values, (phases, gates)))| {
        // SAFETY: a pass writes all of the values, and of every layer's phases and gates if it keeps them.
        unsafe {
            let (values, phases, gates) = (values.unwritten(), phases.unwritten(), gates.unwritten());
            match operation.recorded {
                true => pass.block(block, values, [phases, gates], layers),
                false => {
                    let mut scratch = [(); 2].map(|()| Vec::with_capacity(2 * block.rows.len() * width));
                    pass.block(block, values, scratch.each_mut().map(|s| s.spare_capacity_mut()), 2);
                }
            }
        }
    });
    let [phases, gates] = states.map(NewValues::finish);
    let mut results = vec![B::matrix(values.finish(), outputs)];
    if operation.recorded {
        results.extend([phases, gates].map(|state| B::matrix(state, layers * width)));
    }
    Tensors(results)
}

struct Pass<'a> {
    coordinates: MatrixView<'a>,
    vertex_product: MatrixView<'a>,
    rows: MatrixView<'a>,
    biases: &'a [f32],
    output_bias: &'a [f32],
    weights: Weights,
    omegas: &'a [f32],
    width: usize,
}

impl Pass<'_> {
    /// Takes a block through all layers. `states` has room for the phases and gates of `kept` layers, which take turns.
    ///
    /// # Safety
    /// The memory has the sizes of the block.
    unsafe fn block(
        &self,
        block: &Chunk,
        values: &mut [MaybeUninit<f32>],
        states: [&mut [MaybeUninit<f32>]; 2],
        kept: usize,
    ) {
        let (count, width) = (block.rows.len(), self.width);
        let size = count * width;
        let [phases, gates] = states.map(|state| {
            assert!(state.len() >= kept * size);
            state.as_mut_ptr().cast::<f32>()
        });
        let mut features: Vec<f32> = Vec::with_capacity(size);
        let matrix = |first: *mut f32| OutputBlock { first, row_stride: width };
        let mut input = self.coordinates.strided().from(block.rows.start, 0);
        for (layer, omega) in self.omegas.iter().enumerate() {
            let columns = layer * width..(layer + 1) * width;
            let place = |layer: usize| layer % kept * size;
            // SAFETY: every matrix has `count` rows of `width` columns of its own, and is written before it is read.
            unsafe {
                let gate = gates.add(place(layer));
                if layer == 0 {
                    std::ptr::write_bytes(gate, 0, size);
                } else {
                    let previous = gates.add(place(layer - 1));
                    let previous = StridedMatrix::of_rows(std::slice::from_raw_parts(previous, size), width);
                    let weight = &self.weights.gates[layer - 1];
                    weight.multiply(previous, count, 0..width, matrix(gate), false);
                }
                let phase = phases.add(place(layer));
                let inputs = if layer == 0 { self.coordinates.columns() } else { width };
                self.weights.sine(layer).multiply(input, count, 0..inputs, matrix(phase), false);
                let [phase, gate] = [phase, gate].map(|first| std::slice::from_raw_parts_mut(first, size));
                // Rows of the previous layer's features have been multiplied: the new ones take their place.
                features.clear();
                features.spare_capacity_mut()[..size].fill(MaybeUninit::new(0.0));
                features.set_len(size);
                let (shared, bias) =
                    (&self.rows.row(block.garment)[columns.clone()], &self.biases[columns.clone()]);
                let own = |row: usize| &self.vertex_product.row(block.rows.start + row)[columns.clone()];
                vectorised(
                    #[inline(always)]
                    || layer_units(own, shared, bias, *omega, phase, gate, &mut features),
                );
            }
            input = StridedMatrix::of_rows(&features, width);
        }
        let outputs = self.output_bias.len();
        // SAFETY: the values have `count` rows of `outputs` columns.
        unsafe {
            for row in values.chunks_exact_mut(outputs) {
                for (value, bias) in row.iter_mut().zip(self.output_bias) {
                    value.write(*bias);
                }
            }
            let values = OutputBlock { first: values.as_mut_ptr().cast(), row_stride: outputs };
            self.weights.output.multiply(input, count, 0..width, values, true);
        }
    }
}

/// From products to gates, phases and features.
#[inline(always)]
fn layer_units<'a>(
    own: impl Fn(usize) -> &'a [f32],
    shared: &[f32],
    bias: &[f32],
    omega: f32,
    phases: &mut [f32],
    gates: &mut [f32],
    features: &mut [f32],
) {
    let width = bias.len();
    let units = phases.chunks_exact_mut(width).zip(gates.chunks_exact_mut(width));
    for (row, ((phase, gate), feature)) in units.zip(features.chunks_exact_mut(width)).enumerate() {
        map_lanes(
            [own(row), shared, bias],
            [phase, gate, feature],
            #[inline(always)]
            |[own, shared, bias], [phase, gate, _]| {
                let sum = gate + own + shared;
                // Not `max`: a NaN must stay visible.
                let opened = if sum < 0.0 { 0.0 } else { sum };
                let angle = omega * (phase + bias);
                [angle, opened, sin_cos(angle).0 * opened]
            },
        );
    }
}
