//! Tensors of burn's ndarray backend.

// burn deprecates the backend but still ships it, and users ask for it.
#![allow(deprecated)]

use burn::backend::NdArray;
use burn::backend::tensor::FloatTensor;

use super::{HostBackend, MatrixView};

type NdArrayTensor = FloatTensor<NdArray>;

impl HostBackend for NdArray {
    fn hold(mut matrix: NdArrayTensor) -> NdArrayTensor {
        Self::values(&mut matrix);
        matrix
    }

    fn view(held: &NdArrayTensor) -> MatrixView<'_> {
        let NdArrayTensor::F32(storage) = held else { panic!("a matrix of f32") };
        let values = storage.view().to_slice().expect("held matrices are in row-major order");
        MatrixView::of_rows(values, storage.shape()[1])
    }

    fn values(tensor: &mut NdArrayTensor) -> &[f32] {
        let NdArrayTensor::F32(storage) = tensor else { panic!("a tensor of f32") };
        if !storage.view().is_standard_layout() {
            *storage = storage.view().as_standard_layout().to_shared().into();
        }
        storage.view().to_slice().expect("it is in row-major order")
    }

    fn values_mut(tensor: &mut NdArrayTensor) -> &mut [f32] {
        Self::values(tensor);
        let NdArrayTensor::F32(storage) = tensor else { panic!("a tensor of f32") };
        storage.ensure_owned().as_slice_mut().expect("it is in row-major order")
    }
}
