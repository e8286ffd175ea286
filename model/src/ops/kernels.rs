//! Forward and backward passes of the fused operations on plain tensors, backend by backend.

// burn deprecates its ndarray backend but still ships it, and users ask for it.
#![cfg_attr(feature = "ndarray", allow(deprecated))]

use burn::backend::Backend;
#[cfg(any(feature = "wgpu", feature = "cuda"))]
use burn::backend::Cube;
#[cfg(feature = "flex")]
use burn::backend::Flex;
#[cfg(feature = "ndarray")]
use burn::backend::NdArray;
use burn::backend::tensor::FloatTensor;

use super::activation::{self, Activation, ActivationGradients, Saved};
use super::adam::{self, AdamFactors};
use super::sine_modulation::SineGradients;
use super::skin_correction::Projection;
use super::{gradient_features, host, norm, product, sine_modulation, skin_correction, transform_points};

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
