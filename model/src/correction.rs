//! Correction networks, which are not the paper's: they move vertices by their contact features.
//!
//! The paper's networks do not see what their displacements do. A correction network reads that at every vertex: other garments,
//! the body, the forces of the cloth itself. It turns a displacement Δx from the start into
//!
//! ```text
//! Δx + bounded(1 cm (Σ_k a_k d_k + v) + b Δx)
//! ```
//!
//! with its outputs a, v and b: along the directions d_k of the contact features, along the axes, and along Δx itself. A step is
//! shorter than 2 cm, which bounds the error on cloth far from the training data. Several corrections in sequence are steps of a
//! learned solver.
//!
//! Contact features, embeddings and Δx are constants: no gradient passes through them. A run with such a gradient diverged
//! (`docs/corrections.md`).

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use crate::config::ModelConfig;
use crate::initializer::{Initializer, fan_in_bound};
use crate::linear::Linear;
use crate::mlp::residual_pairs;
use crate::ops::{Activation, activate_packed_sum, product};
use crate::packing::Packing;
use crate::tensors::ContactFeatureTensors;

/// Hidden layers after the first: residual pairs.
const HIDDEN: usize = 4;
/// Outputs: one per direction, one per axis, one for the displacement so far.
const OUTPUTS: usize = ContactFeatureTensors::DIRECTIONS + 4;
/// Displacement by an output of 1 (m).
const OUTPUT_UNIT: f64 = 0.01;
/// No step is longer than this (m).
const MAX_STEP: f64 = 0.02;

/// Contact features, z_v and z_s to a corrected displacement.
///
/// Parameters: `features` with `weight` and `bias`, `vertex` `[d,w]`, `garment` `[width,w]`, `hidden.{0…}` and `output` with
/// `weight` and `bias`. The output starts at zero: an untrained network corrects nothing.
#[derive(Module, Debug)]
pub struct Correction {
    /// Contact features to width.
    pub features: Linear,
    /// z_v to width.
    pub vertex: Param<Tensor<2>>,
    /// z_s to width.
    pub garment: Param<Tensor<2>>,
    /// Width to width.
    pub hidden: Vec<Linear>,
    /// Width to the outputs.
    pub output: Linear,
}

/// What the corrections of an outfit are conditioned on.
pub(crate) struct Conditioning<'a> {
    /// z_v `[ΣV,d]`.
    pub vertex: &'a Tensor<2>,
    /// z_s `[M,width]`.
    pub draping: &'a Tensor<2>,
    /// Rows of every garment.
    pub packing: &'a Packing,
}

impl Correction {
    pub(crate) fn new(config: &ModelConfig, start: &mut Initializer) -> Self {
        let width = config.correction_width;
        let bound = fan_in_bound(ContactFeatureTensors::FEATURES + config.embedding + config.width);
        Self {
            features: Linear::uniform(ContactFeatureTensors::FEATURES, width, bound, start),
            vertex: start.uniform([config.embedding, width], bound),
            garment: start.uniform([config.width, width], bound),
            hidden: (0..HIDDEN).map(|_| Linear::new(width, width, start)).collect(),
            output: Linear { weight: start.zeros([width, OUTPUTS]), bias: start.zeros([OUTPUTS]) },
        }
    }

    /// The displacement `[ΣV,3]` (m) after one step from `displacement`, where the vertices have the given contact features.
    pub(crate) fn correct(
        &self,
        displacement: Tensor<2>,
        ContactFeatureTensors { features, directions }: ContactFeatureTensors,
        conditioning: &Conditioning<'_>,
    ) -> Tensor<2> {
        let row = product(conditioning.draping.clone(), self.garment.val()) + self.features.bias_row();
        let inputs =
            [self.features.product(features), product(conditioning.vertex.clone(), self.vertex.val())];
        let hidden = activate_packed_sum(Activation::Gelu, inputs, row, conditioning.packing);
        let outputs = self.output.forward(residual_pairs(&self.hidden, hidden));
        let column = |k: usize| outputs.clone().narrow(1, k, 1);
        let free = outputs.clone().narrow(1, ContactFeatureTensors::DIRECTIONS, 3);
        let directed = directions.into_iter().enumerate();
        let correction = directed.fold(free, |sum, (k, direction)| sum + column(k) * direction);
        let step = column(OUTPUTS - 1) * displacement.clone() + correction * OUTPUT_UNIT;
        displacement + bounded(step)
    }
}

/// Steps `[N,3]` (m), short ones as they are, long ones shorter than [`MAX_STEP`].
fn bounded(step: Tensor<2>) -> Tensor<2> {
    let squared = (step.clone() * step.clone()).sum_dim(1);
    step / (squared / (MAX_STEP * MAX_STEP) + 1.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{device, uniform, values};

    #[test]
    fn short_steps_stay_and_long_ones_are_bounded_in_their_direction() {
        let steps = uniform(50, 3, 1.0, 3, &device());
        for (scale, most) in [(1e-4, 1e-4), (1e-2, MAX_STEP), (1e3, MAX_STEP)] {
            let given = values(&(steps.clone() * scale));
            let found = values(&bounded(steps.clone() * scale));
            for (a, b) in given.as_chunks::<3>().0.iter().zip(found.as_chunks::<3>().0) {
                let [long, short] = [a, b].map(|v| v.iter().map(|x| f64::from(x * x)).sum::<f64>().sqrt());
                let dot: f64 = a.iter().zip(b).map(|(x, y)| f64::from(x * y)).sum();
                assert!((dot - long * short).abs() <= 1e-5 * long * short, "the same direction");
                assert!(short <= most * 1.8 && short <= MAX_STEP * (1.0 + 1e-6));
                if scale < 1e-3 {
                    assert!((short - long).abs() <= 1e-4 * long);
                }
            }
        }
    }
}
