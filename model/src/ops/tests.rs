//! Every fused operation against its tensor form: values and all gradients, and against finite differences in f64 where the
//! tensor form itself could be wrong.

use std::sync::atomic::{AtomicU64, Ordering};

use burn::tensor::{Device, Tensor};

use super::*;
use crate::testing::{assert_close, device, gradients_of, uniform};

const ROWS: usize = 70;
const LENGTHS: [usize; 3] = [40, 1, 29];

/// Different values at every call.
fn random(rows: usize, columns: usize, device: &Device) -> Tensor<2> {
    static CALLS: AtomicU64 = AtomicU64::new(0);
    let tensor = uniform(rows, columns, 3.0, CALLS.fetch_add(1, Ordering::Relaxed), device);
    if device.is_autodiff() { tensor.autodiff() } else { tensor }
}

/// Runs both forms on the same random inputs, weighs their outputs with the same random matrix, and compares outputs and
/// the gradients of all inputs.
fn compare(
    shapes: &[[usize; 2]],
    fused: impl Fn(Vec<Tensor<2>>) -> Tensor<2>,
    tensor_form: impl Fn(Vec<Tensor<2>>) -> Tensor<2>,
) {
    let device = device();
    let inputs: Vec<_> = shapes.iter().map(|[rows, columns]| random(*rows, *columns, &device)).collect();
    let (fused_output, fused_gradients) = gradients_of(&inputs, &fused);
    let (output, gradients) = gradients_of(&inputs, &tensor_form);
    assert_close(&fused_output, &output, 2e-6);
    for (fused, expected) in fused_gradients.iter().zip(&gradients) {
        assert_close(fused, expected, 1e-5);
    }
    // A plain device takes the path without recording.
    let plain = fused(inputs.into_iter().map(Tensor::inner).collect());
    assert_close(&plain, &output, 2e-6);
}

#[test]
fn activations_match_the_tensor_form() {
    for activation in [Activation::Identity, Activation::Relu, Activation::Gelu] {
        for columns in [1, 7, 130] {
            let matrix = [ROWS, columns];
            let row = [1, columns];
            compare(
                &[matrix, row],
                |t| activate(activation, t[0].clone(), t[1].clone()),
                |t| tensor_form::apply(activation, t[0].clone() + t[1].clone()),
            );
            compare(
                &[matrix, row, matrix],
                |t| activate_residual(activation, t[0].clone(), t[1].clone(), t[2].clone()),
                |t| tensor_form::apply(activation, t[0].clone() + t[1].clone()) + t[2].clone(),
            );
        }
    }
}

#[test]
fn products_match_the_tensor_form() {
    for [rows, inner, columns] in [[ROWS, 9, 33], [1, 1, 1], [300, 200, 190]] {
        compare(
            &[[rows, inner], [inner, columns]],
            |t| product(t[0].clone(), t[1].clone()),
            |t| t[0].clone().matmul(t[1].clone()),
        );
        // The sum is held by the test, so that it must be left alone; its gradient is that of the result.
        compare(
            &[[rows, inner], [inner, columns], [rows, columns]],
            |t| product_add(t[0].clone(), t[1].clone(), t[2].clone()),
            |t| t[0].clone().matmul(t[1].clone()) + t[2].clone(),
        );
        // A sum that nobody else holds is added to in place.
        compare(
            &[[rows, inner], [inner, columns]],
            |t| product_add(t[0].clone(), t[1].clone(), product(t[0].clone(), t[1].clone())),
            |t| t[0].clone().matmul(t[1].clone()) * 2.0,
        );
    }
    // Matrices that lie in memory some other way.
    compare(
        &[[9, ROWS], [40, 9]],
        |t| product(t[0].clone().transpose(), t[1].clone().slice([3..12, 2..7])),
        |t| t[0].clone().transpose().matmul(t[1].clone().slice([3..12, 2..7])),
    );
}

#[test]
fn segment_activations_match_the_tensor_form() {
    let segments = Segments::new(LENGTHS);
    for activation in [Activation::Identity, Activation::Relu, Activation::Gelu] {
        compare(
            &[[ROWS, 9], [3, 9]],
            |t| segment_activate(activation, t[0].clone(), t[1].clone(), &segments),
            |t| {
                tensor_form::apply(activation, t[0].clone() + tensor_form::broadcast(t[1].clone(), &segments))
            },
        );
        compare(
            &[[ROWS, 9], [ROWS, 9], [3, 9]],
            |t| segment_activate_sum(activation, [t[0].clone(), t[1].clone()], t[2].clone(), &segments),
            |t| {
                let rows = tensor_form::broadcast(t[2].clone(), &segments);
                tensor_form::apply(activation, t[0].clone() + t[1].clone() + rows)
            },
        );
    }
}

#[test]
fn sine_modulation_matches_the_tensor_form() {
    for omega in [1.0, 30.0] {
        compare(
            &[[ROWS, 33], [1, 33], [ROWS, 33]],
            |t| sine_modulation(t[0].clone(), t[1].clone(), t[2].clone(), omega),
            |t| tensor_form::sine_modulation(t[0].clone(), t[1].clone(), t[2].clone(), omega),
        );
    }
}

#[test]
fn gradient_features_match_the_tensor_form() {
    compare(
        &[[2 * ROWS, 15]],
        |t| gradient_features(t[0].clone()),
        |t| tensor_form::gradient_features(t[0].clone()),
    );
}

#[test]
fn point_transforms_match_the_tensor_form() {
    compare(
        &[[ROWS, 12], [ROWS, 3]],
        |t| transform_points(t[0].clone(), t[1].clone()),
        |t| tensor_form::transform_points(t[0].clone(), t[1].clone()),
    );
}

#[test]
fn skin_correction_matches_the_tensor_form_and_keeps_row_sums() {
    let segments = Segments::new(LENGTHS);
    let mask = || {
        let rows = [[1.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 0.0], [1.0, 1.0, 1.0, 1.0]];
        Tensor::<2>::from_floats(rows, &device().inner())
    };
    for zero_sum in [true, false] {
        compare(
            &[[ROWS, 4], [ROWS, 4]],
            |t| skin_correction(t[0].clone(), t[1].clone(), mask(), &segments, 0.3, zero_sum),
            |t| tensor_form::skin_correction(t[0].clone(), t[1].clone(), mask(), &segments, 0.3, zero_sum),
        );
    }
    let plain = device().inner();
    let (weights, raw) = (random(ROWS, 4, &plain), random(ROWS, 4, &plain));
    let corrected = skin_correction(weights.clone(), raw, mask(), &segments, 0.3, true);
    assert_close(&corrected.sum_dim(1), &weights.sum_dim(1), 1e-5);
}

#[test]
fn split_columns_matches_slices_even_if_a_block_is_unused_or_used_twice() {
    let product = |blocks: Vec<Tensor<2>>| blocks[0].clone() * blocks[2].clone() + blocks[2].clone().sin();
    compare(
        &[[ROWS, 12]],
        |t| product(split_columns(t[0].clone(), 3, 4)),
        |t| product(tensor_form::split_columns(t[0].clone(), 3, 4)),
    );
}

#[test]
fn kernels_read_column_blocks_in_place() {
    let device = device();
    let wide = random(ROWS, 20, &device);
    let block = |tensor: &Tensor<2>| tensor.clone().narrow(1, 5, 10);
    let bias = random(1, 10, &device);
    let expected = activate(Activation::Gelu, block(&wide) * 1.0, bias.clone());
    assert_close(&activate(Activation::Gelu, block(&wide), bias), &expected, 0.0);
    let transposed = random(10, ROWS, &device).transpose();
    let bias = random(1, 10, &device);
    let expected = tensor_form::apply(Activation::Relu, transposed.clone() + bias.clone());
    assert_close(&activate(Activation::Relu, transposed, bias), &expected, 1e-6);
}

#[test]
fn an_untracked_argument_is_a_constant() {
    let device = device();
    let input = random(ROWS, 6, &device).require_grad();
    let gate = random(ROWS, 6, &device.clone().inner());
    let bias = random(1, 6, &device.inner());
    let loss = sine_modulation(input.clone(), bias.clone(), gate.clone(), 2.0).sum();
    let gradients = loss.backward();
    let expected = ((input.clone().inner() + bias) * 2.0).cos() * gate * 2.0;
    assert_close(&input.grad(&gradients).expect("tracked"), &expected, 1e-5);
}

/// Gradients of the two activations with a kink or a special function, by central differences in f64.
#[test]
fn gelu_gradient_matches_finite_differences() {
    let device = device();
    let values: Vec<f32> = (-30..=30).map(|step| step as f32 * 0.2).collect();
    let count = values.len();
    let input = Tensor::<1>::from_floats(values.as_slice(), &device).reshape([count, 1]).require_grad();
    let bias = Tensor::<2>::zeros([1, 1], &device);
    let gradient = input.grad(&activate(Activation::Gelu, input.clone(), bias).sum().backward());
    let gradient = crate::testing::values(&gradient.expect("tracked"));
    // Φ by Simpson integration of the density.
    let gelu = |x: f64| {
        let steps = 2_000;
        let width = x / f64::from(steps);
        let density = |t: f64| (-0.5 * t * t).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let sum: f64 = (0..=steps)
            .map(|i| {
                let weight = if i == 0 || i == steps {
                    1.0
                } else if i % 2 == 1 {
                    4.0
                } else {
                    2.0
                };
                weight * density(f64::from(i) * width)
            })
            .sum();
        x * (0.5 + sum * width / 3.0)
    };
    for (x, slope) in values.iter().zip(gradient) {
        let x = f64::from(*x);
        let expected = (gelu(x + 1e-4) - gelu(x - 1e-4)) / 2e-4;
        assert!((f64::from(slope) - expected).abs() < 1e-6, "{x}: {slope} {expected}");
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let device = device();
    let inputs = vec![random(900, 70, &device), random(1, 70, &device), random(900, 70, &device)];
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            gradients_of(&inputs, |t| sine_modulation(t[0].clone(), t[1].clone(), t[2].clone(), 3.0))
        })
    };
    let ((output_one, gradients_one), (output_many, gradients_many)) = (run(1), run(5));
    assert_close(&output_one, &output_many, 0.0);
    for (one, many) in gradients_one.iter().zip(&gradients_many) {
        assert_close(one, many, 0.0);
    }
}

#[cfg(feature = "flex")]
mod any_backend {
    //! The compositions that other backends run, on flex.

    use burn::backend::Flex;
    use burn::backend::ops::FloatTensorOps;
    use burn::backend::tensor::FloatTensor;
    use burn::tensor::TensorData;

    use super::super::{activation, gradient_features, sine_modulation, skin_correction, transform_points};
    use super::*;

    fn primitive(rows: usize, columns: usize, seed: u32) -> FloatTensor<Flex> {
        let mut state = u64::from(seed) * 7_919 + 1;
        let values: Vec<f32> = (0..rows * columns)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 40) as f32 / (1u64 << 22) as f32 - 2.0
            })
            .collect();
        Flex::float_from_data(TensorData::new(values, [rows, columns]), &Default::default())
    }

    fn values(tensor: FloatTensor<Flex>) -> Vec<f32> {
        let data = burn::backend::read_sync(Flex::float_into_data(tensor)).expect("host memory");
        data.try_to_vec().expect("f32")
    }

    fn same(a: FloatTensor<Flex>, b: FloatTensor<Flex>) {
        let (a, b) = (values(a), values(b));
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() <= 1e-5 * (1.0 + a.abs()), "{a} {b}");
        }
    }

    #[test]
    fn compositions_match_the_host_kernels() {
        let ends = [40, 41, ROWS];
        let matrix = |seed| primitive(ROWS, 9, seed);
        for kind in [Activation::Identity, Activation::Relu, Activation::Gelu] {
            let (terms, rows) = (vec![matrix(1), matrix(2)], primitive(3, 9, 3));
            let residual = || Some(matrix(4));
            same(
                activation::forward::<Flex>(terms.clone(), rows.clone(), residual(), &ends, kind),
                activation::host_forward::<Flex>(terms.clone(), rows.clone(), residual(), &ends, kind),
            );
            let saved = || activation::Saved::<Flex>::Arguments(terms.clone(), rows.clone());
            let expected = activation::host_backward::<Flex>(saved(), matrix(5), &ends, kind);
            let found = activation::backward::<Flex>(saved(), matrix(5), &ends, kind);
            same(found.0, expected.0);
            same(found.1, expected.1);
        }

        let bias = || primitive(1, 9, 6);
        same(
            sine_modulation::forward::<Flex>(matrix(1), bias(), matrix(2), 3.0),
            sine_modulation::host_forward::<Flex>(matrix(1), bias(), matrix(2), 3.0),
        );
        let found = sine_modulation::backward::<Flex>(matrix(1), bias(), matrix(2), matrix(3), 3.0);
        let expected = sine_modulation::host_backward::<Flex>(matrix(1), bias(), matrix(2), matrix(3), 3.0);
        same(found.0, expected.0);
        same(found.1, expected.1);
        same(found.2, expected.2);

        let mixed = || primitive(2 * ROWS, 9, 7);
        let output = gradient_features::host_forward::<Flex>(mixed());
        same(gradient_features::forward::<Flex>(mixed()), output.clone());
        let gradient = || primitive(ROWS, 3, 8);
        same(
            gradient_features::backward::<Flex>(mixed(), output.clone(), gradient()),
            gradient_features::host_backward::<Flex>(mixed(), output, gradient()),
        );

        let (transforms, points) = (|| primitive(ROWS, 12, 9), || primitive(ROWS, 3, 10));
        same(
            transform_points::forward::<Flex>(transforms(), points()),
            transform_points::host_forward::<Flex>(transforms(), points()),
        );
        let found = transform_points::backward::<Flex>(transforms(), points(), gradient());
        let expected = transform_points::host_backward::<Flex>(transforms(), points(), gradient());
        same(found.0, expected.0);
        same(found.1, expected.1);

        let mask = || {
            let rows = vec![1.0f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
            Flex::float_from_data(TensorData::new(rows, [3, 3]), &Default::default())
        };
        for zero_sum in [true, false] {
            let projection = skin_correction::Projection { scale: 0.4, zero_sum };
            same(
                skin_correction::project::<Flex>(points(), mask(), Some(gradient()), &ends, projection),
                skin_correction::host_project::<Flex>(points(), mask(), Some(gradient()), &ends, projection),
            );
        }
    }
}
