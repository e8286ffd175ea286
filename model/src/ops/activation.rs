//! `activation(sum of matrices + one row per segment) + residual` in one pass.

use std::sync::Arc;

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, NodeGuard, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch};
use burn::tensor::Tensor;

use super::backend::FusedOps;
use super::kernels::Kernels;
use super::segments::{SegmentEnds, Segments};

mod host;
mod tensors;

pub(super) use host::{host_backward, host_forward};
pub(super) use tensors::{backward, broadcast_rows, forward};

/// Pointwise activation of a fused layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// The sum itself.
    Identity,
    /// max(x, 0), with derivative 0 at 0.
    Relu,
    /// x·Φ(x) with the exact normal distribution (erf), not its tanh approximation.
    Gelu,
}

/// `activation(input + bias)`: input `[N,C]`, bias `[1,C]`.
pub fn activate(activation: Activation, input: Tensor<2>, bias: Tensor<2>) -> Tensor<2> {
    let ends = one_segment(&input);
    dispatch(Dispatch::activate(input.into_dispatch(), bias.into_dispatch(), ends, activation))
}

/// `activation(input + bias) + residual`: matrices `[N,C]`, bias `[1,C]`.
pub fn activate_residual(
    activation: Activation,
    input: Tensor<2>,
    bias: Tensor<2>,
    residual: Tensor<2>,
) -> Tensor<2> {
    let ends = one_segment(&input);
    dispatch(Dispatch::activate_residual(
        input.into_dispatch(),
        bias.into_dispatch(),
        residual.into_dispatch(),
        ends,
        activation,
    ))
}

/// `activation(input + its segment's row)`: input `[N,C]`, rows `[M,C]`.
pub fn segment_activate(
    activation: Activation,
    input: Tensor<2>,
    rows: Tensor<2>,
    segments: &Segments,
) -> Tensor<2> {
    let ends = segments.ends().clone();
    dispatch(Dispatch::activate(input.into_dispatch(), rows.into_dispatch(), ends, activation))
}

/// `activation(a + b + its segment's row)`: matrices `[N,C]`, rows `[M,C]`.
pub fn segment_activate_sum(
    activation: Activation,
    terms: [Tensor<2>; 2],
    rows: Tensor<2>,
    segments: &Segments,
) -> Tensor<2> {
    let [a, b] = terms;
    dispatch(Dispatch::activate_two(
        a.into_dispatch(),
        b.into_dispatch(),
        rows.into_dispatch(),
        segments.ends().clone(),
        activation,
    ))
}

fn dispatch(tensor: burn::backend::DispatchTensor) -> Tensor<2> {
    Tensor::from_dispatch(tensor)
}

fn one_segment(input: &Tensor<2>) -> SegmentEnds {
    Arc::from([input.dims()[0]])
}

/// Gradients of the operation's arguments: of every term (and they are equal), and of the rows.
pub(super) type ActivationGradients<B> = (FloatTensor<B>, FloatTensor<B>);

/// What the backward pass needs of the forward one.
#[derive(Debug)]
pub(super) enum Saved<B: Backend> {
    /// Identity: nothing.
    Nothing,
    /// ReLU without residual: its output is positive exactly where its input was.
    Output(FloatTensor<B>),
    /// Otherwise the argument of the activation is added up again.
    Arguments(Vec<FloatTensor<B>>, FloatTensor<B>),
}

impl<B: Backend> Clone for Saved<B> {
    fn clone(&self) -> Self {
        match self {
            Self::Nothing => Self::Nothing,
            Self::Output(output) => Self::Output(output.clone()),
            Self::Arguments(terms, rows) => Self::Arguments(terms.clone(), rows.clone()),
        }
    }
}

/// N parents: the terms, then the rows, then the residual if there is one.
#[derive(Debug)]
struct ActivationBackward<const N: usize>;

impl<B: Kernels, const N: usize> Backward<B, N> for ActivationBackward<N> {
    type State = (Saved<B>, SegmentEnds, Activation, usize);

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (saved, ends, activation, terms) = ops.state;
        let gradient = grads.consume::<B>(&ops.node);
        let residual = gradient.clone();
        let (input, rows) = B::activation_backward(saved, gradient, &ends, activation);
        for (index, parent) in ops.parents.into_iter().enumerate() {
            let Some(parent) = parent else { continue };
            let gradient = match index.cmp(&terms) {
                std::cmp::Ordering::Less => input.clone(),
                std::cmp::Ordering::Equal => rows.clone(),
                std::cmp::Ordering::Greater => residual.clone(),
            };
            grads.register::<B>(parent.id, gradient);
        }
    }
}

/// Runs the operation and records it if any parent is tracked.
pub(super) fn record<B: Kernels, C: CheckpointStrategy, const N: usize>(
    parents: [NodeGuard; N],
    terms: Vec<FloatTensor<B>>,
    rows: FloatTensor<B>,
    residual: Option<FloatTensor<B>>,
    ends: SegmentEnds,
    activation: Activation,
) -> FloatTensor<Autodiff<B, C>> {
    let prepared = Backward::<B, N>::prepare::<C>(ActivationBackward::<N>, parents);
    match prepared.compute_bound().stateful() {
        OpsKind::UnTracked(operation) => {
            operation.finish(B::activation(terms, rows, residual, &ends, activation))
        }
        OpsKind::Tracked(operation) => {
            let count = terms.len();
            let plain_relu = activation == Activation::Relu && residual.is_none();
            let arguments = (activation != Activation::Identity && !plain_relu)
                .then(|| Saved::Arguments(terms.clone(), rows.clone()));
            let output = B::activation(terms, rows, residual, &ends, activation);
            let saved = match arguments {
                Some(arguments) => arguments,
                None if plain_relu => Saved::Output(output.clone()),
                None => Saved::Nothing,
            };
            operation.finish((saved, ends, activation, count), output)
        }
    }
}
