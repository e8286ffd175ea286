//! Which backend runs which form of the fused operations.

// burn deprecates its ndarray backend but still ships it, and users ask for it.
#![cfg_attr(feature = "ndarray", allow(deprecated))]

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use burn::backend::Cube;
#[cfg(feature = "flex")]
use burn::backend::Flex;
#[cfg(feature = "ndarray")]
use burn::backend::NdArray;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, backend_extension};

use super::activation::{self, Activation};
use super::adam::{self, AdamFactors};
use super::kernels::Kernels;
use super::segments::SegmentEnds;
use super::skin_correction::Projection;
use super::split_columns::ColumnGradients;
use super::{gradient_features, product, sine_modulation, skin_correction, split_columns, transform_points};

/// The fused operations as burn dispatches them; the functions of [`super`] are the way to call them.
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(any(feature = "wgpu", feature = "cuda")),
    Autodiff
)]
pub(crate) trait FusedOps: Backend {
    /// See [`super::activate`] and [`super::segment_activate`].
    fn activate(
        input: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        ends: SegmentEnds,
        activation: Activation,
    ) -> FloatTensor<Self>;
    /// See [`super::segment_activate_sum`].
    fn activate_two(
        a: FloatTensor<Self>,
        b: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        ends: SegmentEnds,
        activation: Activation,
    ) -> FloatTensor<Self>;
    /// See [`super::activate_residual`].
    fn activate_residual(
        input: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        residual: FloatTensor<Self>,
        ends: SegmentEnds,
        activation: Activation,
    ) -> FloatTensor<Self>;
    /// See [`super::sine_modulation`].
    fn sine_modulation(
        input: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        gate: FloatTensor<Self>,
        omega: f64,
    ) -> FloatTensor<Self>;
    /// See [`super::product`].
    fn product(lhs: FloatTensor<Self>, rhs: FloatTensor<Self>) -> FloatTensor<Self>;
    /// See [`super::product_add`].
    fn product_add(
        lhs: FloatTensor<Self>,
        rhs: FloatTensor<Self>,
        addend: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
    /// See [`super::gradient_features`].
    fn gradient_features(mixed: FloatTensor<Self>) -> FloatTensor<Self>;
    /// See [`super::skin_correction`].
    fn skin_correction(
        weights: FloatTensor<Self>,
        raw: FloatTensor<Self>,
        mask: FloatTensor<Self>,
        ends: SegmentEnds,
        scale: f64,
        zero_sum: bool,
    ) -> FloatTensor<Self>;
    /// See [`super::transform_points`].
    fn transform_points(transforms: FloatTensor<Self>, points: FloatTensor<Self>) -> FloatTensor<Self>;
    /// Where the gradients of [`FusedOps::column_block`] meet; the identity.
    fn column_collector(wide: FloatTensor<Self>, gradients: ColumnGradients) -> FloatTensor<Self>;
    /// See [`super::split_columns`].
    fn column_block(wide: FloatTensor<Self>, block: usize, gradients: ColumnGradients) -> FloatTensor<Self>;
    /// See [`super::adam_step`].
    fn adam_step(
        parameter: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        factors: AdamFactors,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
    /// See [`super::squared_norm`].
    fn squared_norm(values: FloatTensor<Self>) -> FloatTensor<Self>;
    /// See [`super::scale_by`].
    fn scale_by(values: FloatTensor<Self>, factor: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// On plain tensors the operations are the kernels themselves.
macro_rules! plain_operations {
    ($backend:ident) => {
        impl FusedOps for $backend {
            fn activate(
                input: FloatTensor<Self>,
                rows: FloatTensor<Self>,
                ends: SegmentEnds,
                activation: Activation,
            ) -> FloatTensor<Self> {
                Self::activation(vec![input], rows, None, &ends, activation)
            }

            fn activate_two(
                a: FloatTensor<Self>,
                b: FloatTensor<Self>,
                rows: FloatTensor<Self>,
                ends: SegmentEnds,
                activation: Activation,
            ) -> FloatTensor<Self> {
                Self::activation(vec![a, b], rows, None, &ends, activation)
            }

            fn activate_residual(
                input: FloatTensor<Self>,
                rows: FloatTensor<Self>,
                residual: FloatTensor<Self>,
                ends: SegmentEnds,
                activation: Activation,
            ) -> FloatTensor<Self> {
                Self::activation(vec![input], rows, Some(residual), &ends, activation)
            }

            fn sine_modulation(
                input: FloatTensor<Self>,
                bias: FloatTensor<Self>,
                gate: FloatTensor<Self>,
                omega: f64,
            ) -> FloatTensor<Self> {
                Self::sine_modulation_forward(input, bias, gate, omega)
            }

            fn product(lhs: FloatTensor<Self>, rhs: FloatTensor<Self>) -> FloatTensor<Self> {
                Self::matrix_product(lhs, rhs, None)
            }

            fn product_add(
                lhs: FloatTensor<Self>,
                rhs: FloatTensor<Self>,
                addend: FloatTensor<Self>,
            ) -> FloatTensor<Self> {
                Self::matrix_product(lhs, rhs, Some(addend))
            }

            fn gradient_features(mixed: FloatTensor<Self>) -> FloatTensor<Self> {
                Self::gradient_features_forward(mixed)
            }

            fn skin_correction(
                weights: FloatTensor<Self>,
                raw: FloatTensor<Self>,
                mask: FloatTensor<Self>,
                ends: SegmentEnds,
                scale: f64,
                zero_sum: bool,
            ) -> FloatTensor<Self> {
                Self::project(raw, mask, Some(weights), &ends, Projection { scale, zero_sum })
            }

            fn transform_points(
                transforms: FloatTensor<Self>,
                points: FloatTensor<Self>,
            ) -> FloatTensor<Self> {
                Self::transform_points_forward(transforms, points)
            }

            fn column_collector(wide: FloatTensor<Self>, _: ColumnGradients) -> FloatTensor<Self> {
                wide
            }

            fn column_block(
                wide: FloatTensor<Self>,
                block: usize,
                gradients: ColumnGradients,
            ) -> FloatTensor<Self> {
                split_columns::block::<Self>(wide, block, &gradients)
            }

            fn adam_step(
                parameter: FloatTensor<Self>,
                gradient: FloatTensor<Self>,
                first: FloatTensor<Self>,
                second: FloatTensor<Self>,
                factors: AdamFactors,
            ) -> adam::Updated<Self> {
                Self::adam(parameter, gradient, first, second, factors)
            }

            fn squared_norm(values: FloatTensor<Self>) -> FloatTensor<Self> {
                Self::sum_of_squares(values)
            }

            fn scale_by(values: FloatTensor<Self>, factor: FloatTensor<Self>) -> FloatTensor<Self> {
                Self::scale(values, factor)
            }
        }
    };
}

#[cfg(feature = "flex")]
plain_operations!(Flex);
#[cfg(feature = "ndarray")]
plain_operations!(NdArray);
#[cfg(any(feature = "wgpu", feature = "cuda"))]
plain_operations!(Cube);

impl<B: Kernels, C: CheckpointStrategy> FusedOps for Autodiff<B, C> {
    fn activate(
        input: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        ends: SegmentEnds,
        activation: Activation,
    ) -> FloatTensor<Self> {
        let ((input, a), (rows, b)) = (input.into_parts(), rows.into_parts());
        activation::record::<B, C, 2>([a, b], vec![input], rows, None, ends, activation)
    }

    fn activate_two(
        a: FloatTensor<Self>,
        b: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        ends: SegmentEnds,
        activation: Activation,
    ) -> FloatTensor<Self> {
        let ((a, first), (b, second)) = (a.into_parts(), b.into_parts());
        let (rows, third) = rows.into_parts();
        activation::record::<B, C, 3>([first, second, third], vec![a, b], rows, None, ends, activation)
    }

    fn activate_residual(
        input: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        residual: FloatTensor<Self>,
        ends: SegmentEnds,
        activation: Activation,
    ) -> FloatTensor<Self> {
        let ((input, a), (rows, b)) = (input.into_parts(), rows.into_parts());
        let (residual, c) = residual.into_parts();
        activation::record::<B, C, 3>([a, b, c], vec![input], rows, Some(residual), ends, activation)
    }

    fn sine_modulation(
        input: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        gate: FloatTensor<Self>,
        omega: f64,
    ) -> FloatTensor<Self> {
        sine_modulation::record::<B, C>(input, bias, gate, omega)
    }

    fn product(lhs: FloatTensor<Self>, rhs: FloatTensor<Self>) -> FloatTensor<Self> {
        product::record::<B, C>(lhs, rhs)
    }

    fn product_add(
        lhs: FloatTensor<Self>,
        rhs: FloatTensor<Self>,
        addend: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        product::record_add::<B, C>(lhs, rhs, addend)
    }

    fn gradient_features(mixed: FloatTensor<Self>) -> FloatTensor<Self> {
        gradient_features::record::<B, C>(mixed)
    }

    fn skin_correction(
        weights: FloatTensor<Self>,
        raw: FloatTensor<Self>,
        mask: FloatTensor<Self>,
        ends: SegmentEnds,
        scale: f64,
        zero_sum: bool,
    ) -> FloatTensor<Self> {
        skin_correction::record::<B, C>(weights, raw, mask, ends, Projection { scale, zero_sum })
    }

    fn transform_points(transforms: FloatTensor<Self>, points: FloatTensor<Self>) -> FloatTensor<Self> {
        transform_points::record::<B, C>(transforms, points)
    }

    fn column_collector(wide: FloatTensor<Self>, gradients: ColumnGradients) -> FloatTensor<Self> {
        split_columns::record_collector::<B, C>(wide, gradients)
    }

    fn column_block(wide: FloatTensor<Self>, block: usize, gradients: ColumnGradients) -> FloatTensor<Self> {
        split_columns::record_block::<B, C>(wide, block, gradients)
    }

    // An optimiser works beside the graph: nothing of it is recorded.

    fn adam_step(
        parameter: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        factors: AdamFactors,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let plain = |tensor: FloatTensor<Self>| tensor.into_primitive();
        let (parameter, first, second) =
            B::adam(plain(parameter), plain(gradient), plain(first), plain(second), factors);
        (
            <FloatTensor<Self>>::new(parameter),
            <FloatTensor<Self>>::new(first),
            <FloatTensor<Self>>::new(second),
        )
    }

    fn squared_norm(values: FloatTensor<Self>) -> FloatTensor<Self> {
        <FloatTensor<Self>>::new(B::sum_of_squares(values.into_primitive()))
    }

    fn scale_by(values: FloatTensor<Self>, factor: FloatTensor<Self>) -> FloatTensor<Self> {
        <FloatTensor<Self>>::new(B::scale(values.into_primitive(), factor.into_primitive()))
    }
}
