//! Gradient features of DiffusionNet.

use burn::backend::Cube;
use burn::tensor::Tensor;
use burn_cubecl::cubecl;
use cubecl::prelude::*;

use super::math::tanh;
use super::matrix::{GpuTensor, Matrix, groups};
use crate::ops::operation::{Operation, Saves, TensorKernel, apply};
use crate::ops::tensors::Tensors;

/// See [`gradient_features`](crate::ops::gradient_features()).
pub(in crate::ops) fn gradient_features(mixed: Tensor<2>) -> Tensor<2> {
    apply(GradientFeatures, [mixed])
}

/// Argument: mixed gradients.
#[derive(Clone, Copy, Debug)]
struct GradientFeatures;

impl TensorKernel for GradientFeatures {
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let [mixed] = arguments.take();
        [features(mixed)].into()
    }
}

impl Operation<1> for GradientFeatures {
    fn saves(&self, _: [bool; 1]) -> Saves<1> {
        Saves { arguments: [true], result: true }
    }

    fn gradients_on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        [gradients(arguments.take())].into()
    }
}

#[cube(launch_unchecked)]
fn forward<N: Size>(
    mixed: &[Vector<f32, N>],
    output: &mut [Vector<f32, N>],
    vertices: usize,
    vectors: usize,
) {
    let i = ABSOLUTE_POS;
    if i < vertices * vectors {
        let first = i / vectors * 3 * vectors + i % vectors;
        let second = first + 3 * vertices * vectors;
        let real = mixed[first + vectors] - mixed[second + 2 * vectors];
        let imaginary = mixed[second + vectors] + mixed[first + 2 * vectors];
        output[i] = tanh::<N>(mixed[first] * real + mixed[second] * imaginary);
    }
}

fn features(mixed: GpuTensor) -> GpuTensor {
    let mixed = Matrix::new(mixed);
    let output = mixed.empty(mixed.rows / 2, mixed.columns / 3);
    let width = output.width();
    let vectors = output.columns / width;
    let (count, dim) = groups(mixed.client(), output.rows * vectors);
    // SAFETY: units beyond the last entry do nothing.
    unsafe {
        forward::launch_unchecked(
            mixed.client(),
            count,
            dim,
            width,
            mixed.argument(width),
            output.argument(width),
            output.rows,
            vectors,
        );
    }
    output.tensor
}

#[cube(launch_unchecked)]
fn backward<N: Size>(
    mixed: &[Vector<f32, N>],
    features: &[Vector<f32, N>],
    gradient: &[Vector<f32, N>],
    of_mixed: &mut [Vector<f32, N>],
    vertices: usize,
    vectors: usize,
) {
    let i = ABSOLUTE_POS;
    if i < vertices * vectors {
        let first = i / vectors * 3 * vectors + i % vectors;
        let second = first + 3 * vertices * vectors;
        let feature = features[i];
        let slope = gradient[i] - gradient[i] * feature * feature;
        let of_x1 = slope * mixed[first];
        let of_y1 = slope * mixed[second];
        of_mixed[first] = slope * (mixed[first + vectors] - mixed[second + 2 * vectors]);
        of_mixed[second] = slope * (mixed[second + vectors] + mixed[first + 2 * vectors]);
        of_mixed[first + vectors] = of_x1;
        of_mixed[second + vectors] = of_y1;
        of_mixed[first + 2 * vectors] = of_y1;
        of_mixed[second + 2 * vectors] = -of_x1;
    }
}

/// Gradient of the mixed gradients from these, the features and the gradient of the features.
fn gradients(arguments: [GpuTensor; 3]) -> GpuTensor {
    let [mixed, features, gradient] = arguments.map(Matrix::new);
    features.assert_like([&gradient]);
    mixed.assert_size(2 * features.rows, 3 * features.columns);
    let of_mixed = mixed.empty(mixed.rows, mixed.columns);
    let width = features.width();
    let vectors = features.columns / width;
    let (count, dim) = groups(mixed.client(), features.rows * vectors);
    // SAFETY: units beyond the last entry do nothing.
    unsafe {
        backward::launch_unchecked(
            mixed.client(),
            count,
            dim,
            width,
            mixed.argument(width),
            features.argument(width),
            gradient.argument(width),
            of_mixed.argument(width),
            features.rows,
            vectors,
        );
    }
    of_mixed.tensor
}
