//! Every operation against f64 on the host: what burn composes on a GPU is as imprecise as the graphics API allows.
//!
//! The sizes are those at which kernels have edges: vectors of four columns or single ones, one tile or block and the next,
//! sums long enough to be cut, garments of one row and of several blocks.

use burn::tensor::{Tensor, TensorData};

use super::super::activation::ActivatedSum;
use super::super::operation::apply;
use super::super::*;
use crate::packing::Packing;
use crate::testing::{device, uniform};

/// A result, relative to its largest entry.
const OUTPUT: f64 = 2e-6;
/// A product of matrices. Matrix units, which builds for GPUs use where there are some, keep 2⁻¹⁵ of every term.
pub(super) const PRODUCT: f64 =
    if cfg!(any(feature = "vulkan", feature = "cuda")) { 1.0 / 32_768.0 } else { 2e-6 };
/// A sum over many rows.
const SUM: f64 = 1e-5;

/// A matrix in f64.
#[derive(Clone)]
struct Exact {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

impl Exact {
    fn new(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let values = (0..rows * columns).map(|i| entry(i / columns, i % columns)).collect();
        Self { rows, columns, values }
    }

    fn of<const D: usize>(tensor: &Tensor<D>) -> Self {
        let columns = tensor.dims()[D - 1];
        let values: Vec<f32> = tensor.to_data().try_to_vec().expect("f32");
        let values: Vec<f64> = values.into_iter().map(f64::from).collect();
        Self { rows: values.len() / columns, columns, values }
    }

    /// Uniform in ±range; exactly so on the device.
    fn random(rows: usize, columns: usize, range: f32, seed: u64) -> Self {
        Self::of(&uniform(rows, columns, range, seed, &device()))
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }

    fn map(&self, function: impl Fn(f64) -> f64) -> Self {
        let values = self.values.iter().map(|value| function(*value)).collect();
        Self { values, ..*self }
    }

    fn transposed(&self) -> Self {
        Self::new(self.columns, self.rows, |row, column| self.at(column, row))
    }

    fn times(&self, rhs: &Self) -> Self {
        let mut product = Self::new(self.rows, rhs.columns, |_, _| 0.0);
        for (lhs, sums) in
            self.values.chunks_exact(self.columns).zip(product.values.chunks_exact_mut(rhs.columns))
        {
            for (factor, row) in lhs.iter().zip(rhs.values.chunks_exact(rhs.columns)) {
                sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += factor * value);
            }
        }
        product
    }

    /// One row per garment.
    fn column_sums(&self, packing: &Packing) -> Self {
        let ranges: Vec<_> = packing.ranges().collect();
        let sum =
            |garment: usize, column| ranges[garment].clone().map(|row: usize| self.at(row, column)).sum();
        Self::new(packing.count(), self.columns, sum)
    }

    fn tensor(&self) -> Tensor<2> {
        let values: Vec<f32> = self.values.iter().map(|value| *value as f32).collect();
        Tensor::from_data(TensorData::new(values, [self.rows, self.columns]), &device().inner())
    }
}

/// Fails if a tensor differs by more than `tolerance` of the largest entry.
#[track_caller]
fn assert_exact<const D: usize>(found: &Tensor<D>, expected: &Exact, tolerance: f64, what: &str) {
    let found = Exact::of(found);
    assert_eq!((found.rows, found.columns), (expected.rows, expected.columns), "{what}");
    let scale = expected.values.iter().fold(1e-12, |scale: f64, value| scale.max(value.abs()));
    for (i, (found, expected)) in found.values.iter().zip(&expected.values).enumerate() {
        let difference = (found - expected).abs() / scale;
        assert!(difference <= tolerance, "{what}: entry {i} is {found}, not {expected} ({difference:e})");
    }
}

/// Runs a recorded function. Returns its result, the gradient of the result that was used (of one sign, so that sums over it
/// are well conditioned), and the gradients of the inputs.
fn recorded<const N: usize>(
    inputs: [&Exact; N],
    function: impl Fn([Tensor<2>; N]) -> Tensor<2>,
) -> (Tensor<2>, Exact, [Tensor<2>; N]) {
    let inputs = inputs.map(|input| input.tensor().autodiff().require_grad());
    let output = function(inputs.clone());
    let [rows, columns] = output.dims();
    let weights = Exact::of(&(uniform(rows, columns, 0.5, 77, &device()) + 1.0));
    let gradients = (output.clone() * weights.tensor().autodiff()).sum().backward();
    (output.inner(), weights, inputs.map(|input| input.grad(&gradients).expect("tracked")))
}

#[test]
fn products() {
    let sizes = [
        [1, 1, 1],
        [1, 257, 3],
        [3, 9, 1],
        [9, 3, 33],
        [33, 129, 9],
        [129, 33, 129],
        [257, 9, 33],
        [128, 64, 256],
        [132, 36, 12],
        // Sums cut into chunks, of which the last one is shorter.
        [1, 3_000, 1],
        [33, 4_001, 9],
        [12, 2_052, 8],
        [129, 1_001, 257],
    ];
    for (seed, [rows, depth, columns]) in (0..).zip(sizes) {
        let (lhs, rhs) =
            (Exact::random(rows, depth, 3.0, 2 * seed), Exact::random(depth, columns, 3.0, 2 * seed + 1));
        let expected = lhs.times(&rhs);
        let mut gradients = None;
        for [turn_lhs, turn_rhs] in [[false, false], [false, true], [true, false], [true, true]] {
            // As the factor lies in memory.
            let stored = |matrix: &Exact, turn| if turn { matrix.transposed() } else { matrix.clone() };
            let view = |matrix: Tensor<2>, turn| if turn { matrix.transpose() } else { matrix };
            let what = format!("{rows}x{depth} (transposed {turn_lhs}) times {depth}x{columns} ({turn_rhs})");
            let (output, weights, found) =
                recorded([&stored(&lhs, turn_lhs), &stored(&rhs, turn_rhs)], |[lhs, rhs]| {
                    product(view(lhs, turn_lhs), view(rhs, turn_rhs))
                });
            assert_exact(&output, &expected, PRODUCT, &what);
            let [of_lhs, of_rhs] = gradients
                .get_or_insert_with(|| [weights.times(&rhs.transposed()), lhs.transposed().times(&weights)]);
            assert_exact(&found[0], &stored(of_lhs, turn_lhs), PRODUCT, &what);
            assert_exact(&found[1], &stored(of_rhs, turn_rhs), PRODUCT, &what);
        }
        let addend = Exact::random(rows, columns, 3.0, 500);
        let sum = Exact::new(rows, columns, |r, c| expected.at(r, c) + addend.at(r, c));
        let found = product_add(lhs.tensor(), rhs.tensor(), addend.tensor());
        assert_exact(&found, &sum, PRODUCT, "product_add");
    }
}

/// Distribution function of the standard normal distribution.
fn normal_distribution(x: f64) -> f64 {
    let z = x * std::f64::consts::FRAC_1_SQRT_2;
    // Further out the series loses its digits, and erfc is below 2·10⁻⁸.
    if z.abs() > 4.0 {
        return if z > 0.0 { 1.0 } else { 0.0 };
    }
    let (mut term, mut erf) = (z, z);
    for n in 1..100 {
        term *= -z * z / f64::from(n);
        erf += term / f64::from(2 * n + 1);
    }
    0.5 + erf / std::f64::consts::PI.sqrt()
}

fn activated(activation: Activation, x: f64) -> f64 {
    match activation {
        Activation::Identity => x,
        Activation::Relu => x.max(0.0),
        Activation::Gelu => x * normal_distribution(x),
    }
}

fn slope(activation: Activation, x: f64) -> f64 {
    match activation {
        Activation::Identity => 1.0,
        Activation::Relu => f64::from(u8::from(x > 0.0)),
        Activation::Gelu => {
            normal_distribution(x) + x * (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
        }
    }
}

/// The garment of every row.
fn garments(packing: &Packing) -> Vec<usize> {
    packing.ranges().enumerate().flat_map(|(garment, rows)| rows.map(move |_| garment)).collect()
}

fn check_activation<const N: usize>(
    activation: Activation,
    packing: &Packing,
    columns: usize,
    residual: bool,
) {
    let what = format!("{activation:?} of {N} arguments, {:?} by {columns}", packing.offsets());
    let matrices = N - 1 - usize::from(residual);
    let inputs: [Exact; N] = std::array::from_fn(|i| {
        let rows = if i == matrices { packing.count() } else { packing.rows() };
        Exact::random(rows, columns, 2.0, i as u64)
    });
    let of_row = garments(packing);
    let sum = Exact::new(packing.rows(), columns, |row, column| {
        let shared = inputs[matrices].at(of_row[row], column);
        inputs[..matrices].iter().map(|matrix| matrix.at(row, column)).sum::<f64>() + shared
    });
    let expected = Exact::new(packing.rows(), columns, |row, column| {
        let residual = if residual { inputs[N - 1].at(row, column) } else { 0.0 };
        activated(activation, sum.at(row, column)) + residual
    });
    let operation = ActivatedSum { activation, packing: packing.clone(), has_residual: residual };
    let (output, weights, gradients) =
        recorded(inputs.each_ref(), |arguments| apply(operation.clone(), arguments));
    assert_exact(&output, &expected, OUTPUT, &what);
    let of_sum = Exact::new(packing.rows(), columns, |row, column| {
        weights.at(row, column) * slope(activation, sum.at(row, column))
    });
    for (i, gradient) in gradients.iter().enumerate() {
        match i {
            _ if i < matrices => assert_exact(gradient, &of_sum, OUTPUT, &what),
            _ if i == matrices => assert_exact(gradient, &of_sum.column_sums(packing), SUM, &what),
            _ => assert_exact(gradient, &weights, 0.0, &what),
        }
    }
}

#[test]
fn activations() {
    let packings: [(&[usize], &[usize]); 3] =
        [(&[70], &[1, 3, 8, 132]), (&[300, 1, 555], &[9, 12]), (&[256, 257], &[33, 260])];
    for activation in super::ACTIVATIONS {
        for (rows, widths) in packings {
            let packing = Packing::new(rows.iter().copied());
            for &columns in widths {
                check_activation::<2>(activation, &packing, columns, false);
                check_activation::<3>(activation, &packing, columns, false);
                check_activation::<3>(activation, &packing, columns, true);
                check_activation::<4>(activation, &packing, columns, true);
            }
        }
        // More rows than the blocks of one block of rows.
        check_activation::<2>(activation, &Packing::new([66_000]), 1, false);
    }
}

#[test]
fn sine_modulations() {
    for ([rows, columns], omega) in
        [([1, 1], 1.0), ([70, 33], 30.0), ([300, 36], 30.0), ([257, 130], 1.0), ([66_000, 1], 10.0)]
    {
        let input = Exact::random(rows, columns, 3.0, 1);
        let bias = Exact::random(1, columns, 3.0, 2);
        let gate = Exact::random(rows, columns, 1.0, 3).map(|value| f64::from(value as f32 + 1.5));
        let what = format!("{rows}x{columns}, omega {omega}");
        // The phase is rounded to f32; what counts is how well its sine is known.
        let phase = Exact::new(rows, columns, |row, column| {
            f64::from((input.at(row, column) as f32 + bias.at(0, column) as f32) * omega as f32)
        });
        let (output, weights, [of_input, of_bias, of_gate]) =
            recorded([&input, &bias, &gate], |[input, bias, gate]| sine_modulation(input, bias, gate, omega));
        let each = |entry: &dyn Fn(f64, f64, f64) -> f64| {
            Exact::new(rows, columns, |r, c| entry(phase.at(r, c), gate.at(r, c), weights.at(r, c)))
        };
        assert_exact(&output, &each(&|phase, gate, _| phase.sin() * gate), OUTPUT, &what);
        assert_exact(&of_gate, &each(&|phase, _, weight| phase.sin() * weight), OUTPUT, &what);
        let inner = each(&|phase, gate, weight| omega * phase.cos() * gate * weight);
        assert_exact(&of_input, &inner, OUTPUT, &what);
        // Terms of both signs cancel: the error is that of the sum of their sizes.
        let all = Packing::new([rows]);
        let (sum, size) = (inner.column_sums(&all), inner.map(f64::abs).column_sums(&all));
        for column in 0..columns {
            let difference = (Exact::of(&of_bias).at(0, column) - sum.at(0, column)).abs();
            assert!(difference <= OUTPUT * size.at(0, column), "{what}: {difference}");
        }
    }
}

#[test]
fn features_of_gradients() {
    for [vertices, width] in [[1, 1], [70, 5], [300, 8], [257, 64]] {
        let mixed = Exact::random(2 * vertices, 3 * width, 1.0, 4);
        let what = format!("{vertices} vertices, width {width}");
        let (output, weights, [gradient]) = recorded([&mixed], |[mixed]| gradient_features(mixed));
        let blocks = |vertex: usize, channel: usize| {
            [vertex, vertices + vertex].map(|row| [0, 1, 2].map(|part| mixed.at(row, part * width + channel)))
        };
        let feature = |vertex, channel| {
            let [[x0, x1, x2], [y0, y1, y2]] = blocks(vertex, channel);
            (x0 * (x1 - y2) + y0 * (y1 + x2)).tanh()
        };
        assert_exact(&output, &Exact::new(vertices, width, feature), OUTPUT, &what);
        let expected = Exact::new(2 * vertices, 3 * width, |row, column| {
            let (vertex, channel) = (row % vertices, column % width);
            let [[x0, x1, x2], [y0, y1, y2]] = blocks(vertex, channel);
            let slope = weights.at(vertex, channel) * (1.0 - feature(vertex, channel).powi(2));
            slope * [[x1 - y2, x0, y0], [y1 + x2, y0, -x0]][row / vertices][column / width]
        });
        assert_exact(&gradient, &expected, OUTPUT, &what);
    }
}

#[test]
fn moved_points() {
    for rows in [1, 255, 700] {
        let (transforms, points) = (Exact::random(rows, 12, 2.0, 5), Exact::random(rows, 3, 2.0, 6));
        let (output, weights, [of_transforms, of_points]) =
            recorded([&transforms, &points], |[transforms, points]| transform_points(transforms, points));
        let moved = |row, axis: usize| {
            let line = |k| transforms.at(row, 4 * axis + k);
            (0..3).map(|k| line(k) * points.at(row, k)).sum::<f64>() + line(3)
        };
        assert_exact(&output, &Exact::new(rows, 3, moved), OUTPUT, "points");
        let of_entry = |row, entry: usize| {
            weights.at(row, entry / 4) * if entry % 4 < 3 { points.at(row, entry % 4) } else { 1.0 }
        };
        assert_exact(&of_transforms, &Exact::new(rows, 12, of_entry), OUTPUT, "gradient of transforms");
        let of_point =
            |row, k| (0..3).map(|axis| transforms.at(row, 4 * axis + k) * weights.at(row, axis)).sum::<f64>();
        assert_exact(&of_points, &Exact::new(rows, 3, of_point), OUTPUT, "gradient of points");
    }
}

#[test]
fn skin_corrections() {
    let packing = Packing::new([300, 1, 257, 4]);
    let of_row = garments(&packing);
    for (joints, zero_sum) in [(4, true), (4, false), (25, true), (25, false)] {
        let (rows, scale) = (packing.rows(), 0.3);
        let (weights, raw) = (Exact::random(rows, joints, 1.0, 7), Exact::random(rows, joints, 3.0, 8));
        // The last garment uses no joint.
        let mask = Exact::new(4, joints, |garment, joint| {
            f64::from(u8::from(garment < 3 && !(joint + garment).is_multiple_of(3)))
        });
        let projected = |values: &Exact, row: usize, joint: usize| {
            let used = |joint| mask.at(of_row[row], joint);
            let count: f64 = (0..joints).map(used).sum();
            let sum: f64 = (0..joints).map(|joint| used(joint) * values.at(row, joint)).sum();
            let mean = if zero_sum { sum / count.max(1.0) } else { 0.0 };
            scale * used(joint) * (values.at(row, joint) - mean)
        };
        let constant = mask.tensor();
        let (output, gradient, [of_weights, of_raw]) = recorded([&weights, &raw], |[weights, raw]| {
            skin_correction(weights, raw, constant.clone(), &packing, scale, zero_sum)
        });
        let expected = |row, joint| weights.at(row, joint) + projected(&raw, row, joint);
        assert_exact(&output, &Exact::new(rows, joints, expected), OUTPUT, "corrected");
        assert_exact(&of_weights, &gradient, 0.0, "gradient of weights");
        let expected = Exact::new(rows, joints, |row, joint| projected(&gradient, row, joint));
        assert_exact(&of_raw, &expected, OUTPUT, "gradient of corrections");
    }
}

/// Tensors of several sizes: one entry, no multiple of a vector, several groups, several rounds of every group.
fn some_tensors() -> Vec<Exact> {
    let sizes = [[1, 1], [3, 5], [129, 257], [1, 16_385], [300, 1], [70, 1_001]];
    (9..).zip(sizes).map(|(seed, [rows, columns])| Exact::random(rows, columns, 3.0, seed)).collect()
}

#[test]
fn squared_norms() {
    let tensors = some_tensors();
    let square = |tensor: &Exact| tensor.values.iter().map(|value| value * value).sum::<f64>();
    let norm = |tensors: &[Exact]| {
        squared_norm(tensors.iter().map(|tensor| tensor.tensor().into_dispatch()).collect())
    };
    let scalar = |value| Exact::new(1, 1, |_, _| value);
    for tensor in &tensors {
        let what = format!("{}x{}", tensor.rows, tensor.columns);
        assert_exact(&norm(std::slice::from_ref(tensor)), &scalar(square(tensor)), OUTPUT, &what);
        let turned = tensor.tensor().transpose().into_dispatch();
        assert_exact(&squared_norm(vec![turned]), &scalar(square(tensor)), OUTPUT, &what);
    }
    // More partial sums than a group has units.
    let many: Vec<Exact> = (0..3).flat_map(|_| tensors.clone()).collect();
    assert_exact(&norm(&many), &scalar(many.iter().map(square).sum()), OUTPUT, "all together");
}

#[test]
fn scaled_tensors() {
    let factor = || Tensor::<1>::from_floats([0.3], &device().inner());
    for values in some_tensors() {
        let expected = values.map(|value| f64::from(value as f32 * 0.3));
        let tensor = values.tensor();
        assert_exact(&scale_by(tensor.clone(), factor()), &expected, 1e-7, "a matrix");
        assert_exact(&tensor, &values, 0.0, "memory that is shared stays");
        let solid = tensor.clone().reshape([1, values.rows, values.columns]);
        assert_exact(&scale_by(solid, factor()), &expected, 1e-7, "three dimensions");
        assert_exact(&scale_by(tensor.transpose(), factor()), &expected.transposed(), 1e-7, "a view");
    }
    // More groups than one dimension of a grid may have.
    let count = 65_536 * 256 + 3;
    let ones = Tensor::<1>::ones([count], &device().inner());
    let scaled: Vec<f32> = scale_by(ones, factor()).to_data().try_to_vec().expect("f32");
    assert!(scaled.len() == count && scaled.iter().all(|value| *value == 0.3));
}

#[test]
fn blended_tensors() {
    for (decay, old) in [(0.999, 21), (0.0, 22), (0.25, 23)].into_iter().flat_map(|(decay, seed)| {
        some_tensors().into_iter().map(move |like| (decay, Exact::random(like.rows, like.columns, 3.0, seed)))
    }) {
        let new = Exact::random(old.rows, old.columns, 3.0, 24);
        let mean = Exact::new(old.rows, old.columns, |row, column| {
            decay * old.at(row, column) + (1.0 - decay) * new.at(row, column)
        });
        assert_exact(&blend(old.tensor(), new.tensor(), decay), &mean, OUTPUT, "a matrix");
        let turned = blend(old.tensor().transpose(), new.tensor().transpose(), decay);
        assert_exact(&turned, &mean.transposed(), OUTPUT, "a view");
    }
}

#[test]
fn adam_steps() {
    let factors = AdamFactors { beta_1: 0.9, beta_2: 0.999, step_size: 0.1, epsilon: 1e-3 };
    for like in some_tensors() {
        let (rows, columns) = (like.rows, like.columns);
        let [parameter, gradient, first] = [31, 32, 33].map(|seed| Exact::random(rows, columns, 3.0, seed));
        let second = Exact::random(rows, columns, 3.0, 34).map(|value| f64::from(value.abs() as f32));
        let [beta_1, beta_2, step_size, epsilon] =
            [factors.beta_1, factors.beta_2, factors.step_size, factors.epsilon].map(f64::from);
        let m =
            Exact::new(rows, columns, |r, c| beta_1 * first.at(r, c) + (1.0 - beta_1) * gradient.at(r, c));
        let v = Exact::new(rows, columns, |r, c| {
            beta_2 * second.at(r, c) + (1.0 - beta_2) * gradient.at(r, c).powi(2)
        });
        let p = Exact::new(rows, columns, |r, c| {
            parameter.at(r, c) - step_size * m.at(r, c) / (v.at(r, c).sqrt() + epsilon)
        });
        let kept = parameter.tensor();
        let moments = [first.tensor(), second.tensor()];
        let (found, [first, second]) = adam_step(kept.clone(), gradient.tensor(), moments, factors);
        assert_exact(&found, &p, OUTPUT, "parameter");
        assert_exact(&first, &m, OUTPUT, "first moment");
        assert_exact(&second, &v, OUTPUT, "second moment");
        assert_exact(&kept, &parameter, 0.0, "memory that is shared stays");
    }
}

/// Both NaNs of the host and those that GPUs make.
#[test]
fn not_a_number_stays_one() {
    for bits in [0x7fc0_0000, 0x7fff_ffff, 0xffff_ffff] {
        let nan = f32::from_bits(bits);
        let of = |rows: usize, columns: usize, value: f32| {
            let values = vec![value; rows * columns];
            Tensor::<2>::from_data(TensorData::new(values, [rows, columns]), &device().inner())
        };
        let all_nan = |what: &str, found: Tensor<2>| {
            let found = Exact::of(&found);
            assert!(
                found.values.iter().all(|value| value.is_nan()),
                "{what} of {bits:x}: {}",
                found.at(0, 0)
            );
        };
        for activation in super::ACTIVATIONS {
            all_nan("activation", activate(activation, of(4, 8, nan), of(1, 8, 1.0)));
        }
        all_nan("product", product(of(20, 40, nan), of(40, 24, 1.0)));
        all_nan("product", product(of(20, 40, 1.0), of(40, 24, nan)));
        all_nan("sine", sine_modulation(of(4, 8, nan), of(1, 8, 0.0), of(4, 8, 1.0), 1.0));
        all_nan("features", gradient_features(of(4, 24, nan)));
        all_nan("points", transform_points(of(4, 12, nan), of(4, 3, 1.0)));
        let packing = Packing::new([4]);
        all_nan("skin", skin_correction(of(4, 8, 1.0), of(4, 8, nan), of(1, 8, 1.0), &packing, 0.5, true));
        all_nan("mean", blend(of(4, 8, nan), of(4, 8, 1.0), 0.5));
        all_nan("scaled", scale_by(of(4, 8, 1.0), Tensor::from_floats([nan], &device().inner())));
        let norm = squared_norm(vec![of(4, 8, 1.0).into_dispatch(), of(4, 8, nan).into_dispatch()]);
        all_nan("norm", norm.reshape([1, 1]));
    }
}
