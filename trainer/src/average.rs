//! A running average of the networks' weights.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use clothcombo_model::ClothCombo;

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
        let mut weights = Collect(GradientsParams::new());
        model.visit(&mut weights);
        self.model = self.model.clone().map(&mut Blend { weights: weights.0, decay });
    }
}

struct Collect(GradientsParams);

impl ModuleVisitor for Collect {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        self.0.register::<D>(parameter.id, parameter.val().inner());
    }
}

struct Blend {
    weights: GradientsParams,
    decay: f64,
}

impl ModuleMapper for Blend {
    fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (id, value, mapper) = parameter.consume();
        let value = match self.weights.remove::<D>(id) {
            Some(new) => value * self.decay + new * (1.0 - self.decay),
            None => value,
        };
        Param::from_mapped_value(id, value, mapper)
    }
}
