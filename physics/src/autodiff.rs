//! The energies as one differentiable burn operation: the only file of this crate that knows burn.
//!
//! The forward pass reads the positions back to the host, evaluates value and gradient there together, and keeps the gradient;
//! the backward pass scales it. On a device without autodiff no gradient is computed.

// burn marks its ndarray backend as succeeded by flex; users may still choose it.
#![cfg_attr(feature = "ndarray", allow(deprecated))]

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use burn::backend::Cube;
#[cfg(feature = "flex")]
use burn::backend::Flex;
#[cfg(feature = "ndarray")]
use burn::backend::NdArray;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{Tensor, TensorData};
use std::fmt::Debug;
use std::sync::{Arc, OnceLock};

use crate::energy::{SceneEnergy, SceneValue};

/// A scalar function of positions with its gradient, evaluated on the host.
pub trait HostEnergy: Debug + Send + Sync {
    /// Value and gradient at `x`, the row-major entries of a tensor; the gradient has the length of `x`.
    fn evaluate(&self, x: &[f32]) -> (f64, Vec<f32>);

    /// The value only, for passes that need no gradient.
    fn value(&self, x: &[f32]) -> f64 {
        self.evaluate(x).0
    }
}

/// The operation as burn dispatches it; call it as [`host_energy`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(any(feature = "wgpu", feature = "cuda")),
    Autodiff
)]
pub trait HostEnergyOps: Backend {
    /// The energy `[1]` at `x`.
    fn host_energy(x: FloatTensor<Self>, energy: Arc<dyn HostEnergy>) -> FloatTensor<Self>;
}

/// Energy `[1]` at the positions `x` `[N, 3]`; differentiable if `x` is.
///
/// The energy has been evaluated when this returns, on every backend.
///
/// # Panics
/// If the device fails to hand the positions over.
pub fn host_energy(x: Tensor<2>, energy: Arc<dyn HostEnergy>) -> Tensor<1> {
    Tensor::from_dispatch(<Dispatch as HostEnergyOps>::host_energy(x.into_dispatch(), energy))
}

/// Calls `f` with the entries of `x` on the host.
fn on_host<B: Backend, R>(x: FloatTensor<B>, f: impl FnOnce(&[f32]) -> R) -> R {
    let data = burn::backend::read_sync(B::float_into_data(x)).expect("the device hands the positions over");
    // Half precision is widened; f32 is used in place.
    let data = data.convert::<f32>();
    f(data.as_slice::<f32>().expect("converted to f32"))
}

fn scalar<B: Backend>(value: f64, device: &burn::backend::tensor::Device<B>) -> FloatTensor<B> {
    B::float_from_data(TensorData::new(vec![value as f32], [1]), device)
}

macro_rules! evaluates_on_host {
    ($($backend:ident: $condition:meta),* $(,)?) => {$(
        #[cfg($condition)]
        impl HostEnergyOps for $backend {
            fn host_energy(x: FloatTensor<Self>, energy: Arc<dyn HostEnergy>) -> FloatTensor<Self> {
                let device = x.device();
                scalar::<Self>(on_host::<Self, _>(x, |x| energy.value(x)), &device)
            }
        }
    )*};
}

evaluates_on_host!(
    Flex: feature = "flex",
    NdArray: feature = "ndarray",
    Cube: any(feature = "wgpu", feature = "cuda"),
);

/// `∂L/∂x = ∂L/∂E · ∂E/∂x`, the second factor kept from the forward pass.
#[derive(Debug)]
struct ScaleGradient;

impl<B: Backend> Backward<B, 1> for ScaleGradient {
    type State = FloatTensor<B>;

    fn backward(self, ops: Ops<Self::State, 1>, gradients: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let upstream = gradients.consume::<B>(&ops.node);
        let [parent] = ops.parents;
        if let Some(parent) = parent {
            let upstream = B::float_reshape(upstream, [1, 1].into());
            gradients.register::<B>(parent.id, B::float_mul(ops.state, upstream));
        }
    }
}

impl<B: HostEnergyOps, C: CheckpointStrategy> HostEnergyOps for Autodiff<B, C> {
    fn host_energy(x: FloatTensor<Self>, energy: Arc<dyn HostEnergy>) -> FloatTensor<Self> {
        match ScaleGradient.prepare::<C>([x.node()]).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => {
                let x = x.into_primitive();
                let (device, shape) = (x.device(), x.shape());
                let (value, gradient) = on_host::<B, _>(x, |x| energy.evaluate(x));
                let gradient = B::float_from_data(TensorData::new(gradient, shape), &device);
                prepared.finish(gradient, scalar::<B>(value, &device))
            }
            OpsKind::UnTracked(prepared) => prepared.finish(B::host_energy(x.into_primitive(), energy)),
        }
    }
}

/// A scene as a function of its packed positions: posed, then canonical ones if the scene needs them.
#[derive(Debug)]
struct HostScene {
    scene: Arc<SceneEnergy<f32>>,
    value: OnceLock<SceneValue<f32>>,
}

impl HostScene {
    fn split<'a>(&self, x: &'a [f32]) -> (&'a [[f32; 3]], &'a [[f32; 3]]) {
        let (positions, _) = x.as_chunks::<3>();
        positions.split_at(self.scene.vertex_count())
    }
}

impl HostEnergy for HostScene {
    fn evaluate(&self, x: &[f32]) -> (f64, Vec<f32>) {
        let (posed, canonical) = self.split(x);
        let mut value = self.scene.evaluate(posed, canonical);
        // The gradients go to the backward pass and nowhere else.
        let mut gradient = std::mem::take(&mut value.posed_gradient);
        let canonical_gradient = std::mem::take(&mut value.canonical_gradient);
        if !canonical.is_empty() {
            gradient.extend(canonical_gradient);
        }
        let total = value.total;
        let _ = self.value.set(value);
        (total, gradient.into_flattened())
    }

    fn value(&self, x: &[f32]) -> f64 {
        let (posed, canonical) = self.split(x);
        let value = self.scene.value(posed, canonical);
        let total = value.total;
        let _ = self.value.set(value);
        total
    }
}

/// A differentiable loss and the values that it is made of.
#[derive(Debug)]
pub struct SceneLossOutput {
    /// The weighted sum of all terms `[1]`.
    pub loss: Tensor<1>,
    host: Arc<HostScene>,
}

impl SceneLossOutput {
    /// Total in `f64` and raw value of every term, on the host; its gradients are empty (the backward pass has them).
    pub fn value(&self) -> &SceneValue<f32> {
        self.host.value.get().expect("the forward pass has run")
    }
}

/// The weighted sum of all energies of a scene at `posed` and `canonical` positions, both `[ΣV, 3]` (m), garment after
/// garment; differentiable in both.
///
/// # Panics
/// If a shape is not that of the scene, or the device fails to hand the positions over.
pub fn scene_loss(posed: Tensor<2>, canonical: Tensor<2>, scene: Arc<SceneEnergy<f32>>) -> SceneLossOutput {
    let expected = [scene.vertex_count(), 3];
    assert_eq!(posed.dims(), expected, "posed positions");
    assert_eq!(canonical.dims(), expected, "canonical positions");
    let packed = if scene.needs_canonical() { Tensor::cat(vec![posed, canonical], 0) } else { posed };
    let host = Arc::new(HostScene { scene, value: OnceLock::new() });
    let loss = host_energy(packed, host.clone());
    SceneLossOutput { loss, host }
}

#[cfg(all(test, any(feature = "flex", feature = "ndarray", feature = "wgpu")))]
mod tests;
