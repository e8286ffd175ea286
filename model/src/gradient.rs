//! Gradients of all parameters at once.

use burn::backend::DispatchTensor;
use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Tensor, TensorData};

use crate::ops::{scale_by, squared_norm};

/// Scales all gradients of `module` so that their joint Euclidean norm is at most `max_norm` (`None`: leaves them), then by
/// `share`, their weight in a mean of several. Returns the norm before as a tensor `[1]`, without waiting for the device; `None`
/// if no parameter has a gradient.
///
/// burn's own clipping treats each tensor on its own; this is the norm over all parameters, as in the paper.
pub fn clip_global_norm<M: Module>(
    module: &M,
    gradients: &mut GradientsParams,
    max_norm: Option<f64>,
    share: f64,
) -> Option<Tensor<1>> {
    let norm = global_norm(module, gradients)?;
    let clip = match max_norm {
        Some(most) => (norm.clone().add_scalar(1e-6).recip() * most).clamp_max(1.0),
        None => norm.ones_like(),
    };
    // A share of 1 changes no bit.
    module.visit(&mut ScaleGradients { gradients, factor: clip * share });
    Some(norm)
}

/// Euclidean norm `[1]` of all gradients of `module`, `None` if there is none.
fn global_norm<M: Module>(module: &M, gradients: &GradientsParams) -> Option<Tensor<1>> {
    let mut all = CollectGradients { gradients, found: Vec::new() };
    module.visit(&mut all);
    (!all.found.is_empty()).then(|| squared_norm(all.found).sqrt())
}

struct CollectGradients<'a> {
    gradients: &'a GradientsParams,
    found: Vec<DispatchTensor>,
}

impl ModuleVisitor for CollectGradients<'_> {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.get::<D>(parameter.id) {
            self.found.push(gradient.into_dispatch());
        }
    }
}

struct ScaleGradients<'a> {
    gradients: &'a mut GradientsParams,
    factor: Tensor<1>,
}

impl ModuleVisitor for ScaleGradients<'_> {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.remove::<D>(parameter.id) {
            self.gradients.register::<D>(parameter.id, scale_by(gradient, self.factor.clone()));
        }
    }
}

/// All gradients of `module` as one row, to be summed over processes at once: those of every parameter in the order of the
/// module (zeros where there is none), then for every parameter 1 if it has a gradient and 0 if not.
pub fn gradient_bucket<M: Module>(module: &M, gradients: &GradientsParams) -> Vec<f32> {
    let mut pack = Pack { gradients, values: Vec::with_capacity(module.num_params()), present: Vec::new() };
    module.visit(&mut pack);
    pack.values.append(&mut pack.present);
    pack.values
}

/// The gradients in a [`gradient_bucket`] of `module`, or in a sum of such.
///
/// # Panics
/// If the bucket is of another module.
pub fn gradients_of_bucket<M: Module>(module: &M, bucket: &[f32]) -> GradientsParams {
    let (values, present) = bucket.split_at(module.num_params());
    let mut unpack = Unpack { gradients: GradientsParams::new(), values, present: present.iter() };
    module.visit(&mut unpack);
    unpack.gradients
}

struct Pack<'a> {
    gradients: &'a GradientsParams,
    values: Vec<f32>,
    present: Vec<f32>,
}

impl ModuleVisitor for Pack<'_> {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        let gradient = self.gradients.get::<D>(parameter.id);
        self.present.push(if gradient.is_some() { 1.0 } else { 0.0 });
        let end = self.values.len() + parameter.lazy_shape().num_elements();
        if let Some(gradient) = gradient {
            let data = gradient.into_data();
            self.values.extend_from_slice(data.as_slice().expect("gradients are f32"));
        }
        self.values.resize(end, 0.0);
    }
}

struct Unpack<'a> {
    gradients: GradientsParams,
    values: &'a [f32],
    present: std::slice::Iter<'a, f32>,
}

impl ModuleVisitor for Unpack<'_> {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        let shape = parameter.lazy_shape();
        let (values, rest) = self.values.split_at(shape.num_elements());
        self.values = rest;
        if *self.present.next().expect("a flag for every parameter") > 0.0 {
            let data = TensorData::new(values.to_vec(), shape);
            let gradient = Tensor::<D>::from_data(data, &parameter.lazy_device().without_autodiff());
            self.gradients.register::<D>(parameter.id, gradient);
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
        let layer = seeded(1, |start| Linear::new(300, 200, start));
        for (scale, max_norm, share) in
            [(50.0, Some(1.0), 1.0), (50.0, Some(2.0), 0.25), (1e-6, Some(1.0), 0.5), (50.0, None, 0.5)]
        {
            let input = uniform(40, 300, 2.0, 1, &layer.weight.val().device());
            let loss = (layer.forward(input) * scale).square().sum();
            let mut gradients = GradientsParams::from_grads(loss.backward(), &layer);
            let before = squares(&layer, &gradients).sqrt();
            let norm = clip_global_norm(&layer, &mut gradients, max_norm, share).expect("gradients");
            let norm = f64::from(norm.into_scalar::<f32>());
            assert!((norm - before).abs() < 1e-5 * before, "{norm} {before}");
            let after = squares(&layer, &gradients).sqrt();
            let expected = share * max_norm.map_or(before, |most| before.min(most));
            assert!((after - expected).abs() < 1e-4 * expected, "{after} {expected}");
        }
    }

    #[test]
    fn no_gradient_has_no_norm() {
        let layer = seeded(2, |start| Linear::new(3, 2, start));
        assert!(clip_global_norm(&layer, &mut GradientsParams::new(), Some(1.0), 1.0).is_none());
    }

    #[test]
    fn a_bucket_keeps_every_gradient_and_which_parameters_have_one() {
        let layer = seeded(3, |start| Linear::new(5, 4, start));
        let device = layer.weight.val().device();
        let loss = layer.forward(uniform(6, 5, 1.0, 1, &device)).square().sum();
        let mut gradients = GradientsParams::from_grads(loss.backward(), &layer);
        let expected = squares(&layer, &gradients);
        let bucket = gradient_bucket(&layer, &gradients);
        assert_eq!(bucket.len(), 5 * 4 + 4 + 2);
        assert_eq!(squares(&layer, &gradients_of_bucket(&layer, &bucket)), expected);

        gradients.remove::<1>(layer.bias.id);
        let without_bias = gradients_of_bucket(&layer, &gradient_bucket(&layer, &gradients));
        assert!(without_bias.get::<1>(layer.bias.id).is_none());
        assert!(without_bias.get::<2>(layer.weight.id).is_some());
    }
}
