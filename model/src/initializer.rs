//! Initial parameters of a network.

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Samples the first values of parameters, which require gradients where the device has autodiff, in the order of the calls.
///
/// The generator is its own and not burn's, which is one for the whole process: a seed gives the same parameters on every
/// device, whatever else samples or trains in parallel.
#[derive(Debug)]
pub struct Initializer {
    rng: ChaCha8Rng,
    device: Device,
}

impl Initializer {
    /// A generator seeded with `seed`, for parameters on `device`.
    pub fn new(seed: u64, device: &Device) -> Self {
        Self { rng: ChaCha8Rng::seed_from_u64(seed), device: device.clone() }
    }

    /// A parameter drawn from U(±bound) at once: drawing lazily would make the weights depend on the order of first use.
    pub(crate) fn uniform<const D: usize>(&mut self, shape: [usize; D], bound: f64) -> Param<Tensor<D>> {
        let bound = bound as f32;
        self.fill(shape, |_, unit| bound * unit)
    }

    /// A matrix or row of which column j is drawn from U(±bounds\[j\]).
    pub(crate) fn uniform_columns<const D: usize>(
        &mut self,
        shape: [usize; D],
        bounds: &[f32],
    ) -> Param<Tensor<D>> {
        self.fill(shape, |entry, unit| bounds[entry % bounds.len()] * unit)
    }

    /// A parameter of zeros.
    pub(crate) fn zeros<const D: usize>(&self, shape: [usize; D]) -> Param<Tensor<D>> {
        Param::from_tensor(Tensor::zeros(shape, &self.device))
    }

    /// Entries from their number and a draw from U(±1).
    fn fill<const D: usize>(
        &mut self,
        shape: [usize; D],
        entry: impl Fn(usize, f32) -> f32,
    ) -> Param<Tensor<D>> {
        let count = shape.iter().product();
        let values: Vec<f32> = (0..count).map(|i| entry(i, self.rng.random_range(-1.0..1.0))).collect();
        Param::from_tensor(Tensor::from_data(TensorData::new(values, shape), &self.device))
    }
}

/// Bound 1/√fan_in of the uniform distribution a linear layer starts from.
pub(crate) fn fan_in_bound(fan_in: usize) -> f64 {
    1.0 / (fan_in.max(1) as f64).sqrt()
}
