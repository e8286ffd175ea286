//! From coordinates and the gates' arguments to values.

use std::mem::MaybeUninit;

use burn::backend::tensor::FloatTensor;

use super::weights::SirenWeights;
use crate::ops::host::{Chunk, HostBackend, NewValues, filled, for_each, zeroed};
use crate::ops::instruction_set::vectorised;
use crate::ops::math::sin_cos;
use crate::ops::matrix_view::MatrixView;
use crate::ops::row_blocks::{map_lanes, row_blocks};
use crate::ops::tensors::Tensors;
use crate::packing::Packing;

/// The values; then, if the operation is `recorded`, phases and gates of every block of rows, layer after layer.
pub(super) fn run<B: HostBackend>(
    omegas: &[f32],
    packing: &Packing,
    recorded: bool,
    arguments: [FloatTensor<B>; 9],
) -> Tensors<B> {
    let held = arguments.map(B::hold);
    let [coordinates, vertex_product, rows, gate_weights, first, sine_weights, biases, output, output_bias] =
        held.each_ref().map(B::view);
    let (width, outputs, layers) = (output.rows(), output.columns(), omegas.len());
    let (biases, output_bias) = (biases.row(0), output_bias.row(0));
    let weights = SirenWeights::new([gate_weights, first, sine_weights, output], false);
    // Layers whose phases and gates there is memory for: they take turns.
    let kept = if recorded { layers } else { 2 };

    // Takes a block through all layers. Writes all of the values, and of every layer's phases and gates if it keeps them.
    let pass =
        |block: &Chunk, values: &mut [MaybeUninit<f32>], [phases, gates]: [&mut [MaybeUninit<f32>]; 2]| {
            let size = block.rows.len() * width;
            let place = |layer: usize| layer % kept * size..(layer % kept + 1) * size;
            let mut features = vec![0.0; size];
            for (layer, omega) in omegas.iter().enumerate() {
                let gate = if layer == 0 {
                    zeroed(&mut gates[place(0)])
                } else {
                    let places = [place(layer - 1), place(layer)];
                    let [previous, gate] = gates.get_disjoint_mut(places).expect("memory for two layers");
                    // SAFETY: the previous layer has written its gates.
                    let previous = unsafe { previous.assume_init_ref() };
                    weights.gates[layer - 1].product(MatrixView::of_rows(previous, width), gate)
                };
                let input = match layer {
                    0 => coordinates.some_rows(block.rows.clone()),
                    _ => MatrixView::of_rows(&features, width),
                };
                let phase = weights.sines[layer].product(input, &mut phases[place(layer)]);
                let columns = layer * width..(layer + 1) * width;
                let (shared, bias) = (&rows.row(block.garment)[columns.clone()], &biases[columns.clone()]);
                let own = |row: usize| &vertex_product.row(block.rows.start + row)[columns.clone()];
                vectorised(
                    #[inline(always)]
                    || layer_units(own, shared, bias, *omega, phase, gate, &mut features),
                );
            }
            let values = filled(values, block.rows.clone().map(|_| output_bias));
            weights.output.add_product(MatrixView::of_rows(&features, width), values);
        };
    let blocks = row_blocks(packing);
    let mut values = NewValues::of_rows(&blocks, outputs);
    let of_layers = if recorded { layers * width } else { 0 };
    let mut states = [(); 2].map(|()| NewValues::of_rows(&blocks, of_layers));
    let [phases, gates] = states.each_mut().map(NewValues::parts);
    let parts = values.parts().into_iter().zip(phases.into_iter().zip(gates));
    for_each(blocks.iter().zip(parts).collect(), |(block, (values, (phases, gates)))| match recorded {
        true => pass(block, values, [phases, gates]),
        false => {
            let mut scratch = [(); 2].map(|()| Vec::with_capacity(kept * block.rows.len() * width));
            pass(block, values, scratch.each_mut().map(Vec::spare_capacity_mut));
        }
    });
    // SAFETY: a pass has written every part.
    let (values, states) = unsafe { (values.finish(), states.map(|state| state.finish())) };
    let mut results = vec![B::matrix(values, outputs)];
    if recorded {
        results.extend(states.map(|state| B::matrix(state, of_layers)));
    }
    Tensors(results)
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
