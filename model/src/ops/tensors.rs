//! Arguments and results of a fused operation.

use burn::backend::tensor::FloatTensor;
use burn::backend::{
    Backend, BackendTensor, Dispatch, DispatchAutodiffContext, DispatchTensor, DispatchTensorKind,
    ExtensionType, TensorMetadata,
};
use burn::tensor::DType;

/// Tensors of one backend, in order.
pub(super) struct Tensors<B: Backend>(pub(super) Vec<FloatTensor<B>>);

impl<B: Backend> Tensors<B> {
    /// The tensors one by one.
    ///
    /// # Panics
    /// If there are not N.
    #[track_caller]
    pub(super) fn take<const N: usize>(self) -> [FloatTensor<B>; N] {
        let count = self.0.len();
        self.0.try_into().unwrap_or_else(|_| panic!("{count} tensors, expected {N}"))
    }

    /// # Panics
    /// If a tensor has other elements: kernels do not look.
    pub(super) fn assert_f32(&self) {
        assert!(self.0.iter().all(|tensor| tensor.dtype() == DType::F32), "networks compute in f32");
    }

    /// N tensors, and one more if there is one.
    pub(super) fn take_optional<const N: usize>(mut self) -> ([FloatTensor<B>; N], Option<FloatTensor<B>>) {
        let optional = if self.0.len() > N { self.0.pop() } else { None };
        (self.take(), optional)
    }
}

impl<B: Backend, const N: usize> From<[FloatTensor<B>; N]> for Tensors<B> {
    fn from(tensors: [FloatTensor<B>; N]) -> Self {
        Self(tensors.into())
    }
}

/// Lets burn find the backend of the tensors; its derive macro has no lists.
impl<B: Backend> ExtensionType<B> for Tensors<B> {
    type Target = Tensors<Dispatch>;

    fn map_to_dispatch<F>(self, kind: F, autodiff: DispatchAutodiffContext) -> Self::Target
    where
        F: Fn(BackendTensor<B>) -> DispatchTensorKind,
    {
        let wrap = |tensor| DispatchTensor { kind: kind(BackendTensor::Float(tensor)), autodiff };
        Tensors(self.0.into_iter().map(wrap).collect())
    }

    fn map_from_dispatch<F>(target: Self::Target, unwrap: F) -> Self
    where
        F: Fn(DispatchTensor) -> BackendTensor<B>,
    {
        Self(target.0.into_iter().map(|tensor| unwrap(tensor).float()).collect())
    }

    fn routing_tensor(target: &Self::Target) -> Option<&DispatchTensor> {
        target.0.first()
    }

    fn routing_float_tensor(target: &Self::Target) -> Option<&DispatchTensor> {
        target.0.first()
    }

    fn autodiff_context(target: &Self::Target) -> DispatchAutodiffContext {
        let contexts = target.0.iter().map(|tensor| tensor.autodiff);
        contexts.fold(DispatchAutodiffContext::Disabled, DispatchAutodiffContext::merge)
    }
}
