//! What a fused operation is, and how a backend runs, differentiates and records one.
//!
//! An operation lies in a file of its own, which implements [`TensorKernel`] (and [`Operation`], if it is differentiable) and
//! calls [`run`] (or [`apply`]). Nothing here depends on a single operation.

// burn deprecates its ndarray backend but still ships it, and users ask for it.
#![cfg_attr(feature = "ndarray", allow(deprecated))]

use std::fmt::Debug;

#[cfg(feature = "gpu")]
use burn::backend::Cube;
#[cfg(feature = "flex")]
use burn::backend::Flex;
#[cfg(feature = "ndarray")]
use burn::backend::NdArray;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

use super::host::HostBackend;
use super::tensors::Tensors;

/// A function of f32 tensors, in a form for every kind of memory that it is called for. All forms agree to rounding (products
/// on matrix units: to 2⁻¹⁵ of a term).
pub(super) trait TensorKernel {
    /// In the memory of a GPU, in few kernels.
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, _: Tensors<Cube>) -> Tensors<Cube> {
        unreachable!("{OTHER_MEMORY}")
    }

    /// In host memory, in one pass.
    fn on_host<B: HostBackend>(&self, _: Tensors<B>) -> Tensors<B> {
        unreachable!("{OTHER_MEMORY}")
    }
}

/// Why a form is missing.
const OTHER_MEMORY: &str = "callers ask `lies_on_host`; elsewhere they compose other operations";

/// A kernel with one result and a derivative by its N arguments.
pub(super) trait Operation<const N: usize>: TensorKernel + Clone + Debug + Send + 'static {
    /// The same operation where its backward pass will follow: it may have further results, which that pass finds in
    /// [`Saved::state`].
    fn recorded(self) -> Self {
        self
    }

    /// What the backward pass reads, if the arguments marked in `tracked` need a gradient; nothing by default.
    fn saves(&self, _tracked: [bool; N]) -> Saves<N> {
        Saves { arguments: [false; N], result: false }
    }

    /// [`TensorKernel::on_gpu`] of the backward pass, from [`Saved::with`] the gradient of the result to those of the arguments.
    #[cfg(feature = "gpu")]
    fn gradients_on_gpu(&self, _: Tensors<Cube>) -> Tensors<Cube> {
        unreachable!("{OTHER_MEMORY}")
    }

    /// [`TensorKernel::on_host`] of the backward pass.
    fn gradients_on_host<B: HostBackend>(&self, _: Tensors<B>) -> Tensors<B> {
        unreachable!("{OTHER_MEMORY}")
    }

    /// Gradients of the arguments.
    fn backward<B: FusedOps>(&self, saved: Saved<B, N>, gradient: FloatTensor<B>) -> ArgumentGradients<B, N> {
        B::run(&BackwardPass(self), saved.with(gradient)).take().map(Some)
    }
}

/// The backward pass of an operation as a kernel.
pub(super) struct BackwardPass<'a, O, const N: usize>(pub(super) &'a O);

impl<O: Operation<N>, const N: usize> TensorKernel for BackwardPass<'_, O, N> {
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        self.0.gradients_on_gpu(arguments)
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        self.0.gradients_on_host(arguments)
    }
}

/// Gradient of every argument; `None` for a constant.
pub(super) type ArgumentGradients<B, const N: usize> = [Option<FloatTensor<B>>; N];

/// Which tensors of a forward pass its backward pass reads.
pub(super) struct Saves<const N: usize> {
    pub(super) arguments: [bool; N],
    pub(super) result: bool,
}

/// The tensors that an operation [saves](Operation::saves).
#[derive(Clone, Debug)]
pub(super) struct Saved<B: Backend, const N: usize> {
    pub(super) arguments: [Option<FloatTensor<B>>; N],
    pub(super) result: Option<FloatTensor<B>>,
    /// Further results of the [recorded](Operation::recorded) operation.
    pub(super) state: Vec<FloatTensor<B>>,
}

impl<B: Backend, const N: usize> Saved<B, N> {
    /// Saved arguments, saved result, state, gradient of the result: the arguments of most backward kernels.
    pub(super) fn with(self, gradient: FloatTensor<B>) -> Tensors<B> {
        let forward = self.arguments.into_iter().flatten().chain(self.result).chain(self.state);
        Tensors(forward.chain([gradient]).collect())
    }
}

/// Runs an operation, and records it if one of the arguments is tracked.
pub(super) fn apply<O: Operation<N>, const N: usize>(operation: O, arguments: [Tensor<2>; N]) -> Tensor<2> {
    let arguments = Tensors::from(arguments.map(Tensor::into_dispatch));
    arguments.assert_f32();
    let [result] = Dispatch::apply::<O, N>(operation, arguments).take();
    Tensor::from_dispatch(result)
}

/// Runs a kernel and records nothing.
pub(super) fn run(kernel: &impl TensorKernel, arguments: Tensors<Dispatch>) -> Tensors<Dispatch> {
    arguments.assert_f32();
    Dispatch::run(kernel, arguments)
}

/// How a backend runs kernels: it chooses one of their forms.
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "gpu"),
    Autodiff
)]
pub(super) trait FusedOps: Backend {
    /// See [`run`].
    fn run<K: TensorKernel>(kernel: &K, #[extension_type] arguments: Tensors<Self>) -> Tensors<Self>;

    /// See [`apply`].
    fn apply<O: Operation<N>, const N: usize>(
        operation: O,
        #[extension_type] arguments: Tensors<Self>,
    ) -> Tensors<Self> {
        Self::run(&operation, arguments)
    }
}

#[cfg(feature = "flex")]
impl FusedOps for Flex {
    fn run<K: TensorKernel>(kernel: &K, arguments: Tensors<Self>) -> Tensors<Self> {
        kernel.on_host(arguments)
    }
}

#[cfg(feature = "ndarray")]
impl FusedOps for NdArray {
    fn run<K: TensorKernel>(kernel: &K, arguments: Tensors<Self>) -> Tensors<Self> {
        kernel.on_host(arguments)
    }
}

#[cfg(feature = "gpu")]
impl FusedOps for Cube {
    fn run<K: TensorKernel>(kernel: &K, arguments: Tensors<Self>) -> Tensors<Self> {
        kernel.on_gpu(arguments)
    }
}

impl<B: FusedOps, C: CheckpointStrategy> FusedOps for Autodiff<B, C> {
    fn run<K: TensorKernel>(kernel: &K, arguments: Tensors<Self>) -> Tensors<Self> {
        let plain = arguments.0.into_iter().map(|tensor| tensor.into_primitive());
        let results = B::run(kernel, Tensors(plain.collect()));
        Tensors(results.0.into_iter().map(<FloatTensor<Self>>::new).collect())
    }

    fn apply<O: Operation<N>, const N: usize>(operation: O, arguments: Tensors<Self>) -> Tensors<Self> {
        let arguments: [FloatTensor<Self>; N] = arguments.take();
        let tracked = arguments.each_ref().map(|tensor| tensor.is_tracked());
        let nodes = arguments.each_ref().map(|tensor| tensor.node());
        let arguments = Tensors::from(arguments.map(|tensor| tensor.into_primitive()));
        let prepared = Backward::<B, N>::prepare::<C>(Recorded(operation.clone()), nodes);
        let result = match prepared.compute_bound().stateful() {
            OpsKind::UnTracked(prepared) => {
                let [result] = B::run(&operation, arguments).take();
                prepared.finish(result)
            }
            OpsKind::Tracked(prepared) => {
                let saves = operation.saves(tracked);
                let saved = std::array::from_fn(|i| saves.arguments[i].then(|| arguments.0[i].clone()));
                let Tensors(mut results) = B::run(&operation.recorded(), arguments);
                let state = results.split_off(1);
                let [result] = Tensors::<B>(results).take();
                let saved = Saved { arguments: saved, result: saves.result.then(|| result.clone()), state };
                prepared.finish(saved, result)
            }
        };
        [result].into()
    }
}

/// An operation in the graph of a backward pass.
#[derive(Debug)]
struct Recorded<O>(O);

impl<B: FusedOps, O: Operation<N>, const N: usize> Backward<B, N> for Recorded<O> {
    type State = Saved<B, N>;

    fn backward(self, ops: Ops<Self::State, N>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let gradient = gradients.consume::<B>(&ops.node);
        let of_arguments = self.0.backward(ops.state, gradient);
        for (parent, gradient) in ops.parents.into_iter().zip(of_arguments) {
            if let (Some(parent), Some(gradient)) = (parent, gradient) {
                gradients.register::<B>(parent.id, gradient);
            }
        }
    }
}
