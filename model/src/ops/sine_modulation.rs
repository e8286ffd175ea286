//! `sin(w0·(input + bias)) ⊙ gate`: one layer of a modulated SIREN after its matrix product.

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata};
use burn::tensor::Tensor;

use super::backend::FusedOps;
use super::host::{
    Chunk, HostBackend, NewValues, Rows, chunks, for_each, part_lengths, sum_partials, vectorised,
};
use super::kernels::Kernels;
use super::math::sin_cos;

/// `sin(omega·(input + bias)) ⊙ gate`: input and gate `[N,C]`, bias `[1,C]`.
///
/// The backward pass computes the phase again instead of keeping sine and cosine: both come from one polynomial pass,
/// while two more matrices would have to be written and read.
pub fn sine_modulation(input: Tensor<2>, bias: Tensor<2>, gate: Tensor<2>, omega: f64) -> Tensor<2> {
    Tensor::from_dispatch(Dispatch::sine_modulation(
        input.into_dispatch(),
        bias.into_dispatch(),
        gate.into_dispatch(),
        omega,
    ))
}

/// Gradients of input, bias and gate.
pub(super) type SineGradients<B> = (FloatTensor<B>, FloatTensor<B>, FloatTensor<B>);

// ---------------------------------------------------------------------------------------------------------- host memory

pub(super) fn host_forward<B: HostBackend>(
    input: FloatTensor<B>,
    bias: FloatTensor<B>,
    gate: FloatTensor<B>,
    omega: f64,
) -> FloatTensor<B> {
    let device = input.device();
    let (input, bias, gate) = (B::hold(input), B::hold(bias), B::hold(gate));
    let (input, bias, gate) = (B::rows(&input), B::rows(&bias).row(0), B::rows(&gate));
    let columns = input.columns();
    let chunks = chunks(&[input.count()], columns);
    let mut output = NewValues::new(input.count() * columns);
    let tasks: Vec<_> = chunks.iter().zip(output.parts(part_lengths(&chunks, columns))).collect();
    for_each(tasks, |(chunk, output)| {
        let output = output.zeroed();
        vectorised(
            #[inline(always)]
            || forward_chunk(input, bias, gate, omega as f32, chunk, output),
        );
    });
    B::matrix(output.finish(), columns, &device)
}

#[inline(always)]
fn forward_chunk(
    input: Rows<'_>,
    bias: &[f32],
    gate: Rows<'_>,
    omega: f32,
    chunk: &Chunk,
    output: &mut [f32],
) {
    let columns = bias.len();
    for (row, output) in chunk.rows.clone().zip(output.chunks_exact_mut(columns)) {
        let (input, gate) = (&input.row(row)[..columns], &gate.row(row)[..columns]);
        for column in 0..columns {
            output[column] = sin_cos(omega * (input[column] + bias[column])).0 * gate[column];
        }
    }
}

pub(super) fn host_backward<B: HostBackend>(
    input: FloatTensor<B>,
    bias: FloatTensor<B>,
    gate: FloatTensor<B>,
    gradient: FloatTensor<B>,
    omega: f64,
) -> SineGradients<B> {
    let device = input.device();
    let (input, bias, gate, gradient) = (B::hold(input), B::hold(bias), B::hold(gate), B::hold(gradient));
    let (input, bias) = (B::rows(&input), B::rows(&bias).row(0));
    let (gate, gradient) = (B::rows(&gate), B::rows(&gradient));
    let columns = input.columns();
    let chunks = chunks(&[input.count()], columns);
    let mut to_input = NewValues::new(input.count() * columns);
    let mut to_gate = NewValues::new(input.count() * columns);
    let mut partial = vec![0.0; chunks.len() * columns];
    let tasks: Vec<_> = chunks
        .iter()
        .zip(to_input.parts(part_lengths(&chunks, columns)))
        .zip(to_gate.parts(part_lengths(&chunks, columns)))
        .zip(partial.chunks_exact_mut(columns.max(1)))
        .collect();
    for_each(tasks, |(((chunk, to_input), to_gate), sums)| {
        let (to_input, to_gate) = (to_input.zeroed(), to_gate.zeroed());
        vectorised(
            #[inline(always)]
            || backward_chunk([input, gate, gradient], bias, omega as f32, chunk, to_input, to_gate, sums),
        );
    });
    let to_bias = sum_partials(&partial, &chunks, columns, 1);
    (
        B::matrix(to_input.finish(), columns, &device),
        B::matrix(to_bias, columns, &device),
        B::matrix(to_gate.finish(), columns, &device),
    )
}

#[inline(always)]
fn backward_chunk(
    [input, gate, gradient]: [Rows<'_>; 3],
    bias: &[f32],
    omega: f32,
    chunk: &Chunk,
    to_input: &mut [f32],
    to_gate: &mut [f32],
    sums: &mut [f32],
) {
    let columns = bias.len();
    let sums = &mut sums[..columns];
    let outputs = to_input.chunks_exact_mut(columns).zip(to_gate.chunks_exact_mut(columns));
    for (row, (to_input, to_gate)) in chunk.rows.clone().zip(outputs) {
        let (input, gate) = (&input.row(row)[..columns], &gate.row(row)[..columns]);
        let gradient = &gradient.row(row)[..columns];
        for column in 0..columns {
            let (sine, cosine) = sin_cos(omega * (input[column] + bias[column]));
            let inner = omega * cosine * gate[column] * gradient[column];
            to_input[column] = inner;
            to_gate[column] = sine * gradient[column];
            sums[column] += inner;
        }
    }
}

// ---------------------------------------------------------------------------------------------------------- any backend

pub(super) fn forward<B: Backend>(
    input: FloatTensor<B>,
    bias: FloatTensor<B>,
    gate: FloatTensor<B>,
    omega: f64,
) -> FloatTensor<B> {
    let phase = B::float_mul_scalar(B::float_add(input, bias), omega.into());
    B::float_mul(B::float_sin(phase), gate)
}

pub(super) fn backward<B: Backend>(
    input: FloatTensor<B>,
    bias: FloatTensor<B>,
    gate: FloatTensor<B>,
    gradient: FloatTensor<B>,
    omega: f64,
) -> SineGradients<B> {
    let phase = B::float_mul_scalar(B::float_add(input, bias), omega.into());
    let to_gate = B::float_mul(B::float_sin(phase.clone()), gradient.clone());
    let slope = B::float_mul_scalar(B::float_cos(phase), omega.into());
    let to_input = B::float_mul(slope, B::float_mul(gate, gradient));
    (to_input.clone(), B::float_sum_dim(to_input, 0), to_gate)
}

// ------------------------------------------------------------------------------------------------------------- autodiff

#[derive(Debug)]
struct SineBackward;

impl<B: Kernels> Backward<B, 3> for SineBackward {
    type State = (FloatTensor<B>, FloatTensor<B>, FloatTensor<B>, f64);

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (input, bias, gate, omega) = ops.state;
        let gradient = grads.consume::<B>(&ops.node);
        let (to_input, to_bias, to_gate) = B::sine_modulation_backward(input, bias, gate, gradient, omega);
        for (parent, gradient) in ops.parents.into_iter().zip([to_input, to_bias, to_gate]) {
            if let Some(parent) = parent {
                grads.register::<B>(parent.id, gradient);
            }
        }
    }
}

/// Runs the operation and records it if any argument is tracked.
pub(super) fn record<B: Kernels, C: CheckpointStrategy>(
    input: FloatTensor<Autodiff<B, C>>,
    bias: FloatTensor<Autodiff<B, C>>,
    gate: FloatTensor<Autodiff<B, C>>,
    omega: f64,
) -> FloatTensor<Autodiff<B, C>> {
    let ((input, a), (bias, b), (gate, c)) = (input.into_parts(), bias.into_parts(), gate.into_parts());
    match Backward::<B, 3>::prepare::<C>(SineBackward, [a, b, c]).compute_bound().stateful() {
        OpsKind::UnTracked(operation) => {
            operation.finish(B::sine_modulation_forward(input, bias, gate, omega))
        }
        OpsKind::Tracked(operation) => {
            let output = B::sine_modulation_forward(input.clone(), bias.clone(), gate.clone(), omega);
            operation.finish((input, bias, gate, omega), output)
        }
    }
}
