//! Gradients of all parameters at once.

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::Tensor;

use crate::ops::{scale_by, squared_norm};

/// Scales all gradients of `module` so that their joint Euclidean norm is at most `max_norm`, and returns the norm before
/// as a tensor `[1]`, which nobody has to wait for. `None` if no parameter has a gradient.
///
/// burn's own clipping treats each tensor on its own; this is the norm over all parameters, as in the paper.
pub fn clip_global_norm<M: Module>(
    module: &M,
    gradients: &mut GradientsParams,
    max_norm: f64,
) -> Option<Tensor<1>> {
    let norm = global_norm(module, gradients)?;
    let factor = (norm.clone().add_scalar(1e-6).recip() * max_norm).clamp_max(1.0);
    module.visit(&mut Scale { gradients, factor });
    Some(norm)
}

/// Euclidean norm `[1]` of all gradients of `module`, `None` if there is none.
pub fn global_norm<M: Module>(module: &M, gradients: &GradientsParams) -> Option<Tensor<1>> {
    let mut squares = SquaredNorms { gradients, parts: Vec::new() };
    module.visit(&mut squares);
    (!squares.parts.is_empty()).then(|| Tensor::cat(squares.parts, 0).sum().sqrt())
}

struct SquaredNorms<'a> {
    gradients: &'a GradientsParams,
    parts: Vec<Tensor<1>>,
}

impl ModuleVisitor for SquaredNorms<'_> {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.get::<D>(parameter.id) {
            self.parts.push(squared_norm(gradient));
        }
    }
}

struct Scale<'a> {
    gradients: &'a mut GradientsParams,
    factor: Tensor<1>,
}

impl ModuleVisitor for Scale<'_> {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.remove::<D>(parameter.id) {
            self.gradients.register::<D>(parameter.id, scale_by(gradient, self.factor.clone()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::Linear;
    use crate::testing::{seeded, uniform};

    fn squares(layer: &Linear, gradients: &GradientsParams) -> f64 {
        let sum = |values: Vec<f32>| values.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>();
        let weight = gradients.get::<2>(layer.weight.id).expect("gradient").into_data();
        let bias = gradients.get::<1>(layer.bias.id).expect("gradient").into_data();
        sum(weight.try_to_vec().expect("f32")) + sum(bias.try_to_vec().expect("f32"))
    }

    #[test]
    fn clipping_scales_all_gradients_by_their_joint_norm() {
        let layer = seeded(1, |device| Linear::new(300, 200, device));
        for (scale, clipped) in [(50.0, true), (1e-6, false)] {
            let input = uniform(40, 300, 2.0, 1, &layer.weight.val().device());
            let loss = (layer.forward(input) * scale).square().sum();
            let mut gradients = GradientsParams::from_grads(loss.backward(), &layer);
            let before = squares(&layer, &gradients).sqrt();
            let norm = clip_global_norm(&layer, &mut gradients, 1.0).expect("gradients");
            let norm = f64::from(norm.into_scalar::<f32>());
            assert!((norm - before).abs() < 1e-5 * before, "{norm} {before}");
            let after = squares(&layer, &gradients).sqrt();
            let expected = if clipped { 1.0 } else { before };
            assert!((after - expected).abs() < 1e-4 * expected, "{after} {expected}");
        }
    }

    #[test]
    fn no_gradient_has_no_norm() {
        let layer = seeded(2, |device| Linear::new(3, 2, device));
        assert!(clip_global_norm(&layer, &mut GradientsParams::new(), 1.0).is_none());
    }
}
