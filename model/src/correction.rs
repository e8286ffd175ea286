//! Correction networks, which are not the paper's: they change where vertices lie by what these feel there.
//!
//! The paper's networks are blind. D_s remembers where every garment lies on every body, F_f and D_m how garments of such
//! embeddings lie on each other, and none of them sees what its displacement does. A correction network is shown that, vertex by
//! vertex: other garments, the body, the forces of the cloth itself. It turns a displacement Δx from the start into
//!
//! ```text
//! Δx + bounded(1 cm (Σ_k a_k d_k + v) + b Δx)
//! ```
//!
//! with its outputs a, v and b: along the directions d_k that are felt; freely; and along what was done before. A step is shorter
//! than 2 cm, so that cloth far from all that was seen in training is not thrown about. Several corrections, one after the other,
//! are steps of a solver that was learned.
//!
//! What is felt, and all that was before, counts as given: no gradient goes through it. A run with one diverged
//! (`docs/corrections.md`).

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use crate::config::ModelConfig;
use crate::initializer::{Initializer, fan_in_bound};
use crate::linear::Linear;
use crate::mlp::residual_pairs;
use crate::ops::{Activation, Segments, product, segment_activate_sum};
use crate::tensors::FeltTensors;

/// Hidden layers after the first: residual pairs.
const HIDDEN: usize = 4;
/// Outputs: one per direction, three free ones, one for what was done before.
const OUTPUTS: usize = FeltTensors::DIRECTIONS + 4;
/// Length that an output of 1 stands for [m].
const SCALE: f64 = 0.01;

/// No step is longer than this [m].
const BOUND: f64 = 0.02;

/// Features, z_v and z_s to a corrected displacement.
///
/// Parameters: `features` with `weight` and `bias`, `vertex` `[d,w]`, `garment` `[width,w]`, `hidden.{0…}` and `output` with
/// `weight` and `bias`. The output starts at zero: an untrained network corrects nothing.
#[derive(Module, Debug)]
pub struct Correction {
    /// Features to width.
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

/// What all corrections of an outfit are given.
pub(crate) struct Given<'a> {
    /// z_v `[ΣV,d]`.
    pub vertex: &'a Tensor<2>,
    /// z_s `[M,width]`.
    pub draping: &'a Tensor<2>,
    /// Rows of each garment.
    pub segments: &'a Segments,
}

impl Correction {
    pub(crate) fn new(config: &ModelConfig, start: &mut Initializer) -> Self {
        let width = config.correction_width;
        let bound = fan_in_bound(FeltTensors::FEATURES + config.embedding + config.width);
        Self {
            features: Linear::uniform(FeltTensors::FEATURES, width, bound, start),
            vertex: start.uniform([config.embedding, width], bound),
            garment: start.uniform([config.width, width], bound),
            hidden: (0..HIDDEN).map(|_| Linear::new(width, width, start)).collect(),
            output: Linear { weight: start.zeros([width, OUTPUTS]), bias: start.zeros([OUTPUTS]) },
        }
    }

    /// The displacement `[ΣV,3]` [m] that `displacement` becomes where `felt` is felt.
    pub(crate) fn correct(
        &self,
        displacement: Tensor<2>,
        FeltTensors { features, directions }: FeltTensors,
        given: &Given<'_>,
    ) -> Tensor<2> {
        let row = product(given.draping.clone(), self.garment.val()) + self.features.bias_row();
        let inputs = [self.features.product(features), product(given.vertex.clone(), self.vertex.val())];
        let hidden = segment_activate_sum(Activation::Gelu, inputs, row, given.segments);
        let outputs = self.output.forward(residual_pairs(&self.hidden, hidden));
        let column = |k: usize| outputs.clone().narrow(1, k, 1);
        let free = outputs.clone().narrow(1, FeltTensors::DIRECTIONS, 3);
        let directed = directions.into_iter().enumerate();
        let correction = directed.fold(free, |sum, (k, direction)| sum + column(k) * direction);
        let step = column(OUTPUTS - 1) * displacement.clone() + correction * SCALE;
        displacement + bounded(step)
    }
}

/// Steps `[N,3]` [m], short ones as they are, long ones shorter than [`BOUND`].
fn bounded(step: Tensor<2>) -> Tensor<2> {
    let squared = (step.clone() * step.clone()).sum_dim(1);
    step / (squared / (BOUND * BOUND) + 1.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{device, uniform, values};

    #[test]
    fn short_steps_stay_and_long_ones_are_bounded_in_their_direction() {
        let steps = uniform(50, 3, 1.0, 3, &device());
        for (scale, most) in [(1e-4, 1e-4), (1e-2, BOUND), (1e3, BOUND)] {
            let given = values(&(steps.clone() * scale));
            let found = values(&bounded(steps.clone() * scale));
            for (a, b) in given.as_chunks::<3>().0.iter().zip(found.as_chunks::<3>().0) {
                let [long, short] = [a, b].map(|v| v.iter().map(|x| f64::from(x * x)).sum::<f64>().sqrt());
                let dot: f64 = a.iter().zip(b).map(|(x, y)| f64::from(x * y)).sum();
                assert!((dot - long * short).abs() <= 1e-5 * long * short, "the same direction");
                assert!(short <= most * 1.8 && short <= BOUND * (1.0 + 1e-6));
                if scale < 1e-3 {
                    assert!((short - long).abs() <= 1e-4 * long);
                }
            }
        }
    }
}
