//! Lists of different lengths in one piece of memory (compressed sparse rows).

use std::ops::Range;

/// One list, or row, for every number below a count.
#[derive(Debug, Clone)]
pub(crate) struct CompressedRows<T> {
    /// Where each row begins, and one entry more.
    offsets: Vec<u32>,
    items: Vec<T>,
}

impl<T: Copy> CompressedRows<T> {
    /// `count` rows, one after the other.
    pub fn from_fn<I: IntoIterator<Item = T>>(count: usize, row: impl Fn(usize) -> I) -> Self {
        let (mut offsets, mut items) = (Vec::with_capacity(count + 1), Vec::new());
        offsets.push(0);
        for i in 0..count {
            items.extend(row(i));
            offsets.push(items.len() as u32);
        }
        Self { offsets, items }
    }

    /// Items sorted into the row of their key, which is below `count`; within a row they keep their order.
    pub fn grouped(count: usize, keyed: impl Iterator<Item = (usize, T)> + Clone) -> Self
    where
        T: Default,
    {
        let mut offsets = vec![0; count + 1];
        keyed.clone().for_each(|(key, _)| offsets[key + 1] += 1);
        for i in 0..count {
            offsets[i + 1] += offsets[i];
        }
        let mut next = offsets.clone();
        let mut items = vec![T::default(); offsets[count] as usize];
        for (key, item) in keyed {
            items[next[key] as usize] = item;
            next[key] += 1;
        }
        Self { offsets, items }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Where each row begins among all items, and one entry more.
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }

    /// The items of all rows.
    pub fn items(&self) -> &[T] {
        &self.items
    }

    /// Where the items of row `i` are among those of all rows.
    #[inline(always)]
    pub fn range(&self, i: usize) -> Range<usize> {
        self.offsets[i] as usize..self.offsets[i + 1] as usize
    }

    /// The items of row `i`.
    #[inline(always)]
    pub fn row(&self, i: usize) -> &[T] {
        &self.items[self.range(i)]
    }
}

/// For every vertex, the corners of elements that it is: slot `N·element + corner`, ascending. Every index in `elements` must
/// be below `vertex_count`.
pub(crate) fn corners_at_vertices<const N: usize>(
    vertex_count: usize,
    elements: &[[u32; N]],
) -> CompressedRows<u32> {
    let corners = elements.as_flattened().iter().zip(0u32..);
    CompressedRows::grouped(vertex_count, corners.map(|(&v, slot)| (v as usize, slot)))
}

/// For every vertex, those of `some` of the `faces` that have it as a corner, in their order.
pub(crate) fn faces_at_vertices(
    vertex_count: usize,
    faces: &[[u32; 3]],
    some: impl Iterator<Item = u32> + Clone,
) -> CompressedRows<u32> {
    let corners = some.flat_map(|f| faces[f as usize].map(|v| (v as usize, f)));
    CompressedRows::grouped(vertex_count, corners)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_hold_what_they_were_given_in_order() {
        let grouped = CompressedRows::grouped(4, [(2, 'a'), (0, 'b'), (2, 'c')].into_iter());
        assert_eq!((grouped.row(0), grouped.row(1), grouped.row(2)), (&['b'][..], &[][..], &['a', 'c'][..]));
        assert_eq!((grouped.len(), grouped.range(2)), (4, 1..3));
        let listed = CompressedRows::from_fn(3, |i| (0..i).map(move |k| 10 * i + k));
        assert_eq!((listed.row(0), listed.row(1), listed.row(2)), (&[][..], &[10][..], &[20, 21][..]));
        assert_eq!(corners_at_vertices(3, &[[2, 0], [2, 1]]).row(2), [0, 2]);
        assert_eq!(
            faces_at_vertices(3, &[[0, 1, 2], [2, 1, 0], [0, 1, 1]], [0, 2].into_iter()).row(1),
            [0, 2, 2]
        );
    }
}
