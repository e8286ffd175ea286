//! Tensors of burn's flex backend, which lie in host memory as they are.

use std::ops::Range;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};

use super::{HostBackend, MatrixView};
use crate::ops::gemm;

/// A matrix with its own strides.
fn strided(matrix: &FloatTensor<Flex>) -> MatrixView<'_> {
    let layout = matrix.layout();
    let values = &matrix.storage::<f32>()[layout.start_offset()..];
    let stride = |axis: usize| usize::try_from(layout.strides()[axis]).expect("nothing flips a matrix");
    MatrixView::new(values, [0, 1].map(|axis| layout.shape()[axis]), [0, 1].map(stride))
}

/// Where the elements lie once the tensor has been made contiguous.
fn contiguous(tensor: &mut FloatTensor<Flex>) -> Range<usize> {
    if !tensor.layout().is_contiguous() {
        *tensor = tensor.to_contiguous();
    }
    let start = tensor.layout().start_offset();
    start..start + tensor.layout().num_elements()
}

impl HostBackend for Flex {
    fn hold(matrix: FloatTensor<Self>) -> FloatTensor<Self> {
        let layout = matrix.layout();
        // A block of columns of a wider matrix is read in place.
        let contiguous_rows = match *layout.strides() {
            [row, column] => (column == 1 || layout.shape()[1] == 1) && row >= 0,
            _ => false,
        };
        if contiguous_rows { matrix } else { matrix.to_contiguous() }
    }

    fn view(held: &FloatTensor<Self>) -> MatrixView<'_> {
        strided(held)
    }

    fn values(tensor: &mut FloatTensor<Self>) -> &[f32] {
        let range = contiguous(tensor);
        &tensor.storage::<f32>()[range]
    }

    fn values_mut(tensor: &mut FloatTensor<Self>) -> &mut [f32] {
        let range = contiguous(tensor);
        &mut tensor.storage_mut::<f32>()[range]
    }

    fn own_values_mut(tensor: &mut FloatTensor<Self>) -> Option<&mut [f32]> {
        let layout = tensor.layout();
        let whole = layout.is_contiguous() && layout.start_offset() == 0;
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
        let [lhs, rhs] = [strided(&lhs), strided(&rhs)];
        let columns = rhs.columns();
        let Some(mut sum) = addend else { return Self::matrix(gemm::product(lhs, rhs), columns) };
        assert_eq!(sum.shape().as_slice(), [lhs.rows(), columns], "the addend of a product has another size");
        if let Some(values) = Self::own_values_mut(&mut sum) {
            gemm::add_product(lhs, rhs, values);
            return sum;
        }
        let mut values = Self::values(&mut sum).to_vec();
        gemm::add_product(lhs, rhs, &mut values);
        Self::matrix(values, columns)
    }
}
