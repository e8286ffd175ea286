//! Every fused operation against burn's own, which burn differentiates: values and all gradients; and against finite
//! differences in f64 where burn itself could be wrong. `exact` holds the kernels against f64 at many sizes.
//!
//! A build with `--no-default-features --features wgpu` tests the kernels of GPUs.

use std::sync::atomic::{AtomicU64, Ordering};

use burn::tensor::{Device, Tensor};

use super::*;
use crate::packing::Packing;
use crate::testing::{assert_close, broadcast, device, gradients_of, uniform};

mod exact;

const ROWS: usize = 70;
const ACTIVATIONS: [Activation; 3] = [Activation::Identity, Activation::Relu, Activation::Gelu];

fn packing() -> Packing {
    Packing::new([40, 1, 29])
}

/// Different values at every call.
fn random(rows: usize, columns: usize, device: &Device) -> Tensor<2> {
    static CALLS: AtomicU64 = AtomicU64::new(0);
    let tensor = uniform(rows, columns, 3.0, CALLS.fetch_add(1, Ordering::Relaxed), device);
    if device.is_autodiff() { tensor.autodiff() } else { tensor }
}

/// One garment's joints in every row.
fn joint_mask() -> Tensor<2> {
    let rows = [[1.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 0.0], [1.0, 1.0, 1.0, 1.0]];
    Tensor::from_floats(rows, &device().inner())
}

/// An activation of burn's functions, but for its GELU, of which the gradient is that of another function.
fn activated(activation: Activation, x: Tensor<2>) -> Tensor<2> {
    match activation {
        Activation::Identity => x,
        Activation::Relu => burn::tensor::activation::relu(x),
        Activation::Gelu => x.clone() * ((x * std::f64::consts::FRAC_1_SQRT_2).erf() * 0.5 + 0.5),
    }
}

/// A correction of skin weights, one operation after another.
fn projected(raw: Tensor<2>, scale: f64, zero_sum: bool) -> Tensor<2> {
    let mask = broadcast(joint_mask(), &packing());
    let masked = raw * mask.clone();
    let share = mask.clone() / mask.sum_dim(1).clamp_min(1.0);
    let mean = masked.clone().sum_dim(1) * if zero_sum { 1.0 } else { 0.0 };
    (masked - share * mean) * scale
}

/// Runs both forms on the same random inputs, weighs their outputs with the same random matrix, and compares outputs and
/// the gradients of all inputs.
fn compare<const N: usize>(
    shapes: [[usize; 2]; N],
    fused: impl Fn([Tensor<2>; N]) -> Tensor<2>,
    composed: impl Fn([Tensor<2>; N]) -> Tensor<2>,
) {
    compare_within(2e-6, shapes, fused, composed);
}

/// The same where outputs may differ by `tolerance` and gradients by five times as much.
fn compare_within<const N: usize>(
    tolerance: f64,
    shapes: [[usize; 2]; N],
    fused: impl Fn([Tensor<2>; N]) -> Tensor<2>,
    composed: impl Fn([Tensor<2>; N]) -> Tensor<2>,
) {
    let device = device();
    let inputs = shapes.map(|[rows, columns]| random(rows, columns, &device));
    let (fused_output, fused_gradients) = gradients_of(&inputs, &fused);
    let (output, gradients) = gradients_of(&inputs, &composed);
    assert_close(&fused_output, &output, tolerance);
    for (fused, expected) in fused_gradients.iter().zip(&gradients) {
        assert_close(fused, expected, 5.0 * tolerance);
    }
    // A plain device takes the branch without recording.
    let plain = fused(inputs.map(Tensor::inner));
    assert_close(&plain, &output, tolerance);
}

#[test]
fn activations_match_burns_own() {
    for activation in ACTIVATIONS {
        for columns in [1, 7, 130] {
            let (matrix, row) = ([ROWS, columns], [1, columns]);
            compare(
                [matrix, row],
                |[input, bias]| activate(activation, input, bias),
                |[input, bias]| activated(activation, input + bias),
            );
            compare(
                [matrix, row, matrix],
                |[input, bias, residual]| activate_residual(activation, input, bias, residual),
                |[input, bias, residual]| activated(activation, input + bias) + residual,
            );
        }
        let (matrix, rows) = ([ROWS, 9], [3, 9]);
        compare(
            [matrix, rows],
            |[input, rows]| activate_packed(activation, input, rows, &packing()),
            |[input, rows]| activated(activation, input + broadcast(rows, &packing())),
        );
        compare(
            [matrix, matrix, rows],
            |[a, b, rows]| activate_packed_sum(activation, [a, b], rows, &packing()),
            |[a, b, rows]| activated(activation, a + b + broadcast(rows, &packing())),
        );
    }
}

#[test]
fn products_match_burns_own() {
    for [rows, inner, columns] in [[ROWS, 9, 33], [1, 1, 1], [300, 200, 190]] {
        let (lhs, rhs) = ([rows, inner], [inner, columns]);
        compare_within(exact::PRODUCT, [lhs, rhs], |[a, b]| product(a, b), |[a, b]| a.matmul(b));
        // The sum is held by the test, so that it must be left as it is; its gradient is that of the result.
        compare_within(
            exact::PRODUCT,
            [lhs, rhs, [rows, columns]],
            |[a, b, sum]| product_add(a, b, sum),
            |[a, b, sum]| a.matmul(b) + sum,
        );
        // A sum whose memory no other tensor shares is added to in place.
        compare_within(
            exact::PRODUCT,
            [lhs, rhs],
            |[a, b]| product_add(a.clone(), b.clone(), product(a, b)),
            |[a, b]| a.matmul(b) * 2.0,
        );
    }
    // Views with other steps and offsets.
    compare_within(
        exact::PRODUCT,
        [[9, ROWS], [40, 9]],
        |[a, b]| product(a.transpose(), b.slice([3..12, 2..7])),
        |[a, b]| a.transpose().matmul(b.slice([3..12, 2..7])),
    );
}

// The host has no form of its own.
#[cfg(feature = "gpu")]
#[test]
fn sine_modulation_matches_burns_own() {
    for omega in [1.0, 30.0] {
        compare(
            [[ROWS, 33], [1, 33], [ROWS, 33]],
            |[input, bias, gate]| sine_modulation(input, bias, gate, omega),
            |[input, bias, gate]| ((input + bias) * omega).sin() * gate,
        );
    }
}

// The host has no form of its own.
#[cfg(feature = "gpu")]
#[test]
fn gradient_features_match_burns_own() {
    compare(
        [[2 * ROWS, 15]],
        |[mixed]| gradient_features(mixed),
        |[mixed]| super::gradient_features::composed(mixed),
    );
}

#[test]
fn point_transforms_match_burns_own() {
    compare(
        [[ROWS, 12], [ROWS, 3]],
        |[transforms, points]| transform_points(transforms, points),
        |[transforms, points]| {
            let axis = |axis: usize| {
                let linear = transforms.clone().narrow(1, 4 * axis, 3);
                (linear * points.clone()).sum_dim(1) + transforms.clone().narrow(1, 4 * axis + 3, 1)
            };
            Tensor::cat(vec![axis(0), axis(1), axis(2)], 1)
        },
    );
}

#[test]
fn skin_correction_matches_burns_own_and_keeps_row_sums() {
    for zero_sum in [true, false] {
        compare(
            [[ROWS, 4], [ROWS, 4]],
            |[weights, raw]| skin_correction(weights, raw, joint_mask(), &packing(), 0.3, zero_sum),
            |[weights, raw]| weights + projected(raw, 0.3, zero_sum),
        );
    }
    let plain = device().inner();
    let (weights, raw) = (random(ROWS, 4, &plain), random(ROWS, 4, &plain));
    let corrected = skin_correction(weights.clone(), raw, joint_mask(), &packing(), 0.3, true);
    assert_close(&corrected.sum_dim(1), &weights.sum_dim(1), 1e-5);
}

#[test]
fn split_columns_matches_slices_even_if_a_block_is_unused_or_used_twice() {
    let product = |blocks: Vec<Tensor<2>>| blocks[0].clone() * blocks[2].clone() + blocks[2].clone().sin();
    let slices = |wide: Tensor<2>| (0..4).map(|block| wide.clone().narrow(1, block * 3, 3)).collect();
    compare([[ROWS, 12]], |[wide]| product(split_columns(wide, 3, 4)), |[wide]| product(slices(wide)));
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
    let expected = burn::tensor::activation::relu(transposed.clone() + bias.clone());
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

/// Central differences in f64, by Simpson integration of the density of Φ.
#[test]
fn gelu_gradient_matches_finite_differences() {
    let device = device();
    let values: Vec<f32> = (-30..=30).map(|step| step as f32 * 0.2).collect();
    let count = values.len();
    let input = Tensor::<1>::from_floats(values.as_slice(), &device).reshape([count, 1]).require_grad();
    let bias = Tensor::<2>::zeros([1, 1], &device);
    let gradient = input.grad(&activate(Activation::Gelu, input.clone(), bias).sum().backward());
    let gradient = crate::testing::values(&gradient.expect("tracked"));
    let gelu = |x: f64| {
        const STEPS: u32 = 2_000;
        let width = x / f64::from(STEPS);
        let density = |t: f64| (-0.5 * t * t).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let weight = |i| match i {
            0 | STEPS => 1.0,
            _ if i % 2 == 1 => 4.0,
            _ => 2.0,
        };
        let sum: f64 = (0..=STEPS).map(|i| weight(i) * density(f64::from(i) * width)).sum();
        x * (0.5 + sum * width / 3.0)
    };
    for (x, slope) in values.iter().zip(gradient) {
        let x = f64::from(*x);
        let expected = (gelu(x + 1e-4) - gelu(x - 1e-4)) / 2e-4;
        assert!((f64::from(slope) - expected).abs() < 1e-6, "{x}: {slope} {expected}");
    }
}

/// A repeated run gives the same bits: an exact resume depends on it.
#[test]
fn results_are_the_same_every_time() {
    let device = device();
    let inputs = [random(900, 70, &device), random(70, 9, &device), random(1, 9, &device)];
    let run = || {
        gradients_of(&inputs, |[input, weight, bias]| {
            activate(Activation::Gelu, product(input, weight), bias)
        })
    };
    let (output, gradients) = run();
    for _ in 0..3 {
        let (other_output, other_gradients) = run();
        assert_close(&output, &other_output, 0.0);
        for (gradient, other) in gradients.iter().zip(&other_gradients) {
            assert_close(gradient, other, 0.0);
        }
    }
}

#[cfg(any(feature = "flex", feature = "ndarray"))]
#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let device = device();
    let inputs = [random(900, 70, &device), random(1, 70, &device), random(900, 70, &device)];
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            gradients_of(&inputs, |[input, bias, residual]| {
                activate_residual(Activation::Gelu, input, bias, residual)
            })
        })
    };
    let ((output_one, gradients_one), (output_many, gradients_many)) = (run(1), run(5));
    assert_close(&output_one, &output_many, 0.0);
    for (one, many) in gradients_one.iter().zip(&gradients_many) {
        assert_close(one, many, 0.0);
    }
}
