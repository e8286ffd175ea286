//! What goes into a step and what it has computed.

use crate::config::Trains;
use crate::dataset::PreparedScene;
use crate::inference::tensor_store::TensorStore;
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use clothcombo_physics::autodiff::SceneLossOutput;
use std::ops::AddAssign;
use std::time::Duration;

/// What one process computes of a step.
#[derive(Clone, Copy)]
pub struct StepInput<'a> {
    /// Constant tensors of the garments.
    pub tensors: &'a TensorStore,
    /// Scenes that this process computes.
    pub scenes: &'a [PreparedScene],
    /// Scenes of the whole step: each weighs 1 / `total`.
    pub total: usize,
    /// Which networks learn.
    pub trains: Trains,
    /// Makes the gradient NaN, for tests of what happens then.
    pub spoil_gradient: bool,
}

impl<'a> StepInput<'a> {
    /// A step of `scenes` and no others.
    pub fn whole(tensors: &'a TensorStore, scenes: &'a [PreparedScene], trains: Trains) -> Self {
        Self { tensors, scenes, total: scenes.len(), trains, spoil_gradient: false }
    }
}

/// What a step has computed so far: of one scene, of several, of all; before and after the update.
#[derive(Default)]
pub struct StepOutput {
    /// Weighted loss: mean over the bodies of a scene, summed over scenes with their weights.
    pub loss: f64,
    /// Energies per scene and body.
    pub scenes: Vec<Vec<SceneLossOutput>>,
    /// Gradient of `loss`; empty when nothing in the scenes depends on what is trained.
    pub gradients: GradientsParams,
    /// Gradient norm before clipping: the largest of the scenes' where every scene is clipped ([`crate::config::ClipScope::Scene`]), else that
    /// of `gradients` once they are clipped, 0 before. NaN if that of any scene is.
    pub gradient_norm: f64,
    /// Whether the parameters were left alone because loss or gradient was not finite.
    pub skipped: bool,
    /// Where the time went.
    pub times: StepTimes,
}

/// Wall-clock time by part of a step; honest on backends that compute at once (the CPU ones). Of scenes that were computed in
/// parallel the slowest counts.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTimes {
    /// Networks and energies.
    pub forward: Duration,
    /// Gradients.
    pub backward: Duration,
    /// Clipping, Adam, the running average.
    pub update: Duration,
}

impl StepTimes {
    pub fn total(&self) -> Duration {
        self.forward + self.backward + self.update
    }
}

impl AddAssign for StepTimes {
    fn add_assign(&mut self, other: Self) {
        self.forward += other.forward;
        self.backward += other.backward;
        self.update += other.update;
    }
}

/// A gradient norm on the host; 0 of no gradient.
pub(super) fn norm_of(norm: Option<Tensor<1>>) -> f64 {
    norm.map_or(0.0, |norm| f64::from(norm.into_scalar::<f32>()))
}

/// The larger of two norms; NaN if either is, which `f64::max` would drop.
pub fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}
