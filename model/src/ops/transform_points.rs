//! Points moved by their own affine transforms.

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata};
use burn::tensor::{Slice, Tensor};

use super::backend::FusedOps;
use super::host::{HostBackend, NewValues, Rows, chunks, for_each, part_lengths, vectorised};
use super::kernels::Kernels;

/// `R_n p_n + t_n`: transforms `[N,12]` (the rows of 3×4 matrices [R|t] one after another), points `[N,3]` → `[N,3]`.
pub fn transform_points(transforms: Tensor<2>, points: Tensor<2>) -> Tensor<2> {
    Tensor::from_dispatch(Dispatch::transform_points(transforms.into_dispatch(), points.into_dispatch()))
}

// ---------------------------------------------------------------------------------------------------------- host memory

pub(super) fn host_forward<B: HostBackend>(
    transforms: FloatTensor<B>,
    points: FloatTensor<B>,
) -> FloatTensor<B> {
    let device = points.device();
    let (transforms, points) = (B::hold(transforms), B::hold(points));
    let (transforms, points) = (B::rows(&transforms), B::rows(&points));
    let chunks = chunks(&[points.count()], 12);
    let mut output = NewValues::new(points.count() * 3);
    let tasks: Vec<_> = chunks.iter().zip(output.parts(part_lengths(&chunks, 3))).collect();
    for_each(tasks, |(chunk, output)| {
        let output = output.zeroed();
        vectorised(
            #[inline(always)]
            || {
                for (row, output) in chunk.rows.clone().zip(output.chunks_exact_mut(3)) {
                    forward_row(transforms.row(row), points.row(row), output);
                }
            },
        );
    });
    B::matrix(output.finish(), 3, &device)
}

#[inline(always)]
fn forward_row(transform: &[f32], point: &[f32], output: &mut [f32]) {
    for (line, value) in transform.chunks_exact(4).zip(output) {
        let sum = line[2].mul_add(point[2], line[3]);
        *value = line[0].mul_add(point[0], line[1].mul_add(point[1], sum));
    }
}

pub(super) fn host_backward<B: HostBackend>(
    transforms: FloatTensor<B>,
    points: FloatTensor<B>,
    gradient: FloatTensor<B>,
) -> (FloatTensor<B>, FloatTensor<B>) {
    let device = points.device();
    let (transforms, points, gradient) = (B::hold(transforms), B::hold(points), B::hold(gradient));
    let (transforms, points, gradient) = (B::rows(&transforms), B::rows(&points), B::rows(&gradient));
    let chunks = chunks(&[points.count()], 12);
    let mut to_transforms = NewValues::new(points.count() * 12);
    let mut to_points = NewValues::new(points.count() * 3);
    let tasks: Vec<_> = chunks
        .iter()
        .zip(to_transforms.parts(part_lengths(&chunks, 12)))
        .zip(to_points.parts(part_lengths(&chunks, 3)))
        .collect();
    for_each(tasks, |((chunk, to_transforms), to_points)| {
        let (to_transforms, to_points) = (to_transforms.zeroed(), to_points.zeroed());
        vectorised(
            #[inline(always)]
            || {
                let outputs = to_transforms.chunks_exact_mut(12).zip(to_points.chunks_exact_mut(3));
                for (row, (to_transform, to_point)) in chunk.rows.clone().zip(outputs) {
                    backward_row(
                        [transforms, points, gradient].map(|rows: Rows<'_>| rows.row(row)),
                        to_transform,
                        to_point,
                    );
                }
            },
        );
    });
    (B::matrix(to_transforms.finish(), 12, &device), B::matrix(to_points.finish(), 3, &device))
}

#[inline(always)]
fn backward_row([transform, point, gradient]: [&[f32]; 3], to_transform: &mut [f32], to_point: &mut [f32]) {
    let lines = transform.chunks_exact(4).zip(to_transform.chunks_exact_mut(4));
    for ((line, to_line), &gradient) in lines.zip(gradient) {
        for axis in 0..3 {
            to_line[axis] = gradient * point[axis];
            to_point[axis] = line[axis].mul_add(gradient, to_point[axis]);
        }
        to_line[3] = gradient;
    }
}

// ---------------------------------------------------------------------------------------------------------- any backend

fn columns<B: Backend>(matrix: &FloatTensor<B>, range: std::ops::Range<usize>) -> FloatTensor<B> {
    let rows = matrix.shape()[0];
    B::float_slice(matrix.clone(), &[Slice::from(0..rows), Slice::from(range)])
}

pub(super) fn forward<B: Backend>(transforms: FloatTensor<B>, points: FloatTensor<B>) -> FloatTensor<B> {
    let axes = (0..3).map(|axis| {
        let linear = B::float_mul(columns::<B>(&transforms, 4 * axis..4 * axis + 3), points.clone());
        B::float_add(B::float_sum_dim(linear, 1), columns::<B>(&transforms, 4 * axis + 3..4 * axis + 4))
    });
    B::float_cat(axes.collect(), 1)
}

pub(super) fn backward<B: Backend>(
    transforms: FloatTensor<B>,
    points: FloatTensor<B>,
    gradient: FloatTensor<B>,
) -> (FloatTensor<B>, FloatTensor<B>) {
    let mut parts = Vec::with_capacity(6);
    let mut to_points: Option<FloatTensor<B>> = None;
    for axis in 0..3 {
        let gradient = columns::<B>(&gradient, axis..axis + 1);
        parts.push(B::float_mul(points.clone(), gradient.clone()));
        parts.push(gradient.clone());
        let term = B::float_mul(columns::<B>(&transforms, 4 * axis..4 * axis + 3), gradient);
        to_points = Some(match to_points {
            Some(sum) => B::float_add(sum, term),
            None => term,
        });
    }
    (B::float_cat(parts, 1), to_points.unwrap_or(points))
}

// ------------------------------------------------------------------------------------------------------------- autodiff

#[derive(Debug)]
struct TransformBackward;

impl<B: Kernels> Backward<B, 2> for TransformBackward {
    type State = (FloatTensor<B>, FloatTensor<B>);

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (transforms, points) = ops.state;
        let gradient = grads.consume::<B>(&ops.node);
        let (to_transforms, to_points) = B::transform_points_backward(transforms, points, gradient);
        for (parent, gradient) in ops.parents.into_iter().zip([to_transforms, to_points]) {
            if let Some(parent) = parent {
                grads.register::<B>(parent.id, gradient);
            }
        }
    }
}

/// Runs the operation and records it if any argument is tracked.
pub(super) fn record<B: Kernels, C: CheckpointStrategy>(
    transforms: FloatTensor<Autodiff<B, C>>,
    points: FloatTensor<Autodiff<B, C>>,
) -> FloatTensor<Autodiff<B, C>> {
    let ((transforms, a), (points, b)) = (transforms.into_parts(), points.into_parts());
    match Backward::<B, 2>::prepare::<C>(TransformBackward, [a, b]).compute_bound().stateful() {
        OpsKind::UnTracked(operation) => operation.finish(B::transform_points_forward(transforms, points)),
        OpsKind::Tracked(operation) => {
            let output = B::transform_points_forward(transforms.clone(), points.clone());
            operation.finish((transforms, points), output)
        }
    }
}
