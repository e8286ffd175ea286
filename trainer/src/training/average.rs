//! A running average of the networks' weights.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use clothcombo_model::ClothCombo;
use clothcombo_model::ops::blend;

/// `average ← d · average + (1 − d) · weights` after every step; d grows from 0.1 to `decay` over the first steps, so that
/// the random start is soon forgotten.
pub struct Average {
    model: ClothCombo,
    decay: f64,
}

impl Average {
    /// Starts at (or goes on from) `model`, without automatic differentiation.
    pub fn new(model: ClothCombo, decay: f64) -> Self {
        Self { model, decay }
    }

    /// The averaged networks.
    pub fn model(&self) -> &ClothCombo {
        &self.model
    }

    /// Takes in the weights of `model` after `steps` steps.
    pub fn update(&mut self, model: &ClothCombo, steps: u64) {
        let steps = steps as f64;
        let decay = self.decay.min((1.0 + steps) / (10.0 + steps));
        // burn's container of tensors by parameter; nothing in it is a gradient here.
        let mut weights = CollectWeights(GradientsParams::new());
        model.visit(&mut weights);
        self.model = self.model.clone().map(&mut BlendWeights { weights: weights.0, decay });
    }
}

struct CollectWeights(GradientsParams);

impl ModuleVisitor for CollectWeights {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        self.0.register::<D>(parameter.id, parameter.val().inner());
    }
}

struct BlendWeights {
    weights: GradientsParams,
    decay: f64,
}

impl ModuleMapper for BlendWeights {
    fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (id, value, mapper) = parameter.consume();
        let value = match self.weights.remove::<D>(id) {
            Some(new) => blend(value, new, self.decay),
            None => value,
        };
        Param::from_mapped_value(id, value, mapper)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::device::default_device;
    use clothcombo_model::{Dimensions, ModelConfig};

    struct Doubled;
    impl ModuleMapper for Doubled {
        fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
            let (id, value, mapper) = parameter.consume();
            Param::from_mapped_value(id, value * 2.0, mapper)
        }
    }

    #[derive(Default)]
    struct Values(Vec<f32>);
    impl ModuleVisitor for Values {
        fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
            let data = parameter.val().into_data();
            self.0.extend_from_slice(data.as_slice::<f32>().unwrap());
        }
    }

    fn values(model: &ClothCombo) -> Vec<f32> {
        let mut values = Values::default();
        model.visit(&mut values);
        values.0
    }

    #[test]
    fn it_moves_towards_the_weights_by_one_minus_the_decay() {
        let device = default_device().autodiff();
        let config = ModelConfig {
            width: 4,
            embedding: 4,
            diffusion_blocks: 1,
            diffusion_width: 4,
            eigen_count: 4,
            mlp_layers: 2,
            siren_layers: 1,
            siren_width: 4,
            skinning_layers: 1,
            skinning_width: 4,
            ..ModelConfig::default()
        };
        let model =
            ClothCombo::new(&config, &Dimensions { joints: 2, shape: 2, pose: 18 }, 0, &device).unwrap();
        let before = values(&model);
        let mut average = Average::new(model.valid(), 0.9);
        average.update(&model, 1_000_000);
        let unchanged = values(average.model());
        assert!(before.iter().zip(&unchanged).all(|(a, b)| (a - b).abs() <= 1e-6 * a.abs()));
        let doubled = model.map(&mut Doubled);
        average.update(&doubled, 1_000_000);
        let late = values(average.model());
        assert!(before.iter().zip(&late).all(|(a, b)| (1.1 * a - b).abs() <= 1e-5 * a.abs()));
        average.update(&doubled, 0);
        let early = values(average.model());
        let expected = |a: f32| 0.1 * 1.1 * a + 0.9 * 2.0 * a;
        assert!(before.iter().zip(&early).all(|(a, b)| (expected(*a) - b).abs() <= 1e-5 * a.abs()));
    }
}
