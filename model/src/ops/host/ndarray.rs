//! Tensors of burn's ndarray backend, which lends no memory.

// burn deprecates the backend but still ships it, and users ask for it.
#![allow(deprecated)]

use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{NdArray, TensorMetadata};

use super::{HostBackend, MatrixView};

/// Elements copied out of a matrix, with its width.
pub(in crate::ops) struct Copied {
    values: Vec<f32>,
    columns: usize,
}

impl HostBackend for NdArray {
    type Held = Copied;

    fn hold(tensor: FloatTensor<Self>) -> Self::Held {
        let columns = tensor.shape()[1];
        let data = burn::backend::read_sync(Self::float_into_data(tensor));
        // Reading host memory cannot fail, and the caller has checked the element type.
        let values = data.ok().and_then(|data| data.try_into_vec::<f32>().ok()).unwrap_or_default();
        Copied { values, columns }
    }

    fn view(held: &Self::Held) -> MatrixView<'_> {
        let columns = held.columns;
        let rows = held.values.len() / columns.max(1);
        MatrixView { values: &held.values, row_stride: columns, columns, rows }
    }
}
