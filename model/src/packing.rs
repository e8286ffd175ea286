//! Rows of several garments packed into one tensor.

use std::ops::Range;
use std::sync::Arc;

/// Where the rows of M garments lie in a tensor `[ΣV,…]` that holds the garments one after another.
///
/// Garment i has the rows `offsets[i]..offsets[i + 1]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packing {
    offsets: Arc<[usize]>,
}

impl Packing {
    /// Garments with the given numbers of rows, in order.
    pub fn new(rows: impl IntoIterator<Item = usize>) -> Self {
        let running_sum = |end: &mut usize, rows| {
            *end += rows;
            Some(*end)
        };
        Self { offsets: std::iter::once(0).chain(rows.into_iter().scan(0, running_sum)).collect() }
    }

    /// First row of every garment, then the number of all rows: `[M+1]`, ascending from 0 to ΣV.
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// Number of garments M.
    pub fn count(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Number of rows ΣV of all garments together.
    pub fn rows(&self) -> usize {
        self.offsets[self.count()]
    }

    /// What of `packed`, one value per row, belongs to each garment.
    ///
    /// # Panics
    /// If there are fewer values than rows.
    pub fn parts<'a, T>(&self, packed: &'a [T]) -> Vec<&'a [T]> {
        self.ranges().map(|rows| &packed[rows]).collect()
    }

    /// The rows of every garment.
    pub fn ranges(&self) -> impl ExactSizeIterator<Item = Range<usize>> + '_ {
        self.offsets.windows(2).map(|ends| ends[0]..ends[1])
    }
}
