//! Small compositions of a backend's own operations on matrices.

use std::ops::Range;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::{Shape, Slice};

use crate::packing::Packing;

/// `lhs·rhs`, plus the addend if there is one.
pub(super) fn multiply_add<B: Backend>(
    lhs: FloatTensor<B>,
    rhs: FloatTensor<B>,
    addend: Option<FloatTensor<B>>,
) -> FloatTensor<B> {
    add_optional::<B>(B::float_matmul(lhs, rhs), addend)
}

/// A tensor, plus the addend if there is one.
pub(super) fn add_optional<B: Backend>(
    tensor: FloatTensor<B>,
    addend: Option<FloatTensor<B>>,
) -> FloatTensor<B> {
    match addend {
        Some(addend) => B::float_add(tensor, addend),
        None => tensor,
    }
}

/// A block of a matrix.
pub(super) fn block<B: Backend>(
    matrix: FloatTensor<B>,
    rows: Range<usize>,
    columns: Range<usize>,
) -> FloatTensor<B> {
    B::float_slice(matrix, &[Slice::from(rows), Slice::from(columns)])
}

/// A block of whole rows.
pub(super) fn row_block<B: Backend>(matrix: FloatTensor<B>, rows: Range<usize>) -> FloatTensor<B> {
    let columns = matrix.shape()[1];
    block::<B>(matrix, rows, 0..columns)
}

/// A block of whole columns.
pub(super) fn column_block<B: Backend>(matrix: FloatTensor<B>, columns: Range<usize>) -> FloatTensor<B> {
    let rows = matrix.shape()[0];
    block::<B>(matrix, 0..rows, columns)
}

/// Repeats the row of every garment; a lone row is left to broadcast.
pub(super) fn broadcast_rows<B: Backend>(rows: FloatTensor<B>, packing: &Packing) -> FloatTensor<B> {
    if packing.count() == 1 {
        return rows;
    }
    let columns = rows.shape()[1];
    let blocks = packing.ranges().enumerate().map(|(garment, range)| {
        let row = row_block::<B>(rows.clone(), garment..garment + 1);
        B::float_expand(row, Shape::new([range.len(), columns]))
    });
    concatenate::<B>(blocks.collect())
}

/// Concatenates along the rows; a lone matrix is returned as it is.
pub(super) fn concatenate<B: Backend>(mut blocks: Vec<FloatTensor<B>>) -> FloatTensor<B> {
    match blocks.len() {
        1 => blocks.remove(0),
        _ => B::float_cat(blocks, 0),
    }
}
