//! Skin weights plus a correction restricted to the joints a garment uses.

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata};
use burn::tensor::Tensor;

use super::activation::broadcast_rows;
use super::backend::FusedOps;
use super::host::{Chunk, HostBackend, NewValues, Rows, chunks, for_each, part_lengths, vectorised};
use super::kernels::Kernels;
use super::segments::{SegmentEnds, Segments};

/// `weights + scale·P(raw)`: weights and raw `[N,J]`, mask `[M,J]` of zeros and ones.
///
/// P keeps the joints of the row's segment and, if `zero_sum`, removes their mean, so that the sum of a row's weights does
/// not change. P is a symmetric projection, hence its own backward pass. The mask gets no gradient.
pub fn skin_correction(
    weights: Tensor<2>,
    raw: Tensor<2>,
    mask: Tensor<2>,
    segments: &Segments,
    scale: f64,
    zero_sum: bool,
) -> Tensor<2> {
    Tensor::from_dispatch(Dispatch::skin_correction(
        weights.into_dispatch(),
        raw.into_dispatch(),
        mask.into_dispatch(),
        segments.ends().clone(),
        scale,
        zero_sum,
    ))
}

/// How [`project`](Kernels::project) treats a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Projection {
    /// Factor on the projected values.
    pub(super) scale: f64,
    /// Whether the mean over the segment's joints is removed.
    pub(super) zero_sum: bool,
}

// ---------------------------------------------------------------------------------------------------------- host memory

/// `base + scale·P(values)`, base zero if absent.
pub(super) fn host_project<B: HostBackend>(
    values: FloatTensor<B>,
    mask: FloatTensor<B>,
    base: Option<FloatTensor<B>>,
    ends: &[usize],
    projection: Projection,
) -> FloatTensor<B> {
    let device = values.device();
    let (values, mask, base) = (B::hold(values), B::hold(mask), base.map(B::hold));
    let (values, mask, base) = (B::rows(&values), B::rows(&mask), base.as_ref().map(B::rows));
    let joints = values.columns();
    let chunks = chunks(ends, joints);
    let mut output = NewValues::new(values.count() * joints);
    let tasks: Vec<_> = chunks.iter().zip(output.parts(part_lengths(&chunks, joints))).collect();
    for_each(tasks, |(chunk, output)| {
        let output = output.zeroed();
        vectorised(
            #[inline(always)]
            || project_chunk(values, mask, base, chunk, projection, output),
        );
    });
    B::matrix(output.finish(), joints, &device)
}

#[inline(always)]
fn project_chunk(
    values: Rows<'_>,
    mask: Rows<'_>,
    base: Option<Rows<'_>>,
    chunk: &Chunk,
    projection: Projection,
    output: &mut [f32],
) {
    let mask = mask.row(chunk.segment);
    let joints = mask.len();
    let count: f32 = mask.iter().sum();
    let share = if projection.zero_sum { 1.0 / count.max(1.0) } else { 0.0 };
    let scale = projection.scale as f32;
    for (row, output) in chunk.rows.clone().zip(output.chunks_exact_mut(joints)) {
        let values = &values.row(row)[..joints];
        let mut sum = 0.0;
        for joint in 0..joints {
            output[joint] = mask[joint] * values[joint];
            sum += output[joint];
        }
        let mean = share * sum;
        for joint in 0..joints {
            output[joint] = scale * (output[joint] - mean * mask[joint]);
        }
        if let Some(base) = base {
            let base = &base.row(row)[..joints];
            for joint in 0..joints {
                output[joint] += base[joint];
            }
        }
    }
}

// ---------------------------------------------------------------------------------------------------------- any backend

pub(super) fn project<B: Backend>(
    values: FloatTensor<B>,
    mask: FloatTensor<B>,
    base: Option<FloatTensor<B>>,
    ends: &[usize],
    projection: Projection,
) -> FloatTensor<B> {
    let masked = B::float_mul(values, broadcast_rows::<B>(mask.clone(), ends));
    let projected = if projection.zero_sum {
        let count = B::float_clamp_min(B::float_sum_dim(mask.clone(), 1), 1.0.into());
        let share = broadcast_rows::<B>(B::float_div(mask, count), ends);
        let sum = B::float_sum_dim(masked.clone(), 1);
        B::float_sub(masked, B::float_mul(share, sum))
    } else {
        masked
    };
    let scaled = B::float_mul_scalar(projected, projection.scale.into());
    match base {
        Some(base) => B::float_add(scaled, base),
        None => scaled,
    }
}

// ------------------------------------------------------------------------------------------------------------- autodiff

/// Parents: weights, raw.
#[derive(Debug)]
struct CorrectionBackward;

impl<B: Kernels> Backward<B, 2> for CorrectionBackward {
    type State = (FloatTensor<B>, SegmentEnds, Projection);

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (mask, ends, projection) = ops.state;
        let gradient = grads.consume::<B>(&ops.node);
        let [weights, raw] = ops.parents;
        if let Some(weights) = weights {
            grads.register::<B>(weights.id, gradient.clone());
        }
        if let Some(raw) = raw {
            grads.register::<B>(raw.id, B::project(gradient, mask, None, &ends, projection));
        }
    }
}

/// Runs the operation and records it if weights or raw values are tracked.
pub(super) fn record<B: Kernels, C: CheckpointStrategy>(
    weights: FloatTensor<Autodiff<B, C>>,
    raw: FloatTensor<Autodiff<B, C>>,
    mask: FloatTensor<Autodiff<B, C>>,
    ends: SegmentEnds,
    projection: Projection,
) -> FloatTensor<Autodiff<B, C>> {
    let ((weights, a), (raw, b)) = (weights.into_parts(), raw.into_parts());
    let mask = mask.into_primitive();
    match Backward::<B, 2>::prepare::<C>(CorrectionBackward, [a, b]).compute_bound().stateful() {
        OpsKind::UnTracked(operation) => {
            operation.finish(B::project(raw, mask, Some(weights), &ends, projection))
        }
        OpsKind::Tracked(operation) => {
            let output = B::project(raw, mask.clone(), Some(weights), &ends, projection);
            operation.finish((mask, ends, projection), output)
        }
    }
}
