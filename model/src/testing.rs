//! What the tests of this crate share.

use std::ops::Range;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Device, Gradients, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::initializer::Initializer;
use crate::packing::Packing;
use crate::tensors::{GarmentArrays, GarmentTensors};

/// The autodiff device the tests run on.
pub(crate) fn device() -> Device {
    #[cfg(feature = "flex")]
    let device = Device::flex();
    #[cfg(all(not(feature = "flex"), feature = "ndarray"))]
    #[allow(deprecated)]
    let device = Device::ndarray();
    #[cfg(all(not(feature = "flex"), not(feature = "ndarray")))]
    let device = Device::default();
    device.autodiff()
}

/// The elements of a tensor.
pub(crate) fn values(tensor: &Tensor<2>) -> Vec<f32> {
    tensor.to_data().try_to_vec().expect("f32")
}

/// Largest difference of two tensors over the largest element of the second.
pub(crate) fn relative_difference(found: &Tensor<2>, expected: &Tensor<2>) -> f64 {
    assert_eq!(found.dims(), expected.dims());
    let (found, expected) = (values(found), values(expected));
    let scale = expected.iter().fold(0.0f64, |scale, value| scale.max(f64::from(value.abs())));
    let difference = found.iter().zip(&expected).map(|(a, b)| f64::from((a - b).abs()));
    difference.fold(0.0, |worst, value| if value.is_nan() { f64::INFINITY } else { f64::max(worst, value) })
        / scale.max(1e-12)
}

/// Fails if two tensors differ by more than `tolerance` of the largest element.
#[track_caller]
pub(crate) fn assert_close(found: &Tensor<2>, expected: &Tensor<2>, tolerance: f64) {
    let difference = relative_difference(found, expected);
    assert!(difference <= tolerance, "relative difference {difference:e} > {tolerance:e}");
}

/// Output of a function and the gradients of all its inputs under a fixed random weighting of the output.
pub(crate) fn gradients_of<const N: usize>(
    inputs: &[Tensor<2>; N],
    function: impl Fn([Tensor<2>; N]) -> Tensor<2>,
) -> (Tensor<2>, [Tensor<2>; N]) {
    let inputs = inputs.each_ref().map(|input| input.clone().detach().require_grad());
    let output = function(inputs.clone());
    let gradients = loss(output.clone()).backward();
    let gradients = inputs.map(|input| match input.grad(&gradients) {
        Some(gradient) => gradient,
        None => input.inner().zeros_like(),
    });
    (output.inner(), gradients)
}

/// Gives every row its garment's row of `[M,C]`: `[ΣV,C]`.
pub(crate) fn broadcast(rows: Tensor<2>, packing: &Packing) -> Tensor<2> {
    let of_garment = |(garment, range): (usize, Range<usize>)| {
        rows.clone().narrow(0, garment, 1).repeat_dim(0, range.len())
    };
    Tensor::cat(packing.ranges().enumerate().map(of_garment).collect(), 0)
}

/// Sum of all elements with irregular weights.
pub(crate) fn loss(output: Tensor<2>) -> Tensor<1> {
    let weights = weighting(output.dims(), &output.device());
    (output * weights).sum()
}

/// The same irregular weights for the same shape.
pub(crate) fn weighting([rows, columns]: [usize; 2], device: &Device) -> Tensor<2> {
    let values: Vec<f32> = (0..rows * columns).map(|i| ((i * 37 % 101) as f32 / 50.0) - 1.0).collect();
    Tensor::<1>::from_floats(values.as_slice(), &device.clone().inner()).reshape([rows, columns])
}

/// Uniform values in ±`range`, the same for the same arguments.
pub(crate) fn uniform(rows: usize, columns: usize, range: f32, seed: u64, device: &Device) -> Tensor<2> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let values: Vec<f32> = (0..rows * columns).map(|_| rng.random_range(-range..range)).collect();
    Tensor::from_data(TensorData::new(values, [rows, columns]), &device.clone().inner())
}

/// Makes a part of the networks with random parameters.
pub(crate) fn seeded<T>(seed: u64, make: impl FnOnce(&mut Initializer) -> T) -> T {
    make(&mut Initializer::new(seed, &device()))
}

/// A garment with `vertices` vertices and `eigen` eigenpairs of plausible size; algebra does not ask for more.
pub(crate) struct HostGarment {
    rest: Vec<f32>,
    mass: Vec<f64>,
    eigenvalues: Vec<f64>,
    eigenvectors: Vec<f32>,
    gradient_x: Vec<f32>,
    gradient_y: Vec<f32>,
    skin_weights: Vec<f32>,
    joints: usize,
}

impl HostGarment {
    /// Only joints with `used[j]` carry weight.
    pub(crate) fn random(vertices: usize, eigen: usize, used: &[bool], seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut sample = |count: usize, low: f32, high: f32| -> Vec<f32> {
            (0..count).map(|_| rng.random_range(low..high)).collect()
        };
        let mass: Vec<f64> = sample(vertices, 1e-4, 3e-4).into_iter().map(f64::from).collect();
        let size = 1.0 / (mass.iter().sum::<f64>().sqrt() as f32);
        let mut skin_weights = sample(vertices * used.len(), 0.1, 1.0);
        for row in skin_weights.chunks_exact_mut(used.len()) {
            row.iter_mut().zip(used).filter(|(_, used)| !**used).for_each(|(weight, _)| *weight = 0.0);
            let sum: f32 = row.iter().sum();
            row.iter_mut().for_each(|weight| *weight /= sum);
        }
        Self {
            rest: sample(vertices * 3, -0.6, 0.6),
            mass,
            eigenvalues: (0..eigen).map(|i| 15.0 * i as f64).collect(),
            eigenvectors: sample(vertices * eigen, -size, size),
            gradient_x: sample(vertices * eigen, -10.0 * size, 10.0 * size),
            gradient_y: sample(vertices * eigen, -10.0 * size, 10.0 * size),
            skin_weights,
            joints: used.len(),
        }
    }

    /// The garment with its vertices in the given order.
    pub(crate) fn permuted(&self, order: &[usize]) -> Self {
        fn rows<T: Copy>(values: &[T], order: &[usize]) -> Vec<T> {
            let columns = values.len() / order.len();
            order.iter().flat_map(|&row| values[row * columns..(row + 1) * columns].iter().copied()).collect()
        }
        Self {
            rest: rows(&self.rest, order),
            mass: rows(&self.mass, order),
            eigenvalues: self.eigenvalues.clone(),
            eigenvectors: rows(&self.eigenvectors, order),
            gradient_x: rows(&self.gradient_x, order),
            gradient_y: rows(&self.gradient_y, order),
            skin_weights: rows(&self.skin_weights, order),
            joints: self.joints,
        }
    }

    pub(crate) fn arrays(&self) -> GarmentArrays<'_> {
        GarmentArrays {
            rest: &self.rest,
            mass: &self.mass,
            eigenvalues: &self.eigenvalues,
            eigenvectors: &self.eigenvectors,
            gradient_x_basis: &self.gradient_x,
            gradient_y_basis: &self.gradient_y,
            skin_weights: &self.skin_weights,
        }
    }

    pub(crate) fn tensors(&self, device: &Device) -> GarmentTensors {
        GarmentTensors::new(&self.arrays(), self.joints, device).expect("valid arrays")
    }
}

/// Gradients of every parameter of a module under one loss, in visit order, with their names.
pub(crate) fn parameter_gradients<M: Module>(module: &M, loss: Tensor<1>) -> Vec<(String, Vec<f32>)> {
    struct CollectGradients<'a> {
        gradients: &'a Gradients,
        path: Vec<String>,
        found: Vec<(String, Vec<f32>)>,
    }
    impl ModuleVisitor for CollectGradients<'_> {
        fn enter_module(&mut self, name: &str, _: &str) {
            self.path.push(name.to_owned());
        }
        fn exit_module(&mut self, _: &str, _: &str) {
            self.path.pop();
        }
        fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
            let gradient = parameter.val().grad(self.gradients);
            let gradient = gradient.map_or_else(Vec::new, |g| g.into_data().try_to_vec().expect("f32"));
            self.found.push((self.path.join("."), gradient));
        }
    }
    let gradients = loss.backward();
    let mut collect = CollectGradients { gradients: &gradients, path: Vec::new(), found: Vec::new() };
    module.visit(&mut collect);
    collect.found
}

/// Fails unless both lists name the same parameters and every gradient agrees to `tolerance` of its largest element.
#[track_caller]
pub(crate) fn assert_gradients_close(
    found: &[(String, Vec<f32>)],
    expected: &[(String, Vec<f32>)],
    tolerance: f32,
) {
    assert_eq!(found.len(), expected.len());
    for ((name, found), (other, expected)) in found.iter().zip(expected) {
        assert_eq!((name, found.len()), (other, expected.len()));
        let scale = expected.iter().fold(1e-12f32, |scale, value| scale.max(value.abs()));
        for (found, expected) in found.iter().zip(expected) {
            assert!(
                (found - expected).abs() <= tolerance * scale,
                "{name}: {found} {expected} (scale {scale})"
            );
        }
    }
}

/// Fails unless the largest gradient of every named parameter of `module`, under the [`loss`] of `output`, is the difference
/// quotient of one of the `steps`: short steps are lost in the rounding of f32, long ones pass kinks of the activations.
#[track_caller]
pub(crate) fn assert_gradients_match_differences<M: Module>(
    module: &M,
    names: &[&str],
    steps: &[f32],
    tolerance: f64,
    output: impl Fn(&M) -> Tensor<2>,
) {
    let gradients = parameter_gradients(module, loss(output(module)));
    for name in names {
        let (_, gradient) = gradients.iter().find(|(found, _)| found == name).expect("documented name");
        let index = (0..gradient.len()).max_by(|&a, &b| gradient[a].abs().total_cmp(&gradient[b].abs()));
        let index = index.expect("not empty");
        let value = |change: f32| -> f64 {
            let output = output(&change_parameter(module.clone(), name, index, change).valid());
            let weights = values(&weighting(output.dims(), &output.device()));
            values(&output).iter().zip(weights).map(|(x, w)| f64::from(*x) * f64::from(w)).sum()
        };
        let slope = |step: &f32| (value(*step) - value(-step)) / f64::from(2.0 * step);
        let slopes: Vec<f64> = steps.iter().map(slope).collect();
        let found = f64::from(gradient[index]);
        let fits = slopes.iter().any(|slope| (slope - found).abs() < tolerance * found.abs());
        assert!(fits, "{name}[{index}]: {found} {slopes:?}");
    }
}

/// Replaces one element of the parameter called `name` by `change(element)`.
pub(crate) fn change_parameter<M: Module>(module: M, name: &str, index: usize, change: f32) -> M {
    struct Change<'a> {
        name: &'a str,
        path: Vec<String>,
        index: usize,
        change: f32,
        done: bool,
    }
    impl ModuleMapper for Change<'_> {
        fn enter_module(&mut self, name: &str, _: &str) {
            self.path.push(name.to_owned());
        }
        fn exit_module(&mut self, _: &str, _: &str) {
            self.path.pop();
        }
        fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
            if self.path.join(".") != self.name {
                return parameter;
            }
            self.done = true;
            let (id, value, mapper) = parameter.consume();
            let (shape, device) = (value.shape(), value.device());
            let mut values: Vec<f32> = value.inner().into_data().try_to_vec().expect("f32");
            values[self.index] += self.change;
            let value = Tensor::from_data(TensorData::new(values, shape), &device);
            Param::from_mapped_value(id, value.require_grad(), mapper)
        }
    }
    let mut mapper = Change { name, path: Vec::new(), index, change, done: false };
    let module = module.map(&mut mapper);
    assert!(mapper.done, "no parameter is called {name}");
    module
}
