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

use super::activation::{self, Activation, ActivationGradients, Saved};
use super::adam::{self, AdamFactors};
use super::segments::SegmentEnds;
use super::sine_modulation::SineGradients;
use super::skin_correction::Projection;
use super::split_columns::ColumnGradients;
use super::{
    gradient_features, host, norm, product, sine_modulation, skin_correction, split_columns, transform_points,
};

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

/// Forward and backward passes on plain tensors; the defaults compose a backend's own operations.
pub(crate) trait Kernels: Backend {
    fn activation(
        terms: Vec<FloatTensor<Self>>,
        rows: FloatTensor<Self>,
        residual: Option<FloatTensor<Self>>,
        ends: &[usize],
        activation: Activation,
    ) -> FloatTensor<Self> {
        activation::forward::<Self>(terms, rows, residual, ends, activation)
    }

    fn activation_backward(
        saved: Saved<Self>,
        gradient: FloatTensor<Self>,
        ends: &[usize],
        activation: Activation,
    ) -> ActivationGradients<Self> {
        activation::backward::<Self>(saved, gradient, ends, activation)
    }

    fn sine_modulation_forward(
        input: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        gate: FloatTensor<Self>,
        omega: f64,
    ) -> FloatTensor<Self> {
        sine_modulation::forward::<Self>(input, bias, gate, omega)
    }

    fn sine_modulation_backward(
        input: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        gate: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        omega: f64,
    ) -> SineGradients<Self> {
        sine_modulation::backward::<Self>(input, bias, gate, gradient, omega)
    }

    fn matrix_product(
        lhs: FloatTensor<Self>,
        rhs: FloatTensor<Self>,
        addend: Option<FloatTensor<Self>>,
    ) -> FloatTensor<Self> {
        product::forward::<Self>(lhs, rhs, addend)
    }

    fn gradient_features_forward(mixed: FloatTensor<Self>) -> FloatTensor<Self> {
        gradient_features::forward::<Self>(mixed)
    }

    fn gradient_features_backward(
        mixed: FloatTensor<Self>,
        output: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        gradient_features::backward::<Self>(mixed, output, gradient)
    }

    fn project(
        values: FloatTensor<Self>,
        mask: FloatTensor<Self>,
        base: Option<FloatTensor<Self>>,
        ends: &[usize],
        projection: Projection,
    ) -> FloatTensor<Self> {
        skin_correction::project::<Self>(values, mask, base, ends, projection)
    }

    fn transform_points_forward(
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        transform_points::forward::<Self>(transforms, points)
    }

    fn transform_points_backward(
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        transform_points::backward::<Self>(transforms, points, gradient)
    }

    fn adam(
        parameter: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        factors: AdamFactors,
    ) -> adam::Updated<Self> {
        adam::tensor_form::<Self>(parameter, gradient, first, second, factors)
    }

    fn sum_of_squares(values: FloatTensor<Self>) -> FloatTensor<Self> {
        norm::tensor_squared_norm::<Self>(values)
    }

    fn scale(values: FloatTensor<Self>, factor: FloatTensor<Self>) -> FloatTensor<Self> {
        norm::tensor_scale_by::<Self>(values, factor)
    }
}

/// Overrides every kernel with its host form where all arguments are f32.
macro_rules! host_kernels {
    ($backend:ident, $multiply:path) => {
        impl Kernels for $backend {
            fn matrix_product(
                lhs: FloatTensor<Self>,
                rhs: FloatTensor<Self>,
                addend: Option<FloatTensor<Self>>,
            ) -> FloatTensor<Self> {
                $multiply(lhs, rhs, addend)
            }

            fn activation(
                terms: Vec<FloatTensor<Self>>,
                rows: FloatTensor<Self>,
                residual: Option<FloatTensor<Self>>,
                ends: &[usize],
                activation: Activation,
            ) -> FloatTensor<Self> {
                let all: Vec<_> = terms.iter().chain([&rows]).chain(&residual).collect();
                if host::all_f32::<Self>(&all) {
                    activation::host_forward::<Self>(terms, rows, residual, ends, activation)
                } else {
                    activation::forward::<Self>(terms, rows, residual, ends, activation)
                }
            }

            fn activation_backward(
                saved: Saved<Self>,
                gradient: FloatTensor<Self>,
                ends: &[usize],
                activation: Activation,
            ) -> ActivationGradients<Self> {
                if host::all_f32::<Self>(&[&gradient]) {
                    activation::host_backward::<Self>(saved, gradient, ends, activation)
                } else {
                    activation::backward::<Self>(saved, gradient, ends, activation)
                }
            }

            fn sine_modulation_forward(
                input: FloatTensor<Self>,
                bias: FloatTensor<Self>,
                gate: FloatTensor<Self>,
                omega: f64,
            ) -> FloatTensor<Self> {
                if host::all_f32::<Self>(&[&input, &bias, &gate]) {
                    sine_modulation::host_forward::<Self>(input, bias, gate, omega)
                } else {
                    sine_modulation::forward::<Self>(input, bias, gate, omega)
                }
            }

            fn sine_modulation_backward(
                input: FloatTensor<Self>,
                bias: FloatTensor<Self>,
                gate: FloatTensor<Self>,
                gradient: FloatTensor<Self>,
                omega: f64,
            ) -> SineGradients<Self> {
                if host::all_f32::<Self>(&[&input, &bias, &gate, &gradient]) {
                    sine_modulation::host_backward::<Self>(input, bias, gate, gradient, omega)
                } else {
                    sine_modulation::backward::<Self>(input, bias, gate, gradient, omega)
                }
            }

            fn gradient_features_forward(mixed: FloatTensor<Self>) -> FloatTensor<Self> {
                if host::all_f32::<Self>(&[&mixed]) {
                    gradient_features::host_forward::<Self>(mixed)
                } else {
                    gradient_features::forward::<Self>(mixed)
                }
            }

            fn gradient_features_backward(
                mixed: FloatTensor<Self>,
                output: FloatTensor<Self>,
                gradient: FloatTensor<Self>,
            ) -> FloatTensor<Self> {
                if host::all_f32::<Self>(&[&mixed, &output, &gradient]) {
                    gradient_features::host_backward::<Self>(mixed, output, gradient)
                } else {
                    gradient_features::backward::<Self>(mixed, output, gradient)
                }
            }

            fn project(
                values: FloatTensor<Self>,
                mask: FloatTensor<Self>,
                base: Option<FloatTensor<Self>>,
                ends: &[usize],
                projection: Projection,
            ) -> FloatTensor<Self> {
                let all: Vec<_> = [&values, &mask].into_iter().chain(&base).collect();
                if host::all_f32::<Self>(&all) {
                    skin_correction::host_project::<Self>(values, mask, base, ends, projection)
                } else {
                    skin_correction::project::<Self>(values, mask, base, ends, projection)
                }
            }

            fn transform_points_forward(
                transforms: FloatTensor<Self>,
                points: FloatTensor<Self>,
            ) -> FloatTensor<Self> {
                if host::all_f32::<Self>(&[&transforms, &points]) {
                    transform_points::host_forward::<Self>(transforms, points)
                } else {
                    transform_points::forward::<Self>(transforms, points)
                }
            }

            fn transform_points_backward(
                transforms: FloatTensor<Self>,
                points: FloatTensor<Self>,
                gradient: FloatTensor<Self>,
            ) -> (FloatTensor<Self>, FloatTensor<Self>) {
                if host::all_f32::<Self>(&[&transforms, &points, &gradient]) {
                    transform_points::host_backward::<Self>(transforms, points, gradient)
                } else {
                    transform_points::backward::<Self>(transforms, points, gradient)
                }
            }

            fn adam(
                mut parameter: FloatTensor<Self>,
                mut gradient: FloatTensor<Self>,
                mut first: FloatTensor<Self>,
                mut second: FloatTensor<Self>,
                factors: AdamFactors,
            ) -> adam::Updated<Self> {
                let moments = [&mut first, &mut second];
                if adam::host::<Self>(&mut parameter, &mut gradient, moments, factors) {
                    (parameter, first, second)
                } else {
                    adam::tensor_form::<Self>(parameter, gradient, first, second, factors)
                }
            }

            fn sum_of_squares(mut values: FloatTensor<Self>) -> FloatTensor<Self> {
                match norm::host_squared_norm::<Self>(&mut values) {
                    Some(sum) => sum,
                    None => norm::tensor_squared_norm::<Self>(values),
                }
            }

            fn scale(mut values: FloatTensor<Self>, mut factor: FloatTensor<Self>) -> FloatTensor<Self> {
                if norm::host_scale_by::<Self>(&mut values, &mut factor) {
                    values
                } else {
                    norm::tensor_scale_by::<Self>(values, factor)
                }
            }
        }
    };
}

#[cfg(feature = "flex")]
host_kernels!(Flex, product::multiply);
#[cfg(feature = "ndarray")]
host_kernels!(NdArray, product::forward::<NdArray>);
#[cfg(any(feature = "wgpu", feature = "cuda"))]
impl Kernels for Cube {}

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
