//! Tensors of burn's flex backend, which lie in host memory as they are.

use std::ops::Range;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use burn::tensor::DType;

use super::{HostBackend, MatrixView};
use crate::ops::composed::multiply_add;
use crate::ops::gemm;

/// Where the elements lie once the tensor has been made contiguous; `None` if they are not f32.
fn contiguous(tensor: &mut FloatTensor<Flex>) -> Option<Range<usize>> {
    if tensor.dtype() != DType::F32 {
        return None;
    }
    if !tensor.layout().is_contiguous() {
        *tensor = tensor.to_contiguous();
    }
    let start = tensor.layout().start_offset();
    Some(start..start + tensor.layout().num_elements())
}

impl HostBackend for Flex {
    type Held = FloatTensor<Flex>;

    fn hold(tensor: FloatTensor<Self>) -> Self::Held {
        let layout = tensor.layout();
        // A block of columns of a wider matrix is read in place.
        let contiguous_rows = match *layout.strides() {
            [row, column] => (column == 1 || layout.shape()[1] == 1) && row >= 0,
            _ => false,
        };
        if contiguous_rows { tensor } else { tensor.to_contiguous() }
    }

    fn view(held: &Self::Held) -> MatrixView<'_> {
        let layout = held.layout();
        let [rows, columns] = [layout.shape()[0], layout.shape()[1]];
        let values = &held.storage::<f32>()[layout.start_offset()..];
        MatrixView { values, row_stride: layout.strides()[0] as usize, columns, rows }
    }

    fn values(tensor: &mut FloatTensor<Self>) -> Option<&[f32]> {
        let range = contiguous(tensor)?;
        tensor.storage::<f32>().get(range)
    }

    fn values_mut(tensor: &mut FloatTensor<Self>) -> Option<&mut [f32]> {
        let range = contiguous(tensor)?;
        tensor.storage_mut::<f32>().get_mut(range)
    }

    fn own_values_mut(tensor: &mut FloatTensor<Self>) -> Option<&mut [f32]> {
        let layout = tensor.layout();
        let whole = tensor.dtype() == DType::F32 && layout.is_contiguous() && layout.start_offset() == 0;
        let count = layout.num_elements();
        (whole && tensor.is_unique())
            .then(|| tensor.storage_mut::<f32>())
            .filter(|values| values.len() == count)
    }

    fn product(
        lhs: FloatTensor<Self>,
        rhs: FloatTensor<Self>,
        addend: Option<FloatTensor<Self>>,
    ) -> FloatTensor<Self> {
        let (rows, columns) = (lhs.shape()[0], rhs.shape()[1]);
        if rows * lhs.shape()[1] * columns == 0 {
            return multiply_add::<Self>(lhs, rhs, addend);
        }
        let Some(mut sum) = addend else {
            return Self::matrix(gemm::product(&lhs, &rhs), columns);
        };
        assert_eq!(sum.shape().as_slice(), [rows, columns], "the addend of a product has another size");
        if let Some(values) = Self::own_values_mut(&mut sum) {
            gemm::add_product(&lhs, &rhs, values);
            return sum;
        }
        let mut values = Self::values(&mut sum).expect("f32").to_vec();
        gemm::add_product(&lhs, &rhs, &mut values);
        Self::matrix(values, columns)
    }
}
