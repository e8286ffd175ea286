//! Adam, one pass over a parameter's memory per step.

use burn::optim::{AdamState, AdaptiveMomentumState, LearningRate, Optimizer};
use burn::tensor::{Device, Tensor};

use crate::ops::{AdamFactors, adam_step};

/// burn's Adam with a fused update: the same state and record, the same result to rounding.
///
/// burn composes the update from about ten operations on one thread, each with a new tensor; on networks of millions of
/// parameters that takes longer than all losses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FusedAdam {
    /// Decay of the first moment.
    pub beta_1: f32,
    /// Decay of the second moment.
    pub beta_2: f32,
    /// Added to the root of the second moment.
    pub epsilon: f32,
}

impl Optimizer for FusedAdam {
    type State<const D: usize> = AdamState<D>;

    fn step<const D: usize>(
        &self,
        rate: LearningRate,
        parameter: Tensor<D>,
        gradient: Tensor<D>,
        state: Option<AdamState<D>>,
    ) -> (Tensor<D>, Option<AdamState<D>>) {
        let state = state.map(|state| state.momentum).unwrap_or_else(|| {
            let zeros = || Tensor::zeros(gradient.shape(), &gradient.device());
            AdaptiveMomentumState::new(0, zeros(), zeros())
        });
        let time = state.time + 1;
        let corrected = |beta: f32| 1.0 - f64::from(beta).powf(time as f64);
        let root = corrected(self.beta_2).sqrt();
        let factors = AdamFactors {
            beta_1: self.beta_1,
            beta_2: self.beta_2,
            step_size: (rate * root / corrected(self.beta_1)) as f32,
            epsilon: (f64::from(self.epsilon) * root) as f32,
        };
        let (parameter, [first, second]) =
            adam_step(parameter, gradient, [state.moment_1, state.moment_2], factors);
        (parameter, Some(AdamState::new(AdaptiveMomentumState::new(time, first, second))))
    }

    fn to_device<const D: usize>(mut state: AdamState<D>, device: &Device) -> AdamState<D> {
        state.momentum = state.momentum.to_device(device);
        state
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::Linear;
    use crate::testing::{assert_close, seeded, uniform};
    use burn::module::Module;
    use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer};

    /// Weight and bias after some steps.
    fn train(mut optimizer: ModuleOptimizer, steps: u64) -> [Tensor<2>; 2] {
        let mut layer = seeded(1, |start| Linear::new(37, 600, start));
        let device = layer.weight.val().device();
        for step in 0..steps {
            let loss = (layer.forward(uniform(20, 37, 2.0, step, &device)) - 0.3).square().mean();
            let gradients = GradientsParams::from_grads(loss.backward(), &layer);
            layer = optimizer.step(0.01, layer, gradients);
        }
        let layer = layer.valid();
        [layer.weight.val(), layer.bias_row()]
    }

    #[test]
    fn steps_are_those_of_burns_adam_and_its_record_is_read() {
        let adam = FusedAdam { beta_1: 0.9, beta_2: 0.99, epsilon: 1e-6 };
        let burn = || AdamConfig::new().with_beta_1(0.9).with_beta_2(0.99).with_epsilon(1e-6).init();
        for (found, expected) in train(adam.into(), 25).iter().zip(&train(burn(), 25)) {
            assert_close(found, expected, 1e-5);
        }
        assert_eq!(
            train(adam.into(), 5).map(|t| t.into_data()),
            train(adam.into(), 5).map(|t| t.into_data()),
            "the same to the bit"
        );
        let mut first = burn();
        let layer = seeded(1, |start| Linear::new(3, 2, start));
        let gradients = || {
            let input = Tensor::<2>::ones([1, 3], &layer.weight.val().device());
            GradientsParams::from_grads(layer.forward(input).sum().backward(), &layer)
        };
        let stepped = first.step(0.1, layer.clone(), gradients());
        let bytes = first.into_bytes().expect("a record");
        let mut fused = ModuleOptimizer::from(adam).from_bytes(bytes).expect("burn's record");
        let found = fused.step(0.1, stepped.clone(), gradients());
        let expected = first.step(0.1, stepped, gradients());
        assert_close(&found.valid().weight.val(), &expected.valid().weight.val(), 1e-6);
    }
}
